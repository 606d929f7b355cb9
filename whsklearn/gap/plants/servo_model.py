"""An axis that can be refitted: inertia, timing and a list of terms as one vector of free numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from whsklearn.effects import EarlyReversal, Effect, Scales
from whsklearn.effects import codes as k
from whsklearn.effects.own import WHICH, address_of
from whsklearn.gap.plant import FittedTerm, WithTerms, with_vectors
from whsklearn.gap.plants.servo_candidates import ColumnSignals
from whsklearn.gap.record import Array
from whsklearn.lags.axis_rows import DRY
from whsklearn.systems._servo_kernel import (
    LOAD,
    LOAD_VELOCITY,
    MEASURED,
    POSITION,
    VELOCITY,
    AxisNumbers,
    How,
    bare_parts,
    follow,
)

# Factor below the inertia of the first regression and above that or the model's own, whichever is larger; fits further
# away had diverged. A regression without the gravity that is there finds far too little where J a and G sin q cancel.
WIDEST = 5.0
LARGEST = 10.0  # largest effect in multiples of the rms drive; larger ones only cancel each other
LONGEST_STEP = 1.001e-3  # s of a fine step; the extra thousandth allows for the rounding of 1 / 1000
FASTEST_COUPLING = 90.0  # Hz of the fastest coupling searched for; `Effect.finest` of a transmission is made for it
TIMING_LIMIT = 1.0  # samples; less than one is bookkeeping, not physics
# Samples of age that a drive held over a sample has on average: inverse dynamics counts it, a simulation holds anyway.
HOLD = 0.5
# Models whose solution, and where their runs restart, are kept: of 1,741 calls 520 ask again for one of the last
# eight, 586 for any before.
MODELS_KEPT = 8
INSIDE = 1e-3  # of a share: how far inside its range a fit along the run starts where inverse dynamics left it


@dataclass(frozen=True)
class ServoTerm(FittedTerm):
    """A candidate (`whsklearn.gap.plants.servo_candidates.Candidate`) with its numbers."""


@dataclass(frozen=True)
class ServoHypothesis(WithTerms):
    """J a = u - sum of terms, where the drive is ``timing`` samples old when it acts."""

    inertia: float
    timing: float
    terms: tuple[ServoTerm, ...]
    scene: Scales
    n_base: int = 0  # leading terms that are the base model's
    step: float = LONGEST_STEP  # s, the largest fine step; a view may have found that a longer one is as good
    # how dry friction reverses, if not at once (`EarlyReversal`), and the speed (rad/s) over which it does
    early: EarlyReversal | None = None
    creep: float = 0.0

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects that a simulation needs beside the law."""
        return (*([self.early] if self.early else []), *(t.effect for t in self.added))

    def reversing(self, term: ServoTerm, motion: ColumnSignals) -> ColumnSignals:
        """The signals whose velocity has the sign of a term's torque, as `RigidBodyLags` has it for arms."""
        if self.early is None or not issubclass(term.kind.cls, DRY):
            return motion
        return motion._replace(
            velocity=(motion.velocity + self.early.lead * motion.acceleration) / self.creep, kappa=1.0
        )

    def at_the_end(self, index: int) -> str:
        """A sentence if a shape number that makes a term what it is is at the end of its range; empty if not."""
        kind, (low, high) = self.terms[index].kind, self.bounds()
        asked = (*kind.fields[kind.linear : kind.linear + 1], *kind.cls.essential)
        for value, a, b, (i, j, _) in zip(self.vector()[2:], low[2:], high[2:], self.free(), strict=True):
            if i == index and kind.fields[j] in asked:
                quantity = kind.cls.quantities[kind.fields[j]]
                below = value <= a + 1e-6 * abs(a) and not quantity.open_below
                if below or (value >= b - 1e-6 * abs(b) and not quantity.open_above):
                    return f"its {kind.fields[j]} reaches the limit of the plausible range"
        return ""

    def has_inertia(self, fitted: ServoHypothesis) -> bool:
        """Whether a model fitted from this one has an inertia inside the range that the fit had."""
        low, high = (np.exp(limit[0]) for limit in self.bounds())
        return bool(1.001 * low < fitted.inertia < high / 1.001)

    @property
    def has_curves(self) -> bool:
        """Whether the model has torques that were learned as curves."""
        return any(t.name == "learned_torque" for t in self.terms)

    @property
    def load_side(self) -> bool:
        """Whether the encoder is behind the coupling."""
        return any(t.kind.on_load for t in self.terms)

    @property
    def has_play(self) -> bool:
        """Whether the model has backlash, whose impacts make every cost function rough."""
        return any(t.kind.code == k.BACKLASH for t in self.terms)

    # --- one vector of free numbers -------------------------------------------------------
    def free(self) -> list[tuple[int, int, bool]]:
        """(term, slot, whether its logarithm is used) of every free number after J and timing."""
        return [(i, j, t.kind.ratios(j)) for i, t in enumerate(self.terms) for j in t.free]

    def vector(self) -> Array:
        """Free numbers: log J, timing, then those of the terms."""
        return np.array([np.log(self.inertia), self.timing, *(x for t in self.terms for x in t.vector())])

    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper limits of `vector`."""
        late = any(t.kind.name == "input_delay" for t in self.terms)  # then the delay is the timing
        limit = 1e-9 if late else TIMING_LIMIT
        low = [np.log(self.scene.inertia / WIDEST), -limit]
        high = [np.log(max(self.scene.inertia, self.inertia) * WIDEST), limit]
        for i, j, logarithm in self.free():
            kind = self.terms[i].kind
            shape = j - kind.linear
            if shape < 0:
                # dry and viscous friction dissipate energy; a base law that supplies some comes from a diverging fit
                # around its own size, too: a spring on which an axis swings freely holds far more than the drive
                most = LARGEST * max(kind.size_unit(self.scene), abs(self.terms[i].q[j]))
                low.append(0.0 if kind.positive and i < self.n_base else -most)
                high.append(most)
            else:
                a, b = kind.ranged(self.scene)[shape]
                low.append(np.log(a) if logarithm else a)
                high.append(np.log(b) if logarithm else b)
        return np.array(low), np.array(high)

    def with_vector(self, x: Array) -> ServoHypothesis:
        """The model at other free numbers."""
        inertia, timing, terms = float(np.exp(x[0])), float(x[1]), with_vectors(self.terms, x[2:])
        return replace(self, inertia=inertia, timing=timing, terms=terms)

    def steps(self) -> Array:
        """Increments for numerical derivatives, about 0.3 % of the torque each.

        With play they are ten times as wide: the cost is a valley with ripples, one for every impact that comes a
        sample earlier or later, and a narrow difference sees only the ripples.
        """
        s = self.scene
        out = [0.003, 0.05]
        for i, j, logarithm in self.free():
            kind = self.terms[i].kind
            if j < kind.linear:
                out.append(0.003 * kind.size_unit(s))
            else:
                out.append(0.003 if logarithm else 0.003 * kind.spread(j - kind.linear, s))
                if kind.scanned in ("position", "time"):
                    span = 2 * s.reach if kind.scanned == "position" else 2 * np.pi * s.duration
                    out[-1] = 0.02 / (span * max(abs(self.terms[i].q[j]), 1e-9))
                elif kind.scanned == "step":
                    out[-1] = 0.004
        return np.array(out) * (10.0 if self.has_play else 1.0)

    # --- running -------------------------------------------------------------------------
    def plant(self) -> AxisNumbers:
        """Codes and numbers in the form that the compiled pass takes."""
        own = list(dict.fromkeys(t.kind.cls for t in self.terms if t.kind.code >= k.USER_TORQUE))
        p = np.zeros((len(self.terms), k.N_NUMBERS))
        for row, t in zip(p, self.terms, strict=True):
            row[: len(t.q)] = t.q
            if t.kind.code >= k.USER_TORQUE:
                row[WHICH] = own.index(t.kind.cls)
        parts = bare_parts(self.inertia, self.timing * self.scene.dt, on_load=self.load_side)
        codes = np.array([t.kind.code for t in self.terms], dtype=np.int64)
        if self.early is not None:
            row = np.pad(self.early.row, (0, k.N_NUMBERS - len(self.early.row)))
            codes, p = np.append(codes, k.EARLY_REVERSAL), np.vstack([p, row])
        return AxisNumbers(codes, p, parts, address_of(tuple(own)))

    @property
    def longest_step(self) -> float:
        """Largest fine step (s) at which a run is accurate.

        A coupling needs a number of steps per period, and no record shows one much faster than its scales allow.  At a
        sampling rate of 50 Hz, a period of 100 ms in steps of an eighth of a millisecond took eight times as long and
        gave the same digits.
        """
        slower = max(1.0, FASTEST_COUPLING / self.scene.resonance)
        finest = (1.001 * t.kind.cls.finest * (slower if t.kind.cls.port == "block" else 1.0) for t in self.terms)
        return min([self.step, *finest])

    def follow(
        self,
        drive: Array,
        position: Array,
        gains: tuple[float, float],
        *,
        start: tuple[Array, Array],
        reset_every: int = 0,
        twist: Array | None = None,
        pieces: Sequence[tuple[slice, float]] = (),
    ) -> tuple[Array, Array, Array, Array]:
        """Predicted position, angle, velocity and twist (see `whsklearn.systems._servo_kernel.follow`).

        The run restarts in each of the ``pieces``, given by its samples and the time of the first one.
        """
        if len(pieces) > 1:
            known = twist is not None and len(twist) > 0
            runs = [
                self.follow(
                    drive[s], position[s], gains, start=(start[0][s], start[1][s]), reset_every=reset_every,
                    twist=twist[s] if known else None, pieces=[(s, t)],  # type: ignore[index]
                )
                for s, t in pieces
            ]  # fmt: skip
            q, angle, speed, twists = (np.concatenate(parts) for parts in zip(*runs, strict=True))
            return q, angle, speed, twists
        dt = self.scene.dt
        substeps = int(np.ceil(dt / self.longest_step))
        measured = [position if max(gains) > 0.0 else start[0], start[1]]
        if twist is not None and len(twist) > 0:
            measured += [twist[:, 0], twist[:, 1]]
        how = How(dt, substeps, every=reset_every, gains=gains, start=pieces[0][1] if pieces else 0.0)
        out = follow(self.plant(), drive, np.array(measured), how, start=(start[0][0], start[1][0]))
        twists = np.zeros((drive.size, 2))
        if any(t.kind.cls.port == "block" for t in self.terms):  # a single body has no twist, and most runs are of one
            with np.errstate(invalid="ignore", over="ignore"):  # a run may diverge; the caller checks y_hat
                np.subtract(out[POSITION], out[LOAD], out=twists[:, 0])
                np.subtract(out[VELOCITY], out[LOAD_VELOCITY], out=twists[:, 1])
        return out[MEASURED], out[POSITION], out[VELOCITY], twists
