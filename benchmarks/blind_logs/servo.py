"""Servo logs with a hidden effect: draw the plant, the controller and the effect, size it, run it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pandas as pd

from benchmarks.blind_logs.excitation import reference
from benchmarks.blind_logs.plant import FINE_HZ, NAMES, SLOT, simulate

EFFECTS = (
    "asymmetric_coulomb asymmetric_viscous stribeck quadratic_drag load_friction position_friction "
    "presliding_hysteresis friction_drift input_offset dead_zone saturation input_delay actuator_lag torque_ripple "
    "backlash flexible_coupling cogging gravity_imbalance cable_spring hardening_spring end_stop "
    "sensor_rectification encoder_eccentricity quantization disturbance_tone parameter_change"
).split()
INVISIBLE = ("output_offset", "output_drift")
FOREIGN = ("theta_v", "dead_velocity", "square_beat", "warm_spring", "angle_inertia", "sine_drag")
LEARNABLE = ("bump", "patch", "hump", "bend")  # outside the catalogue too: drawn by name, never by chance
OUTSIDE = (*FOREIGN, *LEARNABLE, "magnet")
NOISES = (2e-5, 1e-4, 4e-4)


@dataclass
class Case:
    """One blind record: what the finder sees (``frame``) and what it must not see (the rest)."""

    frame: pd.DataFrame
    truth: tuple[str, ...]
    kind: str
    seed: int
    size: float
    noise: float
    parameters: dict[str, float] = field(default_factory=dict)


@dataclass
class _Rig:
    p: np.ndarray
    r: tuple[np.ndarray, np.ndarray, np.ndarray]
    controller: np.ndarray
    noise: np.ndarray
    disturbance: np.ndarray
    steps: int
    lead: int
    rate: float

    def run(self, p: np.ndarray, quiet: bool = False) -> tuple[np.ndarray, np.ndarray]:
        noise = np.zeros_like(self.noise) if quiet else self.noise
        return simulate(p, *self.r, self.controller, noise, self.disturbance, self.steps, self.lead)


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def _rig(rng: np.random.Generator, seconds: float, noise: float, excitation: str, rate: float | None) -> _Rig:
    rate = rate or float(rng.choice([1000.0, 1000.0, 500.0]))
    n = int(seconds * rate)
    t = np.arange(n) / rate
    p = np.zeros(len(NAMES))
    p[SLOT["inertia"]] = 0.05 * rng.uniform(0.7, 1.3)
    p[SLOT["viscous"]] = 0.12 * rng.uniform(0.7, 1.3)
    p[SLOT["coulomb"]] = 0.3 * rng.uniform(0.7, 1.3)
    p[SLOT["duration"]] = seconds
    p[SLOT["step_at"]] = 1e9
    p[SLOT["end_stop_at"]] = 1e9
    p[SLOT["quantum"]] = 2 * np.pi / 65536
    w = rng.uniform(12.0, 30.0)
    damping = rng.uniform(0.7, 1.2)
    j = 0.05 * rng.uniform(0.6, 1.4)
    controller = np.array([
        j * w * w, 2 * damping * j * w, rng.choice([0.0, 0.3 * j * w**3 / 6]), rng.uniform(0.15, 0.6),
        rng.uniform(0.0, 1.0) * j, rng.uniform(0.0, 1.0) * 0.12, rng.uniform(0.0, 1.0) * 0.3, 20.0,
    ])  # fmt: skip
    return _Rig(
        p, reference(excitation, t, rng), controller, noise * rng.standard_normal(n), np.zeros(n),
        int(FINE_HZ / rate), int(rng.choice([0, 0, 0, int(FINE_HZ / rate) // 2])), rate,
    )  # fmt: skip


def _bisect(f, low: float, high: float, goal: float) -> float:
    """The x in [low, high], spanned in ratios, where the growing or falling f meets the goal."""
    rising = f(high) > f(low)
    for _ in range(40):
        mid = np.sqrt(low * high)
        if (f(mid) < goal) == rising:
            low = mid
        else:
            high = mid
    return float(np.sqrt(low * high))


class _Plain(NamedTuple):
    """The quiet run of the plain axis, and what every drawing rule takes from it."""

    u: np.ndarray
    y: np.ndarray
    v: np.ndarray
    a: np.ndarray
    t: np.ndarray
    dt: float
    goal: float  # rms torque of the effect
    phase: float
    either: float

    def amp(self, shape: np.ndarray) -> float:
        """The size at which a shape has the rms torque that is wanted."""
        return self.goal / max(_rms(shape), 1e-12)


def _draw(name: str, size: float, rig: _Rig, rng: np.random.Generator) -> dict[str, float]:
    """Slots of one effect whose torque is ``size`` times the rms torque of the plain axis."""
    u, y = rig.run(rig.p, quiet=True)
    dt = 1.0 / rig.rate
    v = np.gradient(rig.r[0], dt) * 0.0 + np.gradient(y, dt)
    v = np.convolve(v, np.ones(9) / 9, mode="same")
    a = np.convolve(np.gradient(v, dt), np.ones(9) / 9, mode="same")
    phase = rng.uniform(0, 2 * np.pi)
    plain = _Plain(u, y, v, a, np.arange(u.size) * dt, dt, size * _rms(u), phase, rng.choice([-1.0, 1.0]))
    if name in ("backlash", "flexible_coupling"):
        return _draw_two_mass(name, size, rig, rng)
    if name == "quantization":
        return {"quantum": 2 * np.pi / float(np.clip(80 / size, 400, 4000))}
    for rule in (_draw_friction, _draw_drive, _draw_position):
        drawn = rule(name, plain, rng)
        if drawn:
            return drawn
    return _draw_reading(name, plain, rig, rng)


def _draw_friction(name: str, m: _Plain, rng: np.random.Generator) -> dict[str, float]:
    """Friction and what changes it; empty for other effects."""
    s = np.sign(m.v)
    if name == "coulomb":
        return {"coulomb": m.amp(s)}
    if name == "asymmetric_coulomb":
        return {"asymmetric_coulomb": m.either * m.amp(np.abs(s))}
    if name == "asymmetric_viscous":
        return {"asymmetric_viscous": m.either * m.amp(np.abs(m.v))}
    if name == "stribeck":
        vs, d = rng.uniform(0.08, 0.6), rng.choice([1.0, 2.0])
        return {"stribeck": m.amp(np.exp(-((np.abs(m.v) / vs) ** d))), "stribeck_v": vs, "stribeck_delta": d}
    if name == "quadratic_drag":
        return {"quadratic": m.amp(m.v * m.v)}
    if name == "load_friction":
        return {"load_friction": m.amp(m.u)}
    if name == "position_friction":
        k = float(rng.integers(1, 9))
        return {
            "position_friction": m.amp(np.sin(k * m.y)),
            "position_friction_k": k,
            "position_friction_phase": m.phase,
        }
    if name == "presliding_hysteresis":
        return {"presliding": m.amp(np.ones(3)), "presliding_x": 10 ** rng.uniform(-1.7, -0.7)}
    if name == "friction_drift":
        tau = rng.choice([0.0, rng.uniform(0.2, 0.6) * m.t[-1]])
        g = m.t / m.t[-1] if tau == 0 else 1 - np.exp(-m.t / tau)
        return {"friction_drift": m.either * m.amp(g), "friction_drift_tau": tau}
    if name == "parameter_change":
        which = rng.choice(["inertia", "viscous", "coulomb"])
        at = rng.uniform(0.3, 0.7) * m.t[-1]
        signal = {"inertia": m.a, "viscous": m.v, "coulomb": s}[which]
        return {f"step_{which}": float(m.either) * m.amp(signal * (m.t > at)), "step_at": at}
    return {}


def _draw_drive(name: str, m: _Plain, rng: np.random.Generator) -> dict[str, float]:
    """What happens to the drive before it reaches the axis; empty for other effects."""
    u = m.u
    if name == "input_offset":
        return {"offset": m.either * m.goal}
    if name == "dead_zone":
        return {"dead_zone": _bisect(lambda d: _rms(np.clip(u, -d, d)), 1e-4, 10, m.goal)}
    if name == "saturation":
        return {"saturation": _bisect(lambda limit: _rms(u - np.clip(u, -limit, limit)), 1e-2, 20, m.goal)}
    if name in ("input_delay", "actuator_lag"):
        smooth = np.convolve(u, np.ones(15) / 15, mode="same")
        rate = _rms(np.gradient(smooth, m.dt))
        return {name.split("_")[1]: float(np.clip(m.goal / rate, 1.6 * m.dt, 0.02))}
    if name == "torque_ripple":
        k = float(rng.integers(2, 24))
        return {"ripple": m.amp(u * np.sin(k * m.y)), "ripple_k": k, "ripple_phase": m.phase}
    if name == "disturbance_tone":
        return {"tone": m.goal * np.sqrt(2), "tone_hz": rng.uniform(0.7, 12), "tone_phase": m.phase}
    return {}


def _draw_position(name: str, m: _Plain, rng: np.random.Generator) -> dict[str, float]:
    """What depends on the angle; empty for other effects."""
    if name == "cogging":
        k = float(rng.choice([rng.integers(2, 30), rng.uniform(2, 30)]))
        return {"cogging": m.amp(np.sin(k * m.y)), "cogging_k": k, "cogging_phase": m.phase}
    if name == "gravity_imbalance":
        return {"gravity": m.amp(np.sin(m.y + m.phase)), "gravity_phase": m.phase}
    if name == "cable_spring":
        centre = rng.uniform(-1, 1)
        return {"spring": m.amp(m.y - centre), "spring_centre": centre}
    if name == "hardening_spring":
        return {"cubic": m.amp(m.y**3)}
    if name == "end_stop":
        at = float(np.quantile(np.abs(m.y), rng.uniform(0.8, 0.95)))
        return {"end_stop": m.amp(np.maximum(np.abs(m.y) - at, 0)), "end_stop_at": at}
    return {}


def _draw_reading(name: str, m: _Plain, rig: _Rig, rng: np.random.Generator) -> dict[str, float]:
    """What happens to the reading.

    Raises
    ------
    ValueError
        For a name without a drawing rule.
    """
    if name == "output_offset":
        return {"output_offset": rng.uniform(0.05, 0.3)}
    if name == "output_drift":
        return {"output_drift": m.either * rng.uniform(1, 5) * 1e-3}
    if name == "sensor_rectification":
        return {"rectify": 1.0}
    if name == "encoder_eccentricity":
        k = float(rng.integers(1, 3))
        j, dt = rig.p[SLOT["inertia"]], m.dt
        shape = j * np.gradient(np.gradient(np.sin(k * m.y), dt), dt) - j * k * np.cos(k * m.y) * m.a
        size = float(np.clip(m.amp(shape), 0, 0.3))
        return {"eccentricity": size, "eccentricity_k": k, "eccentricity_phase": m.phase}
    raise ValueError(f"no drawing rule for {name!r}")


def _draw_two_mass(name: str, size: float, rig: _Rig, rng: np.random.Generator) -> dict[str, float]:
    ratio = rng.uniform(0.3, 0.6)
    j = rig.p[SLOT["inertia"]]
    reduced = j * ratio * (1 - ratio)
    if name == "backlash":
        stiffness = reduced * (2 * np.pi * rng.uniform(50, 90)) ** 2
        gap = float(np.clip(size, 0.01, 0.2)) * rng.uniform(0.25, 0.5)
        return {"backlash": gap, "flex_ratio": ratio, "flex_stiffness": stiffness,
                "flex_damping": 2 * 0.15 * np.sqrt(stiffness * reduced)}  # fmt: skip
    hz = 2.4 / np.sqrt(max(size, 0.01)) * rng.uniform(0.8, 1.2) + 5.0
    stiffness = reduced * (2 * np.pi * hz) ** 2
    damping = 2 * rng.uniform(0.02, 0.1) * np.sqrt(stiffness * reduced)
    return {"flex_ratio": ratio, "flex_stiffness": stiffness, "flex_damping": damping}


def _draw_foreign(name: str, size: float, rig: _Rig, rng: np.random.Generator) -> dict[str, float]:
    """Effects that no catalogue holds."""
    u, y = rig.run(rig.p, quiet=True)
    v = np.convolve(np.gradient(y, 1.0 / rig.rate), np.ones(9) / 9, mode="same")
    t = np.arange(u.size) / rig.rate
    goal = size * _rms(u)
    if name == "theta_v":
        return {"x_theta_v": goal / _rms(y * v)}
    if name == "dead_velocity":
        return {"x_dead_velocity": goal / max(_rms(np.maximum(np.abs(v) - 2, 0)), 1e-3)}
    if name == "square_beat":
        k = float(rng.integers(2, 7))
        return {"x_square": goal * np.sqrt(2), "x_square_k": k}
    if name == "warm_spring":
        return {"x_warm_spring": goal / _rms(y * t / t[-1])}
    if name == "magnet":  # the example of `whsklearn.effects.Effect`
        return _local("bump", y, 0.0, rng.uniform(0.1, 0.4), goal * rng.choice([-1.0, 1.0]))
    if name in ("bump", "patch"):
        at, width = rng.uniform(-0.6, 0.6) * np.abs(y).max(), rng.uniform(0.08, 0.4)
        return _local(name, y, at, width, goal)
    if name == "hump":
        return _local(name, np.abs(v), rng.uniform(0.3, 1.2) * _rms(v), rng.uniform(0.15, 0.4) * _rms(v), goal)
    if name == "bend":
        at, width = rng.uniform(-0.4, 0.4) * np.abs(y).max(), rng.uniform(0.1, 0.5)
        return {"x_bend": goal / _rms(np.tanh((y - at) / width)), "x_bend_at": at, "x_bend_width": width}
    if name == "angle_inertia":
        a = np.gradient(v, 1.0 / rig.rate)
        return {"x_accel": min(goal / (rig.p[0] * _rms(np.cos(y) * a)), 0.6)}
    return {"x_sin_v": goal / _rms(np.sin(y) * v)}


def _local(name: str, signal: np.ndarray, at: float, width: float, goal: float) -> dict[str, float]:
    """A Gaussian hill over a signal."""
    size = goal / _rms(np.exp(-(((signal - at) / width) ** 2)))
    return {f"x_{name}": size, f"x_{name}_at": at, f"x_{name}_width": width}


LARGE = ("coulomb", "gravity_imbalance", "input_offset", "cable_spring", "cogging", "load_friction")


def make_large(seed: int, *, noise: float = 1e-4, seconds: float = 20.0, rate: float | None = 500.0) -> Case:
    """A viscous axis with two or three large effects, each 20 to 200 % of the rms drive of the plain axis.

    ``stribeck`` comes with the Coulomb friction that it is a part of.
    """
    rng = np.random.default_rng([seed, 4712])
    rig = _rig(rng, seconds, noise, "rich", rate)
    rig.p[SLOT["coulomb"]] = 0.0
    effects = tuple(map(str, rng.choice(LARGE, rng.integers(2, 4), replace=False)))
    if "coulomb" in effects and rng.random() < 0.4:
        effects = (*effects[:2], "stribeck") if "coulomb" in effects[:2] else ("coulomb", effects[0], "stribeck")
    drawn: dict[str, float] = {}
    for name in effects:
        most = 0.6 if name == "load_friction" else 2.0  # of the drive: a gear that takes all of it locks
        drawn.update(_draw(name, float(np.exp(rng.uniform(np.log(0.2), np.log(most)))), rig, rng))
    p = rig.p.copy()
    for slot, value in drawn.items():
        p[SLOT[slot]] = value
    u, y = rig.run(p)
    frame = pd.DataFrame({"time_s": np.arange(u.size) / rig.rate, "torque_nm": u, "position_rad": y})
    return Case(frame, effects, "large", seed, math.nan, noise, drawn)


def make_case(
    kind: str,
    seed: int,
    *,
    effects: tuple[str, ...] | None = None,
    size: float = 0.05,
    noise: float = 1e-4,
    seconds: float = 40.0,
    excitation: str = "rich",
    rate: float | None = None,
    counts: int = 65_536,
) -> Case:
    """One record drawn by its seed; the encoder has ``counts`` a turn.

    kind: ``named`` (one effect, drawn unless ``effects`` gives it), ``pair``, ``none``,
    ``coloured`` (torque noise of 0.5 to 100 ms, no effect unless given), ``foreign`` (outside the catalogue).
    """
    rng = np.random.default_rng([seed, 4711])
    rig = _rig(rng, seconds, noise, excitation, rate)
    rig.p[SLOT["quantum"]] = 2 * np.pi / counts
    if effects is None:
        count = {"named": 1, "pair": 2}.get(kind, 0)
        pool = [e for e in EFFECTS if kind != "pair" or e not in ("quantization", "sensor_rectification")]
        drawn_names = rng.choice(FOREIGN, 1) if kind == "foreign" else rng.choice(pool, count, replace=False)
        effects = tuple(map(str, drawn_names))
    drawn: dict[str, float] = {}
    for name in effects:
        drawn.update((_draw_foreign if name in OUTSIDE else _draw)(name, size, rig, rng))
    p = rig.p.copy()
    for slot, value in drawn.items():
        p[SLOT[slot]] = value
    if kind == "coloured":
        u, _ = rig.run(rig.p, quiet=True)
        tau = 10 ** rng.uniform(np.log10(0.5e-3), np.log10(0.1))
        pole = np.exp(-1 / (rig.rate * tau))
        w, x = rng.standard_normal(u.size), np.zeros(u.size)
        for i in range(1, u.size):
            x[i] = pole * x[i - 1] + w[i]
        rig.disturbance = size * _rms(u) * x / _rms(x)
        drawn["noise_seconds"] = tau
    u, y = rig.run(p)
    frame = pd.DataFrame({
        "time_s": np.arange(u.size) / rig.rate, "reference_rad": rig.r[0], "torque_nm": u, "position_rad": y,
    })  # fmt: skip
    return Case(frame, tuple(effects), kind, seed, size, noise, drawn)


COLUMNS = {"time": "time_s", "drive": "torque_nm", "position": "position_rad", "reference": "reference_rad"}
