"""Identified models as plain objects, for files, reports and exports."""

from whsklearn.models.arm import ArmModel
from whsklearn.models.axis import AxisModel
from whsklearn.models.base import IdentifiedModel
from whsklearn.models.chain import ChainModel, LinearModel
from whsklearn.models.files import as_arm, load_model, save_model

__all__ = [
    "ArmModel", "AxisModel", "ChainModel", "IdentifiedModel", "LinearModel", "as_arm", "load_model", "save_model",
]  # fmt: skip
