"""Fit every structure, compare them on held-out free runs, recommend the simplest that is about as good as the best."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from whsklearn._numba import compiling_seconds
from whsklearn.effects import EarlyReversal
from whsklearn.effects.base import Array
from whsklearn.identification.axis_fit import (
    LEAST_TESTED,
    UntoldError,
    fit_cogging_axis,
    fit_free_law_axis,
    fit_hanging_axis,
    fit_placed_axis,
    fit_rigid_axis,
    fit_sprung_axis,
    white,
)
from whsklearn.identification.chain_fit import fit_chain, fit_folded, fit_rectified, loses_sign
from whsklearn.identification.drive_lead import moved, skew
from whsklearn.identification.end_stops import struck_before
from whsklearn.identification.linear_fit import fit_arx, fit_output_error
from whsklearn.identification.logs_together import OwnDrive, together
from whsklearn.identification.stopped_axis import fit_stopped_axis
from whsklearn.identification.two_masses import fit_two_masses
from whsklearn.identification.view import RATES, View, held_out_from, smooth, view, window_of
from whsklearn.identification.windows import (
    horizons,
    lead,
    mean_error,
    powers,
    residual,
    rms_of,
    whole_errors,
    window_errors,
)
from whsklearn.logs.units import UNKNOWN, UNSTATED, factor_of
from whsklearn.models import AxisModel, ChainModel, LinearModel
from whsklearn.models.base import IdentifiedModel

AS_GOOD = 1.075  # a simpler structure is preferred within 7.5 % of the least error: twins of one system differ by that
AT_FLOOR = 1.3  # times the noise; no structure can be better, and the one with thirty parameters takes most of the time
ORDERS = (1, 2, 3, 4)
GRAVITY, FORCE = "axis with gravity", "axis, free force over position"
LOADED, LOADED_GRAVITY = (
    "axis, friction that grows with the drive",
    "axis with gravity, friction that grows with the drive",
)
SPRUNG_GRAVITY = "axis with gravity and a spring"
HANGING = (GRAVITY, LOADED_GRAVITY, SPRUNG_GRAVITY)
COGGED, COGGED_GRAVITY = "axis with cogging", "axis with gravity and cogging"
STOPPED, STOPPED_GRAVITY = "axis with end stops", "axis with gravity and end stops"
WAVES, STOPS = (COGGED, COGGED_GRAVITY), (STOPPED, STOPPED_GRAVITY)
SPRING, HARDENING = "axis on a spring", "axis on a hardening spring"
TWO_MASSES, CHAIN = "axis with a load behind a spring", "Wiener-Hammerstein"
AT_LOAD = "axis with a load behind a spring, measured at the load"
COUPLED = (TWO_MASSES, AT_LOAD)
LAST = (LOADED, LOADED_GRAVITY, *WAVES, *STOPS, SPRUNG_GRAVITY, *COUPLED, CHAIN)  # what takes most of the time
# Share of the best linear model's error below which an axis makes a chain needless. Of axes it leaves 0.15 at most, of
# chains 0.97 at least, and of those axes a chain left seven times as much and more (`benchmarks.which_structure`).
# So does a force over the position with a load behind a spring, beside which there is none.
FAR_BELOW = 0.25
LINEAR = ("arx", "output_error")
CHAIN_FROM = 300  # samples; with fewer, the thirty parameters of a chain cannot be estimated
# Of the travel in a window: a steady rotation that constant velocity predicts this well follows its drive, whatever the
# structures add
STEADY = 0.03
LOST = 1.0  # NMSE of a free run beyond which the mean of the output is closer
BEGINNINGS = 4  # of runs whose ends are compared, over the first half of a record
# Of the error over windows of all that hold a long run: an axis with less is recommended though its own is lost. That
# of a wrist with a weight has 0.36 of it, gravity about the upright axis of a KR300 more than half
HALVED = 0.5
# Of the error of the trivial model, or of the same model with its drive held at the mean: a model above that says
# nothing about how the output follows the input (an ARX of a smooth motion may be a good extrapolation of it)
EXPLAINS = 0.9


@dataclass
class Compared:
    """A candidate: its model (None for the trivial one, or if it could not be fitted) and its errors.

    Attributes
    ----------
    name, kind : str
        Name of the candidate, and its kind: ``arx``, ``output_error``, ``wiener-hammerstein``, ``axis``.
    structure : dict
        Its orders and settings.
    criterion : str
        What its fit minimised.
    model : IdentifiedModel or None
    seconds : float
        Of processor time.
    windows : dict of int to float
        Root mean square error by length of the window in samples.
    score : float
        Geometric mean of ``windows`` over the noise floor (over the error of the trivial model if there is no floor).
    train, test : dict of str to float
        Indices of the free run; without another record, ``test`` is of the model that was fitted to what is before it.
    failure : str
        Why it could not be fitted; empty if it was.
    by_drive, run_by_drive : float
        ``score``, and the error of the ``test`` run, as shares of those of the same model with its drive held at the
        mean.
    along_drive : bool
        Whether the displacement of the model follows the impulse of the drive, as the slow motion of every axis does,
        whatever lags and resonances lie above.  That of a controller, solved for the motion, goes against it; over a
        log of a loop that follows its reference well it predicts better than any axis.
    squares : dict of int to ndarray
        Mean squared error of each window by its length in samples.
    untold : bool
        Whether it was refused because the record does not tell its force from others over the position.
    unstable : bool
        Whether its long run is lost and ends elsewhere if it begins a little later: it then says nothing of the model.

    References
    ----------
    Schoukens and Ljung 2019, Nonlinear System Identification: A User-Oriented Road Map, IEEE Control Systems
    Magazine 39(6), 28-99.

    Examples
    --------
    >>> from whsklearn.identification import Compared
    >>> from whsklearn.models import LinearModel
    >>> arx = Compared("ARX, order 1", "arx", {"order": 1}, "prediction", LinearModel([0.0, 0.5], [1.0, -0.5]))
    >>> arx.size
    4
    """

    name: str
    kind: str
    structure: dict[str, Any]
    criterion: str
    model: Any = None
    seconds: float = 0.0
    windows: dict[int, float] = field(default_factory=dict)
    score: float = np.inf
    train: dict[str, float] = field(default_factory=dict)
    test: dict[str, float] = field(default_factory=dict)
    failure: str = ""
    by_drive: float = 0.0
    run_by_drive: float = 0.0
    along_drive: bool = True
    squares: dict[int, Array] = field(default_factory=dict, repr=False, compare=False)
    untold: bool = False
    unstable: bool = False

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.model.parameters) if self.model is not None else 0


@dataclass
class Identification:
    """The result of `identify`.

    Attributes
    ----------
    models : list of Compared
        From the simplest on.
    recommended, trivial : Compared
        One of them, and the model that does nothing.
    reason : str
        Why it is recommended.
    floor : float
        Standard deviation of the output's noise, in its unit.
    train, test : View
        The records as the candidates saw them.
    rows : int
        Samples that were given; those of ``train`` were used.
    white : bool
        Whether the residual of the recommended model is white; if it is not, intervals are widened, and the model is
        incomplete.
    own : tuple of OwnDrive
        Timing and offset of the drive of each log.
    tested : bool
        Whether ``test`` is another record, and not the end of the first.

    References
    ----------
    Schoukens and Ljung 2019, Nonlinear System Identification: A User-Oriented Road Map, IEEE Control Systems
    Magazine 39(6), 28-99.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.identification import identify
    >>> from whsklearn.models import LinearModel
    >>> u = np.random.default_rng(0).normal(size=250)
    >>> y = LinearModel([0.0, 0.5], [1.0, -0.5]).simulate(u)
    >>> found = identify(u, y, logged="output")
    >>> found.recommended in found.models, round(found.recommended.test["rmse"], 6)
    (True, 0.0)
    """

    models: list[Compared]
    recommended: Compared
    trivial: Compared
    reason: str
    floor: float
    train: View
    test: View
    rows: int = 0
    white: bool = True
    own: tuple[OwnDrive, ...] = ()
    tested: bool = False

    @property
    def rows_used(self) -> str:
        """Number of samples used, and of segments."""
        used, segments = self.train.y.size, len(self.train.starts) + 1
        return f"{used} of {self.rows or used}" + (f" in {segments} segments" if segments > 1 else "")

    @property
    def judged_on(self) -> str:
        """What ``test`` is, in words."""
        return "the test log" if self.tested else "the held-out end of the log"

    @property
    def window_names(self) -> list[str]:
        """Length of each window with its unit, for the head of a table."""
        unit = "samples" if self.model.units.get("time") == "samples" else "s"
        return [f"{h * self.train.dt:.3g} {unit}" for h in self.trivial.windows]

    @property
    def on_drive(self) -> str:
        """Note on timing and offset of each log's drive; empty if they agree with the output and with each other."""
        dt, unit = self.train.dt, self.model.units.get("input", "")
        return " ".join(text for log in self.own if (text := log.told(dt, unit)))

    @property
    def model(self) -> IdentifiedModel:
        """The recommended model."""
        return self.recommended.model


