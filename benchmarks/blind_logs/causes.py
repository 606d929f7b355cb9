"""Logs that show why a finder fails on rigs that nobody tuned on: each holds one cause, drawn by its seed.

`CASES` lists them with one line of truth each. Axes are of `plant` (20 kHz steps of its own) or of MuJoCo, chains of
`filtered_chain`; nothing is of the library. `python -m benchmarks.causes` diagnoses them and prints a table.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd

from benchmarks.blind_logs import filtered_chain, servo
from benchmarks.blind_logs.excitation import reference
from benchmarks.blind_logs.plant import FINE_HZ, NAMES, SLOT, simulate

OPEN_LOOP = {"time": "time_s", "drive": "torque_nm", "position": "position_rad"}
STEP_OF_ENCODER = 2 * np.pi / 16384


@dataclass(frozen=True)
class Log:
    """What the finder sees: a frame, the columns' roles, the base law, and the kind of its model."""

    frame: pd.DataFrame
    columns: dict[str, str]
    law: str | None = None
    model: str = "servo"


class Cause(NamedTuple):
    """A maker (of a seed), its truth in one line, the names that must be found, and those that may stand beside."""

    make: Callable[..., Log]
    truth: str
    names: tuple[str, ...]
    beside: tuple[str, ...] = ()
    sure: bool = True  # whether the verdict may be `named`; without: something has no name, so it may not


class Axis(NamedTuple):
    """An axis of `plant` with its drive: PD gains on the reference, or its torque alone."""

    slots: dict[str, float]
    path: tuple[np.ndarray, np.ndarray, np.ndarray]  # position, velocity, acceleration wanted, each (n,)
    rate: float
    gains: tuple[float, float] = (0.0, 0.0)
    torque: np.ndarray | None = None  # (n,), instead of a loop
    limit: float = 1e6
    drive_noise: float = 0.0  # of the logged torque, rms
    position_noise: float = 0.0

    def log(self, rng: np.random.Generator, law: str | None = None) -> Log:
        """Run it; the logged torque has the noise of its sensor."""
        p = np.zeros(len(NAMES))
        for name, value in {"step_at": 1e9, "end_stop_at": 1e9, "quantum": STEP_OF_ENCODER, **self.slots}.items():
            p[SLOT[name]] = value
        n = self.path[0].size
        p[SLOT["duration"]] = n / self.rate
        # the loop's feed-forward of acceleration, with a factor of one, takes a torque instead
        path = self.path if self.torque is None else (np.zeros(n), np.zeros(n), self.torque)
        control = np.array([*self.gains, 0.0, 0.6, 0.0 if self.torque is None else 1.0, 0.0, 0.0, self.limit])
        noise = self.position_noise * rng.standard_normal(n)
        u, y = simulate(p, *path, control, noise, np.zeros(n), round(FINE_HZ / self.rate), 0)
        u = u + self.drive_noise * rng.standard_normal(n)
        frame = pd.DataFrame({"time_s": np.arange(n) / self.rate, "torque_nm": u, "position_rad": y})
        return Log(frame, OPEN_LOOP, law)


