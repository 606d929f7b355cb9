"""Compare records of one axis: what changed between them and by how much, or the smallest change that would show."""

from whsklearn.compare.comparison import Change, Comparison
from whsklearn.compare.records import compare_records
from whsklearn.compare.report import write_report

__all__ = ["Change", "Comparison", "compare_records", "write_report"]
