"""Structure selection for a record: linear, Wiener-Hammerstein, or a physical axis; and arms with several axes."""

from whsklearn.identification.arm_fit import ArmFit, identify_arm
from whsklearn.identification.compare import Compared, Identification, identify
from whsklearn.identification.logs_together import OwnDrive
from whsklearn.identification.payload import Payload, find_payload, gains_from_load
from whsklearn.identification.view import View

__all__ = [
    "ArmFit", "Compared", "Identification", "OwnDrive", "Payload", "View", "find_payload", "gains_from_load",
    "identify", "identify_arm",
]  # fmt: skip
