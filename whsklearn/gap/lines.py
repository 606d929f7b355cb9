"""Lines: what the finder needs to know of one kind of model, servo axis, Wiener-Hammerstein or a user's own.

A line checks the log, opens a bench on it, proves the result by simulation and hands the repaired
model back as the library's own.  ``SimulatorLine`` asks a user's simulator three things only.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from whsklearn.gap.bench import Bench, make_bench
from whsklearn.gap.check import Problem, check_servo
from whsklearn.gap.close import Simulation, simulation_error
from whsklearn.gap.locate import order_spectrum, since_reversal, spectrum
from whsklearn.gap.record import ServoRecord
from whsklearn.gap.search import Found

Array = NDArray[Any]


class ServoLine:
    """A rigid axis whose drive and position are logged; the controller need not be known.

    Parameters
    ----------
    record : ServoRecord
    law : tuple of str
        Friction terms of the base model.
    given_model : object
        What is handed back if nothing can be diagnosed.
    """

    kind = "servo"
    headline = 0.5

    def __init__(self, record: ServoRecord, law: tuple[str, ...], given_model: Any, tolerance: float):
        self.record, self.law, self.given_model, self.tolerance = record, law, given_model, tolerance
        self.units = record.units
        self.gap_word = {"Nm": "missing torque", "N": "missing force"}.get(record.units[0], "missing drive")

    def check(self) -> list[Problem]:
        """See `whsklearn.gap.check.check_servo`."""
        return check_servo(self.record)

    def open(self, rng: np.random.Generator) -> tuple[Bench, Any]:
        """The bench and the base model's first guess."""
        from whsklearn.gap.search import fit_base
        from whsklearn.gap.sensors import unfold

        bench, model = make_bench(self.record, self.law, tolerance=self.tolerance)
        self._twin: tuple[Bench, Any] | None = None
        self._rng = rng
        self._folded: tuple[Bench, Any] | None = None
        straight = unfold(self.record.position, self.record.dt)
        if straight is not None:
            record = dataclasses.replace(self.record, position=straight)
            other, other_model = make_bench(record, self.law, tolerance=self.tolerance)
            folded_base, _ = fit_base(bench, model)
            unfolded_base, _ = fit_base(other, other_model)
            if _misfit(other, unfolded_base) < 0.1 * _misfit(bench, folded_base):
                self._folded = (bench, folded_base)
                self.record = record
                return other, unfolded_base
        return bench, model

    def special(self, bench: Bench, found: Found) -> tuple[str, list] | None:
        """Verdicts that no missing torque shows: a coarse encoder, a folded sensor."""
        from whsklearn.effects import get_effect
        from whsklearn.gap.diagnosis import NamedEffect
        from whsklearn.gap.sensors import coarse_encoder

        if self._folded is not None:
            effect = get_effect("sensor_rectification")(fraction=1.0)  # type: ignore[call-arg]
            return "named", [NamedEffect(effect, {}, float(len(self.record)), 0.99, 1.0)]
        return coarse_encoder(bench, found)

    def blind_share(self, trials: list[Any]) -> float:
        """Share of the catalogue that this record could not show at two percent of the rms drive."""
        if not trials:
            return 1.0
        dark = [t.expected < 150.0 for t in trials if t.kind.linear]
        return float(np.mean(dark)) if dark else 0.0

    def proof(self, bench: Bench, found: Found, horizon: float) -> tuple[Simulation, Simulation, float]:
        """Simulation errors on held-out samples before and after, and the floor from a twin."""
        before = simulation_error(*(self._folded or (bench, found.base)), horizon)
        after = simulation_error(bench, found.model, horizon) if found.taken or self._folded else before
        if self._twin is None:
            self._twin = (bench.twin(found.base, self._rng), found.base)
        floor = simulation_error(*self._twin, horizon).rmse
        return before, after, floor

    def axes(self, bench: Bench, model: Any) -> dict[str, tuple[Array, str]]:
        """The signals that the gap may follow, decimated."""
        _, angle, speed = bench.follow(model)
        pick, dt = bench.lens.pick, bench.scene.dt
        q, v, u = pick(angle), pick(speed), bench.lens.blur(self.record.drive)
        torque, rad = self.units
        out = {
            "time": (np.arange(q.size) * dt * bench.lens.every, "s"),
            "position": (q, rad),
            "velocity": (v, f"{rad}/s"),
            "reversal": (pick(since_reversal(speed, dt, 0.01 * bench.scene.speed)), "s"),
            "drive": (u, torque),
        }
        if np.ptp(q) > 2 * np.pi:
            out["angle in the turn"] = (np.mod(q, 2 * np.pi), rad)
        return out

    def residual_tests(self, bench: Bench, found: Found) -> list[dict[str, Any]]:
        """Whiteness of what is left, before and after."""
        from scipy.stats import chi2

        out = []
        for name, model in (("before", found.base), ("after", found.model)):
            bench.weigh(0.0)
            e = bench.whitened(bench.missing(model), on="all")
            e = e - e.mean()
            n, lags = e.size, 20
            r = np.array([e[k:] @ e[: n - k] for k in range(1, lags + 1)]) / float(e @ e)
            q = n * (n + 2) * float(np.sum(r**2 / (n - np.arange(1, lags + 1))))
            out.append({"test": f"Ljung-Box, {lags} lags, {name}", "statistic": q, "p_value": float(chi2.sf(q, lags)),
                        "largest": float(np.abs(r).max()), "band": 1.96 / np.sqrt(n)})  # fmt: skip
        return out

    def parameter_table(self, found: Found) -> list[dict[str, Any]]:
        """The base model's numbers before and after."""
        rows = [{"name": "inertia", "before": found.base.inertia, "after": found.model.inertia}]
        for b, a in zip(found.base.terms, found.model.terms[: found.model.n_base], strict=True):
            rows.append({"name": b.kind.name, "before": b.q[0], "after": a.q[0]})
        rows.append({"name": "age of the drive (samples)", "before": found.base.timing, "after": found.model.timing})
        return rows

    def notes(self, bench: Bench, found: Found) -> list[str]:
        """Remarks on how the record was used."""
        return [
            f"Position noise {bench.noise:.3g} {self.units[1]} (from sixth differences); the gap is seen "
            f"up to {bench.lens.cutoff:.1f} Hz, where that noise makes "
            f"{100 * bench.floor() / bench.scene.torque:.2f} % "
            "of the rms drive.",
            "The drive is replayed and the model held near the measurement by an observer, so no controller is needed.",
            "60 % of the record in five stretches is used for fitting, the 40 % between them for judging.",
        ]

    def pictures(self, bench: Bench, found: Found, diagnosis: Any) -> dict[str, Any]:
        """Series that the page draws."""
        from whsklearn.gap.close import free_run, held_out

        dt = bench.scene.dt
        y = self.record.position
        runs = {"before": free_run(bench, found.base, 0.5), "after": free_run(bench, found.model, 0.5)}
        d0, d1 = found.base_missing, bench.missing(found.model)
        f, a0 = spectrum(d0[bench.usable], 1.0 / (dt * bench.lens.every))
        _, a1 = spectrum(d1[bench.usable], 1.0 / (dt * bench.lens.every))
        _, angle, _ = bench.follow(found.base)
        orders = np.arange(0.5, min(60.0, 2 * np.pi * 2 * bench.lens.cutoff / bench.scene.speed), 0.1)
        q = bench.lens.pick(angle)[bench.usable]
        return {
            "time": np.arange(y.size) * dt, "measured": y, "runs": runs, "held": held_out(bench),
            "gap_time": np.arange(d0.size) * dt * bench.lens.every, "gap_before": d0, "gap_after": d1,
            "usable": bench.usable, "floor": bench.floor(), "frequency": f, "spectrum": (a0, a1), "orders": orders,
            "order_spectrum": tuple(order_spectrum(d[bench.usable], q, orders) for d in (d0, d1)),
            "axes": self.axes(bench, found.base), "units": self.units, "what": self.gap_word,
        }  # fmt: skip

    def export(self, model: Any) -> Any:
        """The repaired `ServoAxis`."""
        from whsklearn.systems.servo import ServoAxis
        from whsklearn.systems.servo_parts import Drive

        law = [t.kind.effect(np.array(t.q)) for t in model.terms[: model.n_base]]
        effects = [t.kind.effect(np.array(t.q)) for t in model.added]
        return ServoAxis(
            inertia=model.inertia,
            law=law,  # type: ignore[arg-type]
            effects=tuple(effects),
            drive=Drive(delay=max(0.0, model.timing) * model.scene.dt),
            sample_rate=1.0 / model.scene.dt,
        )


