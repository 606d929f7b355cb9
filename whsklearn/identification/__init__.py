"""Which structure does a record ask for: linear, Wiener-Hammerstein, or an axis as physics?"""

from whsklearn.identification.compare import Compared, Identification, identify
from whsklearn.identification.view import View

__all__ = ["Compared", "Identification", "View", "identify"]
