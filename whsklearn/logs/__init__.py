"""Logs of axes: one reader for every format, which repairs what can be repaired and reports it."""

from whsklearn.logs.check import check_log
from whsklearn.logs.errors import ColumnError, LogError, LogWarning
from whsklearn.logs.findings import Finding, LogReport
from whsklearn.logs.formats import open_source
from whsklearn.logs.load import load_log
from whsklearn.logs.slips import Slip, slips_in
from whsklearn.logs.source import Column, Source

__all__ = [
    "Column", "ColumnError", "Finding", "LogError", "LogReport", "LogWarning", "Slip", "Source", "check_log",
    "load_log", "open_source", "slips_in",
]  # fmt: skip
