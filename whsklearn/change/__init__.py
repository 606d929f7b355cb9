"""Has the system changed?  An alarm with a stated false-alarm rate, and a sentence on what changed.

`ChangeAlarm` watches the innovations of an estimator, for changes faster than the
estimator's own tracking.  `compare_parameters` sets two estimates with their covariances
side by side, for those that the estimator has followed without surprise ("coulomb rose
20 % since Tuesday").  `forgetting_after` and `set_forgetting` let an estimator follow a change.
"""

from whsklearn.change.alarm import ChangeAlarm
from whsklearn.change.comparison import ParameterChange, compare_parameters
from whsklearn.change.forgetting import forgetting_after, set_forgetting

__all__ = ["ChangeAlarm", "ParameterChange", "compare_parameters", "forgetting_after", "set_forgetting"]