def _misfit(bench: Bench, model: Any) -> float:
    """Mean square of the innovation, finite for a model that runs away."""
    e = bench.record.position - bench.follow(model)[0]
    return float(np.mean(np.clip(np.nan_to_num(e, nan=1e6), -1e6, 1e6) ** 2))


def law_names(law: str | None, default: str) -> tuple[str, ...]:
    """Names of a law given as text."""
    names = tuple(n.strip() for n in (default if law is None else law).split(",") if n.strip())
    if not names:
        raise ValueError("The friction law is empty; name at least one term, such as viscous.")
    return names


def make_line(model: Any, log: Any, y: Any, *, law: str | None, tolerance: float, columns: dict[str, Any]) -> Any:
    """The line for a kind of model.

    Raises
    ------
    ValueError
        If the kind is not known.
    """
    from whsklearn.systems.servo import ServoAxis
    from whsklearn.systems.wiener_hammerstein import WienerHammersteinSystem

    if isinstance(model, ServoAxis) or model == "servo":
        if isinstance(model, ServoAxis) and law is None:
            law = ",".join(t.name for t in model.law.terms)
        record = log if isinstance(log, ServoRecord) else ServoRecord.from_frame(pd.DataFrame(log), **columns)
        names = law_names(law, "viscous,coulomb")
        _known_terms(names)
        return ServoLine(record, names, model if isinstance(model, ServoAxis) else None, tolerance)
    if isinstance(model, WienerHammersteinSystem) or model == "wiener-hammerstein":
        from whsklearn.gap.blocks.line import BlockLine, sampling_time

        dt = sampling_time(log, columns.get("time"))
        return BlockLine(model, *_input_output(log, y, columns), law=law, tolerance=tolerance, dt=dt)
    if all(hasattr(model, name) for name in ("simulate", "refit", "with_effect")):
        from whsklearn.gap.simulator_line import SimulatorLine

        return SimulatorLine(model, log, tolerance=tolerance)
    raise ValueError(
        f"model is {model!r}; expected 'servo', 'wiener-hammerstein', a ServoAxis, a WienerHammersteinSystem, or an "
        "object with simulate, refit and with_effect."
    )


