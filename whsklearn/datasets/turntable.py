"""A simulated record of the turntable of sec. 5.2 that is shipped with the package.

It is simulated, not measured: the paper's records are not public.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from whsklearn.datasets.servo import reference_signal
from whsklearn.systems.servo import ServoAxis
from whsklearn.systems.servo_simulation import record_frame

if TYPE_CHECKING:
    import pandas as pd

EXPERIMENTS = ("sine", "multisine")
DURATION = 40.0


def load_turntable(
    experiment: str = "sine", *, return_X_y: bool = False
) -> pd.DataFrame | tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A simulated record of the preset rig, `ServoAxis.paper_rig`: 40 s at 100 Hz.

    Parameters
    ----------
    experiment : str
        ``sine``: the paper's reference, which does not excite all parameters; ``multisine``: eight tones, which do.
    return_X_y : bool
        Whether to return reference (n, 1) and position (n,) instead of the table.

    Returns
    -------
    DataFrame
        Columns ``time_s``, ``reference_rad``, ``torque_nm``, ``position_rad``; 4,000 rows.

    Raises
    ------
    ValueError
        If there is no experiment of that name.
    FileNotFoundError
        If the records are missing from the installation.

    Examples
    --------
    >>> from whsklearn.datasets import load_turntable
    >>> load_turntable().shape
    (4000, 4)
    """
    import pandas as pd

    if experiment not in EXPERIMENTS:
        raise ValueError(f"Unknown experiment {experiment!r}; expected one of: {', '.join(EXPERIMENTS)}.")
    name = f"turntable_{experiment}.csv"
    here = Path(__file__).resolve().parent
    for folder in (here / "logs", here.parents[1] / "datasets"):
        if (folder / name).is_file():
            log = pd.read_csv(folder / name)
            break
    else:
        raise FileNotFoundError(
            f"{name} is not installed; reinstall the package, or use make_turntable({experiment!r})."
        )
    if return_X_y:
        return log[["reference_rad"]].to_numpy(), log["position_rad"].to_numpy()
    return log


def make_turntable(experiment: str = "sine") -> pd.DataFrame:
    """Simulate the record that `load_turntable` returns, rounded to a microradian and a micronewtonmetre."""
    rig = ServoAxis.paper_rig()
    record = rig.simulate(reference_signal(experiment, DURATION, rig.sample_rate))
    return record_frame(record).round(6)
