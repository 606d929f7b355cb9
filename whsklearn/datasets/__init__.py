"""Logs to try things on: makers, the library's own simulated record, loaders of the user's and of published ones."""

from whsklearn.datasets.drawn_effects import draw_effect
from whsklearn.datasets.references import reference_signal
from whsklearn.datasets.servo import make_servo_log
from whsklearn.datasets.turntable import load_turntable

__all__ = ["draw_effect", "load_turntable", "make_servo_log", "reference_signal"]
