"""Compare records of one axis or arm: what changed and by how much, or the smallest change that would show."""

from whsklearn.compare.arm import ArmLog
from whsklearn.compare.comparison import Change, Comparison
from whsklearn.compare.records import at_an_alarm, at_an_alarm_of, compare_arms, compare_records
from whsklearn.compare.report import write_report

__all__ = [
    "ArmLog", "Change", "Comparison", "at_an_alarm", "at_an_alarm_of", "compare_arms", "compare_records",
    "write_report",
]  # fmt: skip