@threadpool_limits.wrap(limits=1, user_api="blas")  # two threads take twice the CPU and sum in another order
def identify(
    u: ArrayLike,
    y: ArrayLike,
    *,
    dt: float = 1.0,
    test: tuple[ArrayLike, ArrayLike] | tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
    skip: int = 0,
    logged: str = "auto",
    units: dict[str, str] | None = None,
    drive_error: float = 0.0,
    groups: ArrayLike | None = None,
    records: ArrayLike | None = None,
    progress: Callable[[str], None] | None = None,
) -> Identification:
    """Find the structure that fits a record: linear, Wiener-Hammerstein, or an axis as physics.

    Parameters
    ----------
    u, y : array-like of shape (n,)
        Input and output.
    dt : float, default=1.0
        Sampling time (s).
    test : tuple of array-like, optional
        Another record to report on, (u, y) or (u, y, groups); the choice is always made on the last 30 % of the first.
    skip : int, default=0
        Number of first samples of the test to ignore.
    logged : {"auto", "output", "velocity", "position"}, default="auto"
        What y is.  A position is fitted through its velocity and judged as a position.
    units : dict of str to str, optional
        Of ``input`` and ``output``, and of ``time``, which may be ``samples``; SI by default. Errors are in the
        output's unit, parameters of an axis in SI.
    drive_error : float, default=0.0
        Standard deviation of the input's scale (a torque constant) as a share of it; it enters the standard errors of
        an axis and of a linear model.
    groups : array-like of shape (n,), optional
        Segments of the record, as `load_log` gives them for a log with holes; all are fitted, and each restarts.
    records : array-like of shape (n,), optional
        The log that each sample belongs to, where several logs of one system are given one after the other.  They share
        all numbers, but the drive of each has a timing and, on an axis, an offset of its own.
    progress : callable, optional
        Called with the name of each candidate before it is fitted.

    Returns
    -------
    Identification

    Raises
    ------
    ValueError
        If the record is too short, not finite, or does not move.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.signal import lfilter
    >>> from whsklearn.identification import identify
    >>> rng = np.random.default_rng(0)
    >>> u = rng.standard_normal(280)
    >>> y = lfilter([0.0, 0.5, 0.2], [1.0, -1.2, 0.5], u) + 0.01 * rng.standard_normal(280)
    >>> found = identify(u, y)
    >>> found.recommended.kind, found.recommended.structure
    ('output_error', {'order': 2})
    """
    units = {k: v for k, v in (units or {}).items() if v not in UNSTATED}
    drive, output = (factor_of(units.get(k, UNKNOWN)) for k in ("input", "output"))
    logs = _logs(u, y, dt, logged, groups, records, (drive, output))
    whole, own = together(logs, si=(drive[0], output[0]))
    cut = struck_before(whole.in_si, held_out_from(whole.y))
    fitting, held_out = whole.part(0, cut), whole.part(cut, whole.u.size)
    judged = held_out  # by the models that were fitted to what is before it, as the choice was made
    if test is not None:
        cuts = test[2] if len(test) == 3 else None
        judged = replace(view(test[0], test[1], dt, whole.logged, cuts), si=whole.si)
        judged = moved(judged, own[0].lead if len(own) == 1 else skew(judged.in_si))
    past = whole.u[whole.bounds[whole.bounds <= cut].max() : cut]
    trivial = Compared("constant velocity" if whole.logged == "position" else "constant output", "trivial", {}, "-")
    _score(trivial, held_out)
    angle = whole.logged != "velocity" and smooth(whole.y, whole.bounds) and whole.angle
    structures = list(
        candidates(
            cut,
            angle=angle,
            placed=whole.logged == "position",
            sprung=output[1] not in RATES and whole.logged == "output",
            rectified=loses_sign(whole),
        )
    )
    tried = _each_tried(structures, fitting, held_out, past, units, progress)
    chosen, reason = recommend(tried, trivial, steady=_steady(trivial, held_out))
    fit_again = {c.name: f for c, f in structures}[chosen.name]
    if progress:
        progress(f"{chosen.name}, on the whole record")
    chosen.model = _better(chosen, _fitted(replace(chosen), fit_again, whole, units), whole)
    chosen.model = _with_drive_error(chosen.model, drive_error)
    reason += _at_its_speed(chosen.model, whole) if _steady(trivial, held_out) else ""
    reason += _at_rest(chosen.model)
    for compared in tried:
        compared.train = _indices(compared.model, fitting, 0)
        if judged is not held_out:
            compared.test = _indices(compared.model, judged, skip)
    is_white = white(residual(chosen.model, whole), whole)
    return Identification(
        tried, chosen, trivial, reason, whole.floor, whole, judged, np.size(y), is_white, own, test is not None
    )


