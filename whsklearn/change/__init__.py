"""Has the system changed?  An alarm with a stated false-alarm rate, and a sentence on what changed.

`ChangeAlarm` watches the innovations of an estimator for changes that are too fast for the
estimator to track.  `compare_parameters` compares two estimates and their covariances.  It
also finds slow changes, which the estimator tracks without an alarm ("coulomb rose 20 %
since Tuesday").  `forgetting_after` and `set_forgetting` let an estimator follow a change.
"""

from whsklearn.change.alarm import ChangeAlarm, forgetting_after, set_forgetting
from whsklearn.change.comparison import ParameterDifference, compare_parameters

__all__ = ["ChangeAlarm", "ParameterDifference", "compare_parameters", "forgetting_after", "set_forgetting"]
