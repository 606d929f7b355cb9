"""Simulators built from effects: the paper's Wiener-Hammerstein system, and physical models of an axis and an arm."""

from whsklearn.systems.arm import Arm
from whsklearn.systems.base_parameters import BaseParameters, base_parameters
from whsklearn.systems.servo import ServoAxis, record_frame, simulate_many
from whsklearn.systems.servo_parts import Drive, PIDController, Sensor, Transmission
from whsklearn.systems.wiener_hammerstein import WienerHammersteinSystem

__all__ = [
    "Arm", "BaseParameters", "Drive", "PIDController", "Sensor", "ServoAxis", "Transmission", "WienerHammersteinSystem",
    "base_parameters", "record_frame", "simulate_many",
]  # fmt: skip
