"""Compare records of one axis or arm: what changed and by how much, or the smallest change that would show."""

from whsklearn.compare.arm import ArmRecord
from whsklearn.compare.comparison import Change, Comparison
from whsklearn.compare.records import compare_arms, compare_records
from whsklearn.compare.report import write_report

__all__ = ["ArmRecord", "Change", "Comparison", "compare_arms", "compare_records", "write_report"]
