"""Close the gap: find where simulation and measurement disagree, name what is missing, add it, prove it."""

from whsklearn.gap.diagnosis import VERDICTS, Diagnosis, NamedEffect
from whsklearn.gap.finder import GapFinder
from whsklearn.gap.record import ServoRecord

__all__ = ["VERDICTS", "Diagnosis", "GapFinder", "NamedEffect", "ServoRecord"]