def _each_tried(
    structures: list[tuple[Compared, Callable[[View], Any]]],
    fitting: View,
    held_out: View,
    past: Array,
    units: dict[str, str],
    progress: Callable[[str], None] | None,
) -> list[Compared]:
    """Fit every structure in turn but those that the ones before make needless; the simplest first."""
    tried: list[Compared] = []
    for compared, fit in structures:
        if compared.name in LAST and _at_floor(min(tried, key=lambda c: c.score), fitting):
            compared.failure = "skipped, because a simpler structure is at the noise floor"
        elif compared.name == CHAIN and _no_chain(tried):
            compared.failure = "skipped, because an axis leaves far less than the best linear model"
        elif compared.name in (LOADED, *COUPLED) and _of_position(tried):
            compared.failure = (
                "skipped, because an axis with a force over the position leaves far less than one without"
            )
        elif compared.name == SPRUNG_GRAVITY and not _helped(tried):
            compared.failure = "skipped, because neither gravity nor a spring leaves less than an axis without"
        elif compared.name in (LOADED_GRAVITY, SPRUNG_GRAVITY, FORCE, HARDENING) and _of_waves_or_stops(tried):
            compared.failure = "skipped, because an axis with cogging or end stops leaves far less than one without"
        elif compared.name in (FORCE, HARDENING) and _of_weight(tried, sure=compared.name == HARDENING):
            compared.failure = "skipped, because gravity is the best so far"  # over little travel a cubic imitates it
        else:
            if progress:
                progress(compared.name)
            _score(_fitted(compared, fit, fitting, units), held_out)
            skip = lead(held_out.longest.u.size, held_out.dt)
            compared.test = _indices(compared.model, held_out, skip, past)
            without = _indices(compared.model, _undriven(held_out), skip, past)
            compared.run_by_drive = compared.test.get("rmse", np.inf) / max(without.get("rmse", np.inf), 1e-300)
            compared.unstable = compared.kind == "axis" and _lost(compared.test) and _unstable(compared.model, held_out)
        tried.append(compared)
    # noise of the output biases the poles of an ARX model: of two that are as large and as good it comes second
    return sorted(tried, key=lambda c: (c.size, c.criterion == "prediction", c.score))


