"""Simulators built from effects: the Wiener-Hammerstein system of the paper, and the axis as physics."""

from whsklearn.systems.servo import ServoAxis
from whsklearn.systems.servo_parts import Drive, PIDController, Sensor, Transmission
from whsklearn.systems.servo_simulation import record_frame, simulate_many
from whsklearn.systems.wiener_hammerstein import WienerHammersteinSystem

__all__ = [
    "Drive",
    "PIDController",
    "Sensor",
    "ServoAxis",
    "Transmission",
    "WienerHammersteinSystem",
    "record_frame",
    "simulate_many",
]
