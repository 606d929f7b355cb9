"""Logs for experiments: generators, the library's own simulated record, loaders of user and of published records."""

from whsklearn.datasets.arm import default_arm, make_arm_log
from whsklearn.datasets.published import (
    fetch_cascaded_tanks,
    fetch_coupled_drives,
    fetch_emps,
    fetch_kr300,
    fetch_silverbox,
)
from whsklearn.datasets.servo import default_axis, draw_effect, load_turntable, make_servo_log, reference_signal
from whsklearn.datasets.wiener_hammerstein import make_wiener_hammerstein
from whsklearn.logs import Finding, LogReport, check_log, load_log

__all__ = [
    "Finding", "LogReport", "check_log", "default_arm", "default_axis", "draw_effect", "fetch_cascaded_tanks",
    "fetch_coupled_drives", "fetch_emps", "fetch_kr300", "fetch_silverbox", "load_log", "load_turntable",
    "make_arm_log", "make_servo_log", "make_wiener_hammerstein", "reference_signal",
]  # fmt: skip