def _of_weight(tried: list[Compared], *, sure: bool) -> bool:
    """Whether gravity is the best so far, and if it must be ``sure``, far better than a linear spring.

    An output that need not be a position may be small against a radian, over which a wave is a line.
    """
    least = min(c.score for c in tried if c.name == SPRING or not sure)
    best = min(tried, key=lambda c: c.score)
    return best.name in HANGING and best.score * (AS_GOOD if sure else 1.0) <= least


def _no_chain(tried: list[Compared]) -> bool:
    """Whether an axis leaves so much less than linear models that a chain, which holds one, cannot make up for it."""
    return _least(tried, lambda c: c.kind == "axis") < FAR_BELOW * _least(tried, lambda c: c.kind in LINEAR)


def _of_position(tried: list[Compared]) -> bool:
    """Whether a force over position leaves so much less that an axis without one cannot make up for it."""
    free = _least(tried, lambda c: c.kind == "axis" and "effects" not in c.structure)
    return _least(tried, lambda c: c.name in (*HANGING, SPRING, FORCE, *WAVES, *STOPS)) < FAR_BELOW * free


def _helped(tried: list[Compared]) -> bool:
    """Whether gravity or a spring leaves less than an axis without, so that both together may leave less still."""
    free = _least(tried, lambda c: c.kind == "axis" and "effects" not in c.structure)
    return _least(tried, lambda c: c.name in (GRAVITY, SPRING)) < free


def _of_waves_or_stops(tried: list[Compared]) -> bool:
    """Whether cogging or end stops leave so much less that an axis without them cannot make up for it."""
    without = _least(tried, lambda c: c.kind == "axis" and c.name not in (*WAVES, *STOPS))
    return _least(tried, lambda c: c.name in (*WAVES, *STOPS)) < FAR_BELOW * without


def _least(tried: list[Compared], of: Callable[[Compared], bool]) -> float:
    """The least score of some of the structures; infinite if there are none."""
    return min((c.score for c in tried if of(c)), default=np.inf)


def _at_floor(best: Compared, log: View) -> bool:
    """Whether noise explains what the best structure leaves, so that none of those that take long can be better.

    What an axis leaves may be white instead: third differences do not show the noise of a velocity, nor all of that of
    a coarse encoder.  A rigid axis with a load that rings left residuals with p < 1e-30 (`benchmarks.two_masses`).
    """
    if best.score < AT_FLOOR or best.kind != "axis" or _lost(best.test):
        return best.score < AT_FLOOR
    return log.u.size > LEAST_TESTED * window_of(log.u.size, log.dt) and white(residual(best.model, log), log)