def _input_output(log: Any, y: Any, columns: dict[str, Any]) -> tuple[Array, Array]:
    """u and y, shape (n,) each, from a frame with named columns or from arrays."""
    if y is not None:
        u, v = np.asarray(log, dtype=float), np.asarray(y, dtype=float).reshape(-1)
        if u.ndim == 2 and u.shape[1] != 1:
            raise ValueError(f"The input has {u.shape[1]} columns; the gap workflow takes one input and one output.")
        if u.size != v.size:
            raise ValueError(f"{u.size} samples of the input and {v.size} of the output; give as many of each.")
        return u.reshape(-1), v
    frame = pd.DataFrame(log)
    picked = []
    for role in ("input", "output"):
        column = columns.get(role) or {"input": "u", "output": "y"}[role]
        if column not in frame.columns:
            have = ", ".join(map(str, frame.columns))
            raise ValueError(f"The log has no column {column!r} for the {role}; it has {have}. Name the right one.")
        picked.append(pd.to_numeric(frame[column], errors="coerce").to_numpy(dtype=float))
    return picked[0], picked[1]


def _known_terms(names: tuple[str, ...]) -> None:
    from whsklearn.gap.candidates import candidate

    for name in names:
        if candidate(name).linear != 1:
            raise ValueError(f"{name!r} cannot stand in the base law of an axis; expected friction such as coulomb.")
