"""Close the gap: find where simulation and measurement disagree, name what is missing, add it, prove it."""

from whsklearn.gap.diagnosis import Diagnosis, NamedEffect
from whsklearn.gap.finder import GapFinder
from whsklearn.gap.record import ServoRecord
from whsklearn.gap.verdict import VERDICTS

__all__ = ["VERDICTS", "Diagnosis", "GapFinder", "NamedEffect", "ServoRecord"]