def _logs(
    u: ArrayLike,
    y: ArrayLike,
    dt: float,
    logged: str,
    groups: ArrayLike | None,
    records: ArrayLike | None,
    si: tuple[tuple[float, str], tuple[float, str]],
) -> dict[str, View]:
    """The logs by their labels, all of the kind that they have together."""
    whole = view(u, y, dt, logged, groups if groups is not None else records, si)
    if records is None:
        return {"": whole}
    of = np.asarray(records).reshape(-1)
    u, y = np.asarray(u, dtype=float).reshape(-1), np.asarray(y, dtype=float).reshape(-1)
    segment = np.zeros(of.shape, dtype=int) if groups is None else np.asarray(groups).reshape(-1)
    if of.shape != y.shape:
        raise ValueError(f"There are {of.size} records for {y.size} samples; expected one for each.")
    out = {}
    for label in dict.fromkeys(of.tolist()):
        at = of == label
        try:
            record = view(u[at], y[at], dt, whole.logged, segment[at], si)
        except ValueError as error:
            raise type(error)(f"{label}: {error}") from None
        out[str(label)] = replace(record, settles=whole.settles)
    return out


def candidates(
    n: int, *, angle: bool, placed: bool, sprung: bool, rectified: bool
) -> Iterator[tuple[Compared, Callable[[View], Any]]]:
    """Every structure for ``n`` samples and how it is fitted.

    With gravity if the output may be an ``angle``, and without its sign if it may be ``rectified``.
    """

    def of(name: str, kind: str, fit: Any, criterion: str = "simulation", **structure: Any) -> tuple[Compared, Any]:
        return Compared(name, kind, structure, criterion), fit

    law, springs = ["viscous", "coulomb"], ["cable_spring", "hardening_spring"]
    for order in ORDERS:
        yield of(f"ARX, order {order}", "arx", partial(fit_arx, order=order), "prediction", order=order)
    for order in ORDERS:
        yield of(f"output error, order {order}", "output_error", partial(fit_output_error, order=order), order=order)
    yield of("axis, viscous and Coulomb", "axis", fit_rigid_axis, law=law)
    yield of("axis, free law over speed", "axis", fit_free_law_axis, law=[*law, "speed_hinge"])
    both = partial(fit_hanging_axis, sprung=True)
    if angle:
        yield of(GRAVITY, "axis", fit_hanging_axis, law=law, effects=["gravity_imbalance"])
    if placed:
        yield of(SPRING, "axis", partial(fit_placed_axis, powers=1), law=law, effects=springs[:1])
        yield of(STOPPED, "axis", fit_stopped_axis, law=law, effects=["end_stop"])
        yield of(COGGED, "axis", fit_cogging_axis, law=law, effects=["cogging"])
    if placed and angle:
        stopped, waves = (partial(fit, hangs=True) for fit in (fit_stopped_axis, fit_cogging_axis))
        yield of(STOPPED_GRAVITY, "axis", stopped, law=law, effects=["gravity_imbalance", "end_stop"])
        yield of(COGGED_GRAVITY, "axis", waves, law=law, effects=["gravity_imbalance", "cogging"])
        yield of(SPRUNG_GRAVITY, "axis", both, law=law, effects=["gravity_imbalance", "cable_spring"])
    grows = partial(fit_rigid_axis, loaded=True)
    yield of(LOADED, "axis", grows, law=[*law, "load_friction"])
    if angle:
        grows = partial(fit_hanging_axis, loaded=True)
        yield of(LOADED_GRAVITY, "axis", grows, law=[*law, "load_friction"], effects=["gravity_imbalance"])
    if placed:
        yield of(FORCE, "axis", partial(fit_placed_axis, powers=3), law=law, effects=springs)
        coupled: dict[str, Any] = {"law": law, "effects": ["flexible_coupling"]}
        yield of(TWO_MASSES, "axis", fit_two_masses, **coupled)
        yield of(AT_LOAD, "axis", partial(fit_two_masses, at_load=True), **coupled, output="load")
    if sprung:
        yield of(SPRING, "axis", partial(fit_sprung_axis, powers=1), law=law, effects=springs[:1])
        if angle:
            yield of(SPRUNG_GRAVITY, "axis", both, law=law, effects=["gravity_imbalance", "cable_spring"])
        yield of(HARDENING, "axis", partial(fit_sprung_axis, powers=3), law=law, effects=springs)
    for order in ORDERS[1:] if rectified else ():
        name = f"output error, order {order}, without its sign"
        signless: dict[str, Any] = {"order": order, "effects": ["sensor_rectification"]}
        yield of(name, "wiener-hammerstein", partial(fit_rectified, order=order), **signless)
        lagging = partial(fit_folded, order=order)
        yield of(f"{name}, behind a lag", "wiener-hammerstein", lagging, **signless, law="folded")
    if n >= CHAIN_FROM:
        yield of(CHAIN, "wiener-hammerstein", fit_chain)


