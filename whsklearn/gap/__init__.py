"""Close the gap: find where simulation and measurement disagree, name what is missing, add it and prove the result."""

from whsklearn.gap.data_check import DataProblem
from whsklearn.gap.diagnosis import VERDICTS, CandidateLine, Curve, Diagnosis, LearnedTorques, NamedEffect, Place
from whsklearn.gap.finder import GapFinder
from whsklearn.gap.record import ServoRecord

__all__ = [
    "VERDICTS",
    "CandidateLine",
    "Curve",
    "DataProblem",
    "Diagnosis",
    "GapFinder",
    "LearnedTorques",
    "NamedEffect",
    "Place",
    "ServoRecord",
]
