"""Model export: MJCF, URDF, Isaac Lab, C99, Structured Text, FMI 2.0, scipy.signal, python-control.

What a format cannot represent is returned as a list of `Loss`, each with its size, and written into the file as a
comment.
"""

from whsklearn.export.files import FORMATS, Export, export_model
from whsklearn.export.linear import to_control, to_dlti
from whsklearn.export.model import Loss
from whsklearn.export.tables import Left, Ratings

__all__ = ["FORMATS", "Export", "Left", "Loss", "Ratings", "export_model", "to_control", "to_dlti"]