def recommend(tried: list[Compared], trivial: Compared, *, steady: bool = False) -> tuple[Compared, str]:
    """The simplest within `AS_GOOD` of the best, and why; ``tried`` is sorted from the simplest on.

    One whose free run is `LOST`, which windows hardly show, is chosen only if all are. If the motion is ``steady``, a
    record that the trivial model predicts equally well is no argument against a structure.
    """
    good = [c for c in tried if np.isfinite(c.score)]
    if not good:
        told = "; ".join(f"{c.name}: {c.failure or 'its free run does not stay finite'}" for c in tried)
        raise ValueError(f"No structure could be fitted to this record ({told}).")
    along = [c for c in good if c.along_drive]
    if not any(c.kind == "axis" for c in along):  # without an axis the output may be anything
        along = good
    driven = [c for c in along if c.by_drive < EXPLAINS]
    # an integrator whose drive does nothing was nearer to a pendulum's swings than their mean, and so was a line
    holding = [c for c in driven if not _lost(c.test) and c.run_by_drive < EXPLAINS]
    better = [c for c in driven if c.score < EXPLAINS * trivial.score]
    # that the mean is further off is a merit mostly of what also predicts the windows
    axes = [c for c in along if steady and not driven and c.kind == "axis"]  # they know its friction
    among = [c for c in holding if c in better] or holding or better or axes or along
    # a weight at its top magnifies every error, so that the run of the true axis is lost, too
    turned = [c for c in better if c.unstable and c.score < HALVED * min(c.score for c in among)]
    among = turned or among
    first, best = (min(some, key=lambda c: c.score) for some in (good, among))
    chosen = next(c for c in among if c.score <= AS_GOOD * best.score or _no_worse(c, best))
    ratio = chosen.score / trivial.score
    reason = f"{chosen.name} leaves {100 * ratio:.3g} % of the error of a {trivial.name} over held-out windows"
    others = [c for c in good if c.kind != chosen.kind]
    if others:
        rival = min(others, key=lambda c: c.score)
        reason += f", the best of another kind ({rival.name}) {100 * rival.score / trivial.score:.3g} %"
    if chosen is not best:
        near = chosen.score <= AS_GOOD * best.score
        by = f"than {100 * (AS_GOOD - 1):.3g} %" if near else "than the choice of windows makes it by chance"
        reason += f"; {best.name} is no better {by} and has more parameters"
    if first is not best:
        if first not in along:
            why = "it moves slowly against its drive, as a controller solved for the motion does and no axis"
        elif first in driven:
            why = f"its free run is further off than the mean of the output ({_told(first.test)})"
        else:
            why = "without its drive it predicts them as well"
        reason += f"; {first.name} is better over windows, but {why}"
    reason += _alike(chosen, tried)
    if ratio > EXPLAINS and steady:
        reason += (
            f"; the motion is so even that {trivial.name} predicts it as well, so the record says little about the "
            "dynamics: log changes of speed"
        )
    elif ratio > EXPLAINS and chosen in holding:
        reason += f"; its free run follows the output ({_told(chosen.test)}), so use it for long runs"
    elif ratio > EXPLAINS:
        reason += "; that is hardly better, so the output does not follow this input by any of the structures"
    if chosen in turned:
        reason += f"; its long run is lost ({_told(chosen.test)}), as small errors grow: use it over windows"
    elif _lost(chosen.test):
        none = "; no structure follows the drive and stays nearer to the held-out output than its mean over a long run"
        reason += f"{none}, {chosen.name} neither ({_told(chosen.test)}): use the model over short windows only"
    elif not driven:
        reason += "; no model predicts better with the drive than with the drive held at its mean"
    return chosen, reason + "."