def swept(t: np.ndarray, reach: float, hz: float, phase: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A sweep from a twentieth of ``hz`` to ``hz`` whose swing shrinks as it gets faster, with its derivatives."""
    dt, f0 = t[1] - t[0], hz / 20.0
    q = reach * np.sin(2 * np.pi * (f0 * t + (hz - f0) * t**2 / (2 * t[-1])) + phase) / (1.0 + 4.0 * t / t[-1])
    q = q * np.minimum(1.0, t / 0.5) ** 2
    v = np.gradient(q, dt)
    return q, v, np.gradient(v, dt)


def wrist(seed: int, *, centre: float = 0.0, reach: float = 0.8) -> Log:
    """A light wrist: gravity is most of the drive, the amplifier's limit is met in a few samples in a thousand."""
    rng = np.random.default_rng([seed, 101])
    t = np.arange(0.0, 25.0, 0.01)
    q, v, a = swept(t, reach, rng.uniform(1.5, 2.5), rng.uniform(0, 6))
    inertia = 0.008 * rng.uniform(0.7, 1.4)
    slots = {"inertia": inertia, "viscous": 0.03, "coulomb": 0.08, "gravity": 0.7 * rng.uniform(0.8, 1.2),
             "gravity_phase": np.pi / 2 + centre}  # fmt: skip
    axis = Axis(slots, (q, v, a), 100.0, (inertia * 900.0, inertia * 48.0), drive_noise=0.008)
    u = axis.log(rng).frame["torque_nm"].to_numpy()
    return axis._replace(limit=float(np.quantile(np.abs(u), 0.996))).log(rng)


def free_swing(seed: int, *, early: float = 0.0) -> Log:
    """A pendulum on a direct drive, kicked and then pumped by a small torque that follows its velocity.

    The torque is nearly a function of the velocity alone, as friction is, while J a and G sin q nearly cancel.
    """
    rng = np.random.default_rng([seed, 102])
    t = np.arange(0.0, 14.0, 1.0 / 250.0)
    inertia = 0.057 * rng.uniform(0.9, 1.1)
    gravity = inertia * 19.6
    kick = np.where(t < rng.uniform(0.2, 0.5), 0.3 * gravity, 0.0)
    slots = {"inertia": inertia, "viscous": 0.02, "coulomb": 0.06 * gravity, "gravity": gravity}
    limit = 0.16 * gravity  # where it holds against friction the swing is some 1.8 rad
    axis = Axis(slots, (t, t, t), 250.0, (0.0, -0.5), torque=kick, limit=limit, drive_noise=0.01)
    return aged(axis.log(rng), early)


def aged(log: Log, seconds: float) -> Log:
    """The drive's column moved: what it says acts ``seconds`` later (negative: has acted so long ago)."""
    t, u = log.frame["time_s"].to_numpy(), log.frame["torque_nm"].to_numpy()
    frame = log.frame.assign(torque_nm=np.interp(t + seconds, t, u))
    inside = (t + seconds >= t[0]) & (t + seconds <= t[-1])
    frame = frame[inside].reset_index(drop=True)
    return Log(frame.assign(time_s=frame["time_s"] - frame["time_s"].iloc[0]), log.columns, log.law, log.model)


def heavy(seed: int, seconds: float) -> Log:
    """An axis with gravity whose drive is logged at another time than it acts."""
    case = servo.make_case("named", seed, effects=("gravity_imbalance",), size=0.4, seconds=20.0, rate=500.0)
    return aged(Log(case.frame, OPEN_LOOP), seconds)


def small_travel(seed: int, *, travel: float = 0.02, spring: float = 0.0) -> Log:
    """A stage that moves over some hundredths of a radian in all."""
    rng = np.random.default_rng([seed, 103])
    rate = 500.0
    t = np.arange(0.0, 20.0, 1.0 / rate)
    path = reference("small", t, rng)
    scale = travel / np.ptp(path[0])
    q, v, a = (scale * x for x in path)
    slots = {"inertia": 0.05, "viscous": 0.4, "coulomb": 0.5 * travel, "spring": spring,
             "quantum": 1e-4 * travel}  # fmt: skip
    return Axis(slots, (q, v, a), rate, (0.05 * 3600.0, 0.05 * 90.0), drive_noise=5e-3 * travel).log(rng)


def drawn(seed: int, name: str, kind: str = "named") -> Log:
    """One effect of the blind servo logs, 15 % of the drive."""
    case = servo.make_case(kind, seed, effects=(name,), size=0.15, seconds=25.0)
    return Log(case.frame, servo.COLUMNS)


def chain(seed: int, effect: str) -> Log:
    """A chain of `filtered_chain`."""
    return Log(filtered_chain.record(effect, seed).frame, filtered_chain.COLUMNS, model="wiener-hammerstein")


HINGE = """<mujoco><compiler angle="radian"/><option timestep="0.0005" integrator="implicitfast" gravity="0 0 0"/>
<worldbody><body><joint name="axis" axis="0 1 0" damping="{damping}" armature="{inertia}" frictionloss="{friction}"
 solreffriction=".002 1" {extra}/><geom type="box" size=".05 .01 .01" mass=".1"/></body></worldbody>
<actuator><motor joint="axis"/></actuator></mujoco>"""

ARM = """<mujoco><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast" gravity="0 0 -9.81"/>
<worldbody><body><joint name="shoulder" axis="0 1 0" damping=".08" armature=".01"/>
<geom type="capsule" fromto="0 0 0 0 0 -.3" size=".02" mass="{upper}" contype="0"/>
<body pos="0 0 -.3"><joint name="elbow" axis="0 1 0" damping=".04" armature=".005"/>
<geom type="capsule" fromto="0 0 0 0 0 -.25" size=".02" mass="{lower}" contype="0"/></body></body></worldbody>
<actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator></mujoco>"""


class Loop(NamedTuple):
    """A PD controller with a limit that MuJoCo's joints run under; ``late`` samples between it and the joint."""

    wanted: np.ndarray  # (joints, n)
    rate: float
    gains: np.ndarray  # (joints, 2)
    limit: float = 1e6
    late: int = 0

    def run(self, xml: str) -> tuple[np.ndarray, np.ndarray]:
        """(drive, position), each (joints, n); the encoder has 16,384 steps."""
        import mujoco

        model = mujoco.MjModel.from_xml_string(xml)
        data = mujoco.MjData(model)
        data.qpos[:] = self.wanted[:, 0]
        u, y = np.zeros_like(self.wanted), np.zeros_like(self.wanted)
        every = round(1.0 / (self.rate * model.opt.timestep))
        speed = np.zeros(len(u))
        for k in range(u.shape[1]):
            y[:, k] = STEP_OF_ENCODER * np.round(data.qpos / STEP_OF_ENCODER)
            if k:
                speed += 0.4 * ((y[:, k] - y[:, k - 1]) * self.rate - speed)
                rate = (self.wanted[:, k] - self.wanted[:, k - 1]) * self.rate
                push = self.gains[:, 0] * (self.wanted[:, k] - y[:, k]) + self.gains[:, 1] * (rate - speed)
                u[:, k] = np.clip(push, -self.limit, self.limit)
            data.ctrl[:] = u[:, max(k - self.late, 0)]
            mujoco.mj_step(model, data, every)
        return u, y


def multisine(rng: np.random.Generator, t: np.ndarray, reach: float) -> np.ndarray:
    """Six tones of 0.1 to 3 Hz that begin at rest, (n,)."""
    tones = zip(np.geomspace(0.1, 3.0, 6), rng.uniform(0, 6, 6), strict=True)
    q = sum((np.sin(2 * np.pi * f * t + a) - np.sin(a)) / (1.0 + 2.0 * f) for f, a in tones)
    return reach * q / np.max(np.abs(q)) * np.minimum(1.0, t) ** 2


def hinge(seed: int, *, extra: str = "", late: int = 0, limit: float = 1e6) -> Log:
    """One hinge of MuJoCo."""
    rng = np.random.default_rng([seed, 104])
    rate = 500.0
    t = np.arange(0.0, 25.0, 1.0 / rate)
    inertia = 0.06 * rng.uniform(0.7, 1.4)
    xml = HINGE.format(damping=2.0 * inertia, inertia=inertia, friction=3.0 * inertia, extra=extra)
    w = 22.0
    q = multisine(rng, t, 1.6)
    u, y = Loop(q[None], rate, np.array([[inertia * w * w, 1.4 * inertia * w]]), limit, late).run(xml)
    frame = pd.DataFrame({"time_s": t, "reference_rad": q, "torque_nm": u[0], "position_rad": y[0]})
    return Log(frame, servo.COLUMNS)


def arm_joint(seed: int) -> Log:
    """The shoulder of a hanging arm of two links that both move: gravity, and a large rest from the other link."""
    rng = np.random.default_rng([seed, 105])
    rate = 250.0
    t = np.arange(0.0, 25.0, 1.0 / rate)
    q = np.array([multisine(rng, t, 1.4), multisine(rng, t, 1.0)])
    xml = ARM.format(upper=rng.uniform(0.8, 1.4), lower=rng.uniform(0.4, 0.8))
    u, y = Loop(q, rate, np.array([[60.0, 6.0], [12.0, 1.0]])).run(xml)
    return Log(pd.DataFrame({"time_s": t, "torque_nm": u[0], "position_rad": y[0]}), OPEN_LOOP)


LATE = ("input_delay", "actuator_lag")
STOP = {"extra": 'limited="true" range="-1.2 1.2"', "limit": 4.0}  # of MuJoCo's default stiffness
CASES: dict[str, Cause] = {
    "wrist": Cause(wrist, "gravity; a limit that is hardly met explains nothing", ("gravity_imbalance",)),
    "level_arm": Cause(
        partial(wrist, reach=0.35), "gravity, though an offset does nearly as much", ("gravity_imbalance",)
    ),
    "free_swing": Cause(free_swing, "gravity, where J a and G sin q nearly cancel", ("gravity_imbalance",)),
    "free_swing_early": Cause(
        partial(free_swing, early=0.024), "the same, the drive logged 24 ms early", ("gravity_imbalance",), LATE
    ),
    "drive_late": Cause(
        partial(heavy, seconds=-0.016), "gravity; the drive is logged 16 ms after it acted", ("gravity_imbalance",)
    ),
    "drive_early": Cause(
        partial(heavy, seconds=0.038), "gravity; the drive acts 38 ms after it is logged", ("gravity_imbalance",), LATE
    ),
    "small_travel": Cause(small_travel, "nothing is missing over 0.02 rad", ()),
    "small_travel_spring": Cause(
        partial(small_travel, travel=0.004, spring=4.0), "a spring over 0.004 rad", ("cable_spring",)
    ),
    **{
        name: Cause(partial(drawn, name=name, kind="foreign"), f"{what}: outside the catalogue", (), sure=False)
        for name, what in (
            ("square_beat", "a torque that beats in time and turns its sign over the angle"),
            ("angle_inertia", "an inertia that depends on the angle"),
            ("warm_spring", "a spring that stiffens with time"),
        )
    },
    "coupling": Cause(
        partial(drawn, name="flexible_coupling"), "a flexible coupling, and no tone", ("flexible_coupling",)
    ),
    "changed": Cause(
        partial(drawn, name="parameter_change"), "a number that jumps, and nothing else", ("parameter_change",)
    ),
    "arm_joint": Cause(
        arm_joint, "gravity first; what the other link does has no name", ("gravity_imbalance",), sure=False
    ),
    "mujoco_stop": Cause(partial(hinge, **STOP), "an end stop, though the drive is at its limit there", ("end_stop",)),
    "mujoco_delay": Cause(partial(hinge, late=4), "a delay of 8 ms", ("input_delay",)),
    "chain_delay": Cause(partial(chain, effect="input_delay"), "a delay of 1.5 to 5 samples before L1", LATE[:1]),
    "chain_play": Cause(partial(chain, effect="input_play"), "a play before L1", ("backlash",)),
    "chain_coupling": Cause(
        partial(chain, effect="output_coupling"), "a weakly damped coupling behind L2", ("flexible_coupling",)
    ),
    "chain_fold": Cause(
        partial(chain, effect="folded_below_noise"), "rectified, noise after the fold", ("sensor_rectification",)
    ),
}


def make(name: str, seed: int) -> Log:
    """The log of a cause.

    Raises
    ------
    ValueError
        For a name that is not in `CASES`.
    """
    if name not in CASES:
        raise ValueError(f"no cause {name!r}; expected one of {', '.join(CASES)}.")
    return CASES[name].make(seed)
