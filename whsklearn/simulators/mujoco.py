"""An MJCF model as a simulator: finds what it is missing against a log, and writes it repaired (extra ``mujoco``)."""

from __future__ import annotations

import contextlib
import copy
import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import ContactStop, Effect, LuGre
from whsklearn.filtering.records import motion
from whsklearn.logs.files import atomic_write
from whsklearn.simulators.mujoco_edit import Axis, hold

Array = NDArray[Any]
TRACKING = 1.5  # Hz: how fast the replay returns to the log; far below a controller, so that errors show
LEAST = 1e-6  # of the inertia: below, a number of the model counts as zero
ITERATIONS = 5
RESTARTED = 4  # steps of Gauss-Newton in the two numbers of a restart; most runs take two
LEAST_GAIN = 0.01  # of a run's sum of squares, below which such a step is the last
CHECKED = 100  # samples between two looks at whether a run is still stable
STARTED = 0.25  # s at whose replay the start is fitted; the observer forgets it within 0.1 s (0.1 to 1 s: same results)


class StartVelocity(NamedTuple):
    """Velocity of the joint at the start of every segment of a record, which is known by its drive, and its unit."""

    drive: Array
    velocity: Array
    unit: float


class MuJoCoSimulator:
    """One joint of an MJCF model, driven by the logged control.

    The replay is held near the log by an observer of 1.5 Hz (without it a replay of an axis drifts away within
    seconds); everything else in the model moves as it does in MuJoCo.

    Parameters
    ----------
    model : path or str
        An MJCF file, or its text.
    joint : str
        The joint, a hinge or a slide, whose position was logged.
    actuator : str, optional
        The actuator whose control was logged; the joint's only one by default.

    Raises
    ------
    ImportError
        If MuJoCo is not installed.
    ValueError
        If the model has no such joint or actuator.

    References
    ----------
    Todorov, Erez and Tassa 2012, MuJoCo: A physics engine for model-based control, Proc. IROS 2012, 5026-5033.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from whsklearn import ServoAxis
    >>> from whsklearn.effects import Coulomb
    >>> from whsklearn.export import export_model
    >>> from whsklearn.gap import ServoRecord
    >>> from whsklearn.simulators import MuJoCoSimulator
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     xml = export_model(ServoAxis(), to="mjcf", out=folder).paths[0]
    ...     simulator = MuJoCoSimulator(xml, joint="axis")
    >>> record = ServoRecord(np.arange(200) / 1000, np.ones(200), np.zeros(200))
    >>> free = simulator.simulate(record)
    >>> braked = simulator.with_effect(Coulomb(0.5)).simulate(record)
    >>> bool(braked[-1] < free[-1])
    True

    ``GapFinder(simulator).fit(log, drive="torque_nm", position="position_rad").model_.write("repaired.xml")`` finds
    what the MJCF lacks and writes it with that.
    """

    def __init__(self, model: str | os.PathLike[str], *, joint: str, actuator: str | None = None):
        mujoco = _library()
        text = str(model)
        spec = mujoco.MjSpec.from_string(text) if text.lstrip().startswith("<") else mujoco.MjSpec.from_file(text)
        _need(spec.joint(joint), "joint", joint, [j.name for j in spec.joints])
        self.spec, self.joint, self.actuator = spec, joint, actuator or _only_actuator(spec, joint)
        _need(spec.actuator(self.actuator), "actuator", self.actuator, [a.name for a in spec.actuators])
        self.effects: tuple[Effect, ...] = ()
        self._own: dict[str, float] = {}
        self._start: StartVelocity | None = None
        self._compile()
        self._own = self._numbers_of_its_own()

    def _compile(self) -> None:
        mujoco = _library()
        edited = hold(self.spec, Axis(self.joint, self.actuator), self.effects, self._own.get("inertia", 1.0))
        self.model = edited.compile()
        self.edited = edited
        self.index = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, self.joint)
        self.dof, self.q = int(self.model.jnt_dofadr[self.index]), int(self.model.jnt_qposadr[self.index])
        self.control = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_ACTUATOR, self.actuator)
        data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, data)
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, data, full)
        self.inertia = float(full[self.dof, self.dof])

    # --- the three methods ----------------------------------------------------------------
    def simulate(self, record: Any) -> Array:
        """Position of the joint under the logged control, shape (n,), held near the log by the observer.

        The replay restarts after a hole in the ``record``.

        The velocity at its start is a number like those of the model: `refit` finds it with them, and before that it is
        the one that fits the first quarter of a second best.  A difference of the log's first positions will not do:
        where an axis at rest gets a hard jump of the drive, an exact model missed the log by 100 encoder steps.
        """
        begun = zip(record.segments, self._start_of(record).velocity.tolist(), strict=True)
        return np.concatenate([self._held(part, velocity, len(part)) for part, velocity in begun])

    def _start_of(self, record: Any) -> StartVelocity:
        """The one that a refit to the record has found, or the one that fits the replay's first quarter second best."""
        if self._start is not None and self._start.drive is record.drive:
            return self._start
        unit = 2.0 * math.pi * TRACKING * (float(np.ptp(record.position)) or 1.0)
        return StartVelocity(
            record.drive, np.array([self._first_velocity(part, unit) for part in record.segments]), unit
        )

    def _first_velocity(self, record: Any, unit: float) -> float:
        """The velocity that fits the first quarter second of the replay of a segment best."""
        y, dt = record.position, record.dt
        first, rise = min(y.size, max(8, round(STARTED / dt))), min(4, y.size - 1)

        def run(velocity: Array) -> tuple[Array, None]:
            return self._held(record, float(velocity[0]), first), None

        *_, best = _fitted(run, np.array([(y[rise] - y[0]) / (rise * dt)]), y[:first], np.array([1e-4 * unit]))
        return float(best[0])

    def _held(self, record: Any, velocity: float, count: int) -> Array:
        """The first ``count`` positions of the replay that begins with this velocity, shape (count,)."""
        mujoco = _library()
        model, dt = self.model, record.dt
        every = self._stepped(dt)
        data = mujoco.MjData(model)
        data.qpos[self.q], data.qvel[self.dof] = record.position[0], velocity
        w = 2.0 * math.pi * TRACKING
        first, second = 2.0 * w * dt, w * w * dt
        y, out = record.position, np.full(count, np.nan)
        qpos, qvel, ctrl, at, dof, k = data.qpos, data.qvel, data.ctrl, self.q, self.dof, self.control
        number = data.warning.number
        with _silence():
            for i, u in enumerate(record.drive[:count]):
                out[i] = qpos[at]
                error = y[i] - out[i]
                qpos[at] += first * error
                qvel[dof] += second * error
                ctrl[k] = u
                mujoco.mj_step(model, data, every)
                if i % CHECKED == 0 and number.any():  # unstable: MuJoCo would reset itself again and again
                    out[i + 1 :] = np.nan
                    break
        return out

    def refit(self, record: Any, keep: NDArray[np.bool_]) -> MuJoCoSimulator:
        """Inertia, damping, dry friction and stiffness, as far as the model has them, and the velocity at the start.

        By Gauss-Newton on the replay. ``record``: a `ServoRecord`. ``keep`` (n,): samples of it that count.
        """
        model = copy.copy(self)
        model._start = self._start_of(record)
        x = np.asarray(model.numbers)
        r = (record.position - model.simulate(record))[keep]
        for _ in range(ITERATIONS):
            columns = []
            for j in range(x.size):
                moved = x.copy()
                moved[j] += 1e-3
                columns.append(((record.position - model.with_numbers(moved).simulate(record))[keep] - r) / 1e-3)
            step = np.clip(-np.linalg.lstsq(np.column_stack(columns), r, rcond=1e-9)[0], -1.0, 1.0)
            other = model.with_numbers(x + step)
            after = (record.position - other.simulate(record))[keep]
            if not float(after @ after) < float(r @ r):
                break
            gain = 1.0 - float(after @ after) / float(r @ r)
            model, x, r = other, x + step, after
            if gain < 1e-3:
                break
        return model

    def with_effect(self, effect: Effect) -> MuJoCoSimulator:
        """The model with one ``effect`` more; NotImplementedError if MuJoCo has nothing like it."""
        other = copy.copy(self)
        other.effects = (*self.effects, effect)
        other._compile()
        return other

    whole_numbers = ("order",)  # MuJoCo's cogging has whole periods a turn

    @property
    def shapes_to_try(self) -> tuple[type[Effect], ...]:
        """Bristles with damping, and stops at any place, which a simulator is not asked for unless it says so."""
        return LuGre, ContactStop

    # --- numbers ---------------------------------------------------------------------------
    @property
    def parameters(self) -> dict[str, float]:
        """What `refit` moves: inertia about the joint, damping, dry friction, stiffness; those that are not zero."""
        return dict(self._own)

    @property
    def parameter_units(self) -> dict[str, str]:
        """Units of the `parameters`, of a hinge or of a slide."""
        mujoco = _library()
        if self.model.jnt_type[self.index] == mujoco.mjtJoint.mjJNT_SLIDE:
            return {"inertia": "kg", "damping": "N s/m", "frictionloss": "N", "stiffness": "N/m"}
        return {"inertia": "kg m²", "damping": "Nm s/rad", "frictionloss": "Nm", "stiffness": "Nm/rad"}

    def _numbers_of_its_own(self) -> dict[str, float]:
        """The `parameters` of the model as compiled, which has no effects yet."""
        m, i = self.model, self.dof
        every = {
            "inertia": self.inertia, "damping": float(m.dof_damping[i]), "frictionloss": float(m.dof_frictionloss[i]),
            "stiffness": float(m.jnt_stiffness[self.index]),
        }  # fmt: skip
        return {k: v for k, v in every.items() if v > LEAST * self.inertia}

    @property
    def numbers(self) -> Array:
        """Logarithms of the `parameters`; after a refit also the velocity at the start of every segment, scaled."""
        own = np.log(list(self.parameters.values()))
        return own if self._start is None else np.append(own, self._start.velocity / self._start.unit)

    def with_numbers(self, x: Array) -> MuJoCoSimulator:
        """The model at other numbers; the inertia is changed by the joint's armature.

        ``x``: as ``numbers`` gives them; if the velocities at the starts are missing, they stay.
        """
        n, other = len(self.parameters), copy.copy(self)
        if self._start is not None and x.size > n:
            other._start = self._start._replace(velocity=np.asarray(x[n:]) * self._start.unit)
        values = dict(zip(self.parameters, np.exp(np.clip(x[:n], -60.0, 60.0)), strict=True))
        other.spec = self.spec.copy()
        j, old = other.spec.joint(self.joint), self._own
        j.armature = max(0.0, float(j.armature) + float(values["inertia"]) - old["inertia"])
        for name, attribute in (("damping", "damping"), ("stiffness", "stiffness")):
            if name in values:
                poly = np.array(getattr(j, attribute), dtype=float)
                poly[0] += values[name] - old[name]
                setattr(j, attribute, poly)
        if "frictionloss" in values:
            j.frictionloss = float(j.frictionloss) + float(values["frictionloss"]) - old["frictionloss"]
        other._own = {k: float(v) for k, v in values.items()}
        other._compile()
        return other

    # --- out -------------------------------------------------------------------------------
    def replay(self, record: Any, horizon: float, *, restart: str = "fitted") -> Array:
        """Free runs of ``horizon`` seconds each, shape (n,); what a run misses is what the model misses.

        A smoothed log blurs velocity, most where friction turns, and a run carries that error along: the very MJCF that
        made a log misses it by up to thousands of times the encoder's noise (`benchmarks.mjcf_gap`). So each run begins
        at the position and the velocity that fit the run itself best in least squares, by Gauss-Newton from those of
        the smoothed log; its inner states (filter, delay, bristles) are those in which the run before ended.

        ``record``: a `ServoRecord`. ``restart``: "fitted", as above, or "smoothed", at the smoothed log's position and
        velocity.

        References
        ----------
        Ljung 1999, System Identification, 2nd ed., Prentice Hall, on initial states of simulations.
        """
        if restart not in ("fitted", "smoothed"):
            raise ValueError(f"restart is {restart!r}, expected fitted or smoothed.")
        y, dt = record.position, record.dt
        every = self._stepped(dt)
        smooth = motion(y, 1.0 / dt, min(20.0, 0.2 / dt))
        data = _library().MjData(self.model)
        out, span = np.empty(len(record)), max(1, round(horizon / dt))
        steps = 1e-4 * np.array([np.ptp(y) or 1.0, np.ptp(smooth.velocity) or 1.0])
        with _silence():
            for i in range(0, y.size, span):
                part = slice(i, i + span)
                begin = np.array([smooth.position[i], smooth.velocity[i]])

                def free(state: Array, drive: Array = record.drive[part], begun: Any = data) -> tuple[Array, Any]:
                    return self._run(begun, state, drive, every)

                out[part], data = _fitted(free, begin, y[part], steps)[:2] if restart == "fitted" else free(begin)
        return out

    def _stepped(self, dt: float) -> int:
        """Steps a sample, the model's time step set so that they make it up."""
        every = max(1, math.ceil(dt / self.model.opt.timestep - 1e-6))
        self.model.opt.timestep = dt / every
        return every

    def _run(self, begun: Any, state: Array, drive: Array, every: int) -> tuple[Array, Any]:
        """(position of the joint under a drive, data at its end) from ``begun`` with another position and velocity."""
        mujoco = _library()
        data = mujoco.MjData(self.model)
        mujoco.mj_copyData(data, self.model, begun)
        data.qpos[self.q], data.qvel[self.dof] = state
        out = np.empty(drive.size)
        qpos, ctrl, at, k = data.qpos, data.ctrl, self.q, self.control
        for i, u in enumerate(drive):
            out[i] = qpos[at]
            ctrl[k] = u
            mujoco.mj_step(self.model, data, every)
        return out, data

    def to_xml(self) -> str:
        """The model with its effects and numbers as MJCF."""
        return str(self.edited.to_xml())

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write ``repaired.xml``; returns its path. ``path``: a folder."""
        atomic_write(path, self.to_xml().encode())
        return Path(path)

    def __copy__(self) -> Self:
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        return other


def _fitted(
    run: Callable[[Array], tuple[Array, Any]], begin: Array, y: Array, steps: Array
) -> tuple[Array, Any, Array]:
    """The run that fits ``y`` best, its end and its beginning, by Gauss-Newton with shortened steps."""
    best, end = run(begin)
    cost = float(np.sum((y - best) ** 2))
    for _ in range(RESTARTED):
        slopes = np.column_stack([(run(begin + h)[0] - best) / h.sum() for h in np.diag(steps)])
        if not np.all(np.isfinite(slopes)) or not np.isfinite(cost):
            break
        step, before = np.linalg.lstsq(slopes, y - best, rcond=1e-9)[0], cost
        for share in (1.0, 0.3, 0.1):
            other, its_end = run(begin + share * step)
            left = float(np.sum((y - other) ** 2))
            if left < cost:
                begin, best, end, cost = begin + share * step, other, its_end, left
                break
        if cost > (1.0 - LEAST_GAIN) * before:
            break
    return best, end, begin


def _library() -> Any:
    try:
        import mujoco
    except ImportError:
        raise ImportError("MuJoCo is not installed; pip install 'whsklearn[mujoco]'.") from None
    return mujoco


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """MuJoCo's warnings go nowhere: it would write MUJOCO_LOG.TXT into the user's folder at every unstable trial."""
    mujoco = _library()
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _warning: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def _only_actuator(spec: Any, joint: str) -> str:
    found = [a.name for a in spec.actuators if a.target == joint]
    if not found:
        driven = sorted({a.target for a in spec.actuators} - {""})
        raise ValueError(
            f"No actuator drives the joint {joint!r}; give a joint that one drives: {', '.join(driven) or 'none here'}."
        )
    if len(found) > 1:
        raise ValueError(
            f"{len(found)} actuators drive the joint {joint!r}: {', '.join(found)}; say whose control was logged with "
            "--actuator (actuator= in Python)."
        )
    return str(found[0])


def _need(found: Any, what: str, name: str, there: list[str]) -> None:
    if found is None:
        raise ValueError(f"The model has no {what} {name!r}; it has {', '.join(filter(None, there)) or 'none'}.")