def _no_worse(simple: Compared, best: Compared) -> bool:
    """Whether a simpler structure of the same kind is within one standard error of the best over the same windows.

    Breiman et al. 1984, Classification and Regression Trees, 3.4.3.  Where every structure leaves far more than the
    noise, as the creep of a simulator's friction does, a cubic force is a tenth better than the weight that is there on
    one stretch, and a tenth worse on the next.  Errors of different lengths overlap, so their deviations add up.
    """
    if simple.kind != best.kind:
        return False
    pairs = [(simple.squares[h], best.squares[h]) for h in simple.squares.keys() & best.squares.keys()]
    apart = [a / a.mean() - b / b.mean() for a, b in pairs if a.size > 1]
    if not apart:
        return False
    spread = np.mean([0.5 * np.std(d, ddof=1) / np.sqrt(d.size) for d in apart])
    return bool(np.log(simple.score / best.score) <= spread)


def _alike(chosen: Compared, tried: list[Compared]) -> str:
    """Which forces over position the record does not tell apart: over little travel, a weight is a spring.

    A weight that was refused, as it would cancel an offset or be on either side, is such a force too.
    """
    forces = {"gravity_imbalance", "cable_spring"}
    own = forces.intersection(chosen.structure.get("effects", ()))
    others = [
        c.name
        for c in tried
        if (c_own := forces.intersection(c.structure.get("effects", ())))
        and not c_own >= own  # what has both is no other explanation
        and (c.score <= AS_GOOD * chosen.score or c.untold)
    ]
    if not own or not others:
        return ""
    return f"; {' and '.join(others)} predicts about as well: over this travel the record does not tell them apart"


def _lost(run: dict[str, float]) -> bool:
    """Whether the mean of the output is closer than this free run."""
    return not run.get("nmse", np.inf) <= LOST


