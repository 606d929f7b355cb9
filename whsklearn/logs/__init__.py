"""Logs of axes: one reader for every format, which mends what can be mended and says so."""

from whsklearn.logs.check import check_log
from whsklearn.logs.errors import ColumnError, LogError, LogWarning
from whsklearn.logs.findings import Finding, LogReport
from whsklearn.logs.formats import open_source
from whsklearn.logs.load import load_log

__all__ = ["ColumnError", "Finding", "LogError", "LogReport", "LogWarning", "check_log", "load_log", "open_source"]
