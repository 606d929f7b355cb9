"""An FMU 2 or 3 for co-simulation as a simulator, run by FMPy (extra ``fmu``)."""

from __future__ import annotations

import copy
import os
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import Effect
from whsklearn.filtering.records import motion
from whsklearn.logs.units import UNKNOWN, factor_of

Array = NDArray[Any]
ITERATIONS = 4


class FMUSimulator:
    """An FMU with one input, the drive, and one output, the position.

    Where it states the units of both they are brought to the record's, else they are taken for SI.
    An FMU is closed: an effect is added to its drive, as the torque that it asks for along the measured motion.

    Parameters
    ----------
    path : path
        The .fmu file.
    drive, position : str, optional
        Names of the input and of the output; the only ones by default.
    parameters : mapping of str to float, optional
        Parameters of the FMU that may be refitted, with their values, none of them zero.

    Raises
    ------
    ImportError
        If FMPy is not installed.
    ValueError
        If the FMU has no such variable.

    References
    ----------
    Modelica Association 2014, Functional Mock-up Interface 2.0, https://fmi-standard.org.

    Examples
    --------
    >>> import shutil, tempfile
    >>> import numpy as np
    >>> from whsklearn import ServoAxis
    >>> from whsklearn.export import export_model
    >>> from whsklearn.gap import ServoRecord
    >>> from whsklearn.simulators import FMUSimulator
    >>> record = ServoRecord(np.arange(200) / 1000, np.ones(200), np.zeros(200))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     fmu = export_model(ServoAxis(), to="fmu", out=f"{folder}/axis").paths[0]
    ...     has_binary = shutil.which("cc") is not None  # without a compiler the FMU holds sources only
    ...     position = FMUSimulator(fmu).simulate(record) if has_binary else record.position
    >>> position.shape
    (200,)
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        drive: str | None = None,
        position: str | None = None,
        parameters: Mapping[str, float] | None = None,
    ):
        fmpy = _library()
        self.path = str(path)
        self.parameters = dict(parameters or {})
        self.effects: tuple[Effect, ...] = ()
        variables = fmpy.read_model_description(self.path).modelVariables
        there = {v.name: v.causality for v in variables}
        self.drive = drive or _only(there, "input", "drive")
        self.position = position or _only(there, "output", "position")
        for name in (self.drive, self.position, *self.parameters):
            if name not in there:
                raise ValueError(f"The FMU has no variable {name!r}; it has {', '.join(sorted(there))}.")

        units = {v.name: v.unit or UNKNOWN for v in variables}
        self._units = {k: units[k] for k in (self.drive, self.position)}

    def simulate(self, record: Any) -> Array:
        """Position from the drive alone, shape (n,), beginning at the first of every segment of the ``record``."""
        return np.concatenate([self._run(part, record.time[0]) for part in record.segments])

    def _run(self, record: Any, first: float) -> Array:
        """Position of one segment; ``first`` is where the time of effects begins."""
        fmpy = _library()
        u = record.drive - sum((self._torque(e, record, first) for e in self.effects), np.zeros(len(record)))
        time = record.time - record.time[0]
        by, far = (factor_of(self._units[k])[0] for k in (self.drive, self.position))  # a record is in SI
        log = np.array(list(zip(time, u / by, strict=True)), dtype=[("time", float), (self.drive, float)])
        out = fmpy.simulate_fmu(
            self.path, start_time=0.0, stop_time=float(time[-1]), step_size=record.dt, output_interval=record.dt,
            input=log, output=[self.position], start_values=self.parameters, fmi_type="CoSimulation",
        )  # fmt: skip
        y = np.interp(time, out["time"], out[self.position]) * far
        return np.asarray(y - y[0] + record.position[0])

    def _torque(self, effect: Effect, record: Any, first: float) -> Array:
        """The torque that an effect demands from the drive along the measured motion."""
        rate = 1.0 / record.dt
        m = motion(record.position, rate, min(25.0, 0.2 * rate))
        time = record.time - first
        return effect.contribution(SimpleNamespace(time=time, drive=record.drive, kappa=None, **m._asdict()))

    def refit(self, record: Any, keep: NDArray[np.bool_]) -> FMUSimulator:
        """The parameters, in ratios, by least squares; the FMU as it is without any.

        ``record``: a `ServoRecord`. ``keep`` (n,): samples of it that count.
        """
        if not self.parameters:
            return self
        from scipy.optimize import least_squares

        def residual(x: Array) -> Array:
            return (record.position - self.with_numbers(x).simulate(record))[keep]

        return self.with_numbers(least_squares(residual, self.numbers, max_nfev=ITERATIONS).x)

    @property
    def numbers(self) -> Array:
        """Logarithms of the parameters' sizes."""
        return np.log(np.abs(list(self.parameters.values())))

    def with_numbers(self, x: Array) -> FMUSimulator:
        """The FMU at other parameters, their signs kept. ``x``: as ``numbers`` gives them."""
        other = copy.copy(self)
        values: Array = np.sign(list(self.parameters.values())) * np.exp(x)
        other.parameters = dict(zip(self.parameters, map(float, values), strict=True))
        return other

    def with_effect(self, effect: Effect) -> FMUSimulator:
        """The FMU with one ``effect`` more on its drive.

        Raises NotImplementedError if the effect is not a torque along a motion.
        """
        if effect.port == "output" or effect.column_kind == "none":
            raise NotImplementedError(f"{effect.name} cannot be put on the drive of an FMU")
        other = copy.copy(self)
        other.effects = (*self.effects, effect)
        return other


def _only(there: Mapping[str, str], causality: str, option: str) -> str:
    """The only variable of a causality."""
    found = sorted(n for n, c in there.items() if c == causality)
    if len(found) != 1:
        raise ValueError(f"The FMU has {len(found)} {causality}s ({', '.join(found)}); name one as {option}=.")
    return found[0]


def _library() -> Any:
    try:
        import fmpy
    except ImportError:
        raise ImportError("FMPy is not installed; pip install 'whsklearn[fmu]'.") from None
    return fmpy