def _unstable(model: Any, log: View) -> bool:
    """Whether runs that begin later, in states fitted to the same output, end farther from the first than the output is
    from its mean.
    """
    whole = log.longest
    n, before = whole.y.size, lead(whole.y.size, whole.dt)
    if model is None or n < 4 * before:
        return False
    first = window_errors(model, whole, n - before, before)[0]
    for begin in np.linspace(0, n // 2, BEGINNINGS + 1).astype(int)[1:]:
        later = window_errors(model, whole.part(begin, n), n - begin - before, before)[0]
        if not rms_of(first[begin:] - later) ** 2 <= LOST * float(np.var(whole.y)):
            return True
    return False


def _told(run: dict[str, float]) -> str:
    return f"NMSE {run['nmse']:.3g}" if run else "it does not stay finite"


def _steady(trivial: Compared, log: View) -> bool:
    """Whether a position moves so evenly that constant velocity predicts it almost exactly in every window."""
    if log.logged != "position":
        return False
    way = {h: rms_of(log.y[h:] - log.y[:-h]) for h in trivial.windows}
    return all(e < STEADY * way[h] for h, e in trivial.windows.items())


def _at_its_speed(model: Any, log: View) -> str:
    """What an axis takes at the speed at which it turned evenly: the sum is known, not its shares or the inertia."""
    if not isinstance(model, AxisModel):
        return ""
    speed, (drive, motion) = float(np.mean(log.target)) * log.si[1], model.si
    torque = float(model.law(0.0, speed)) + model.parameters["input_offset"]
    return (
        f" At its speed, {speed:.4g} {motion}/s, friction and offset take {torque:.4g} {drive} together; how it is "
        "shared, and the inertia, are known only as far as the intervals say."
    )


def _at_rest(model: Any) -> str:
    """How dry friction brings the axis to rest, if not at once."""
    early = [e for e in getattr(model, "effects", ()) if isinstance(e, EarlyReversal)]
    like = "as that of MuJoCo's solver does (early_reversal)"
    return "".join(f" Its dry friction takes about {1e3 * e.lead:.2g} ms to bring it to rest, {like}." for e in early)


def _fitted(compared: Compared, fit: Callable[[View], Any], log: View, units: dict[str, str]) -> Compared:
    """The candidate with its model, or with the reason for failure."""
    begin = time.process_time() - compiling_seconds()
    try:
        model = fit(log.in_si)
        compared.model = replace(model, units=units) if units else model
        if isinstance(model, LinearModel) and model.delay > 1:
            dead = (model.delay - 1) * log.dt  # the other sample is that of the hold
            compared.structure = {**compared.structure, "dead_time": dead}
            compared.name = f"{compared.name.partition(', dead')[0]}, dead time {dead:.3g}"
        if _at_rest(model):
            compared.structure = {**compared.structure, "law": [*compared.structure["law"], EarlyReversal.name]}
        if not compared.structure:  # already found by the fit
            sizes = {k: len(getattr(model, k)) - 1 for k in ("b1", "f1", "b2", "f2")}
            compared.structure = {"zeros_and_poles": sizes, "law": "cubic_spline", "knots": len(model.law)}
    except (ValueError, np.linalg.LinAlgError) as error:
        compared.failure, compared.untold = str(error).splitlines()[0], isinstance(error, UntoldError)
    compared.seconds = time.process_time() - compiling_seconds() - begin
    return compared


def _better(first: Compared, again: Compared, log: View) -> Any:
    """The model fitted to the whole record, unless that fit ended in a worse minimum than the first."""
    parts = [replace(first, windows={}, score=np.inf), replace(again, windows={}, score=np.inf)]
    for part in parts:
        _score(part, log)
        part.train = _indices(part.model, log, 0)
    if _lost(parts[1].train) and not _lost(parts[0].train):
        return first.model
    return again.model if parts[1].score <= AS_GOOD * parts[0].score else first.model


def _with_drive_error(model: Any, relative: float) -> Any:
    """The model with wider errors of the parameters that scale with the drive (an axis) or inversely with it (a
    numerator).
    """
    if not relative or isinstance(model, ChainModel):
        return model
    values, errors = model.parameters, dict(model.standard_errors)
    for name, error in errors.items():
        of_drive = name.startswith("b")
        if isinstance(model, AxisModel):
            of_drive = not name.endswith(("__knot", "__phase")) and model.parameter_units[name] != "1"
        errors[name] = float(np.hypot(error, relative * values[name])) if of_drive and name in values else error
    return replace(model, standard_errors=errors)


def _score(compared: Compared, log: View) -> None:
    """Errors over windows; if the output is not a position, a free run of the whole record counts as one more."""
    if compared.model is None and compared.kind != "trivial":
        return
    longest = log.longest.u.size
    before = lead(longest, log.dt)
    lengths = horizons(longest - before, log.dt)
    errors = {h: window_errors(compared.model, log, h, before) for h in lengths}
    compared.windows = {h: rms_of(e) for h, e in errors.items()}
    compared.squares = {h: powers(e) for h, e in errors.items()}
    scale = float(np.fmax(log.floor, 1e-6 * np.std(log.y)))

    def score(record: View, windows: list[float]) -> float:
        if compared.model is not None and log.logged != "position":
            windows = [*windows, rms_of(_whole_run(compared.model, record, before))]
        elif log.logged != "position":
            windows = [*windows, float(np.std(log.y))]
        return mean_error(windows, log, scale) / scale if np.isfinite(windows).all() else np.inf

    compared.score = score(log, list(compared.windows.values()))
    if compared.model is not None and np.isfinite(compared.score):
        undriven = _undriven(log)
        without = [rms_of(window_errors(compared.model, undriven, h, before)) for h in lengths]
        compared.by_drive = compared.score / score(undriven, without)
        if compared.kind != "axis" and log.logged != "output":
            moved = compared.model.simulate(log.u) - compared.model.simulate(undriven.u)
            # the work itself is negative for an axis behind a lag of 20 ms, too, under a sine of 3 Hz
            impulse, displacement = np.cumsum(log.u - undriven.u), np.cumsum(moved - moved.mean())
            compared.along_drive = float(impulse @ displacement) > 0.0


def _undriven(log: View) -> View:
    """The record with its drive held at the mean."""
    return replace(log, u=np.full_like(log.u, log.u.mean()))


def _whole_run(model: Any, log: View, before: int) -> Array:
    """Output minus the free run of the whole record after its first samples; a chain starts from rest.

    A first block with a very long memory follows any window from a state fitted to it, but not another record.
    """
    if not isinstance(model, ChainModel):
        return whole_errors(model, log, before)[0]
    pieces = [log.part(a, b) for a, b in itertools.pairwise(log.bounds.tolist())]
    return np.concatenate([(p.y - model.simulate(p.u))[min(before, p.y.size // 2) :] for p in pieces])


def _indices(model: Any, log: View, skip: int, past: ArrayLike = ()) -> dict[str, float]:
    """NMSE and RMSE of the free run in the output's unit; only a chain that runs in one piece starts from rest.

    ``past``: the drive before the log, which brings a chain to its state where the log was cut in motion.

    The state of the others is fitted to the first samples, which do not count: a tank that was not empty when its log
    began left an NMSE of 0.7 to a linear model that predicts it with 0.15.
    """
    if model is None:
        return {}
    if log.logged == "output" and isinstance(model, ChainModel) and not log.starts:
        error = (log.y - model.simulate(np.r_[past, log.u])[np.size(past) :])[skip:]
        known = log.y[skip:]
    else:
        before = lead(log.longest.u.size, log.dt)
        error, known = (x[max(skip - before, 0) :] for x in whole_errors(model, log, before))
    rmse = rms_of(error)
    return {"nmse": rmse**2 / max(float(np.var(known)), 1e-300), "rmse": rmse} if np.isfinite(rmse) else {}
