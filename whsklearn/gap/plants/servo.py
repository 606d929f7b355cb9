"""A servo axis as a plant: drive in, position out. The controller need not be known.

Inverse dynamics on the measured motion finds the missing effects; free runs prove them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from copy import copy
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import Stribeck, effect_names, get_effect
from whsklearn.effects.base import ArgumentError, rms
from whsklearn.effects.surroundings import chatters
from whsklearn.gap.calibration import gain
from whsklearn.gap.data_check import DataProblem, check_servo
from whsklearn.gap.diagnosis import Curve, NamedEffect
from whsklearn.gap.filters import whiteness
from whsklearn.gap.localisation import since_reversal, spectra
from whsklearn.gap.nameless import ORDERS
from whsklearn.gap.pictures import DRAWN
from whsklearn.gap.plant import PAYS, QUIET, Figures, Gap, Linearised, Plant, Reading, Told, quiet
from whsklearn.gap.plants import (
    servo_families,
    servo_learned,
    servo_own,
    servo_run,
)
from whsklearn.gap.plants import servo_stop as stop
from whsklearn.gap.plants import servo_two_mass as two_mass
from whsklearn.gap.plants.from_log import servo_record
from whsklearn.gap.plants.servo_candidates import TWO_MASS, UNSEEN, aliases, candidate
from whsklearn.gap.plants.servo_families import highest_order, next_order, polished, widened
from whsklearn.gap.plants.servo_families import settled as looking_settled
from whsklearn.gap.plants.servo_inverse import PER_NUMBER, InverseView, surroundings, unphysical
from whsklearn.gap.plants.servo_model import HOLD, WIDEST, ServoHypothesis
from whsklearn.gap.plants.servo_run import ObserverView
from whsklearn.gap.plants.servo_sensors import coarse_encoder, unfold
from whsklearn.gap.plants.servo_start import (
    best_view,
    logged_late,
    observer_view,
    reversing_early,
    start_of,
    with_earlier_drive,
)
from whsklearn.gap.record import SPLIT, Array, ServoRecord
from whsklearn.gap.search import HALF, LEAST_SHARE, SAME
from whsklearn.gap.standard_errors import covariance
from whsklearn.logs.current import DRIVEN_BY
from whsklearn.logs.units import inertia_unit

OVER_LITTLE_TRAVEL = {"input_offset": ("gravity_imbalance",), "asymmetric_coulomb": ("gravity_imbalance",),
                      "cable_spring": ("gravity_imbalance",), "gravity_imbalance": ("cable_spring",)}  # fmt: skip

# Ratio to the previous cut-off that is worth a second pass of inverse dynamics; with every change of it, KR300 A gets a
# limit of its drive that is not there (`benchmarks.real_axes`).
WIDER = 1.25
# rad of travel below which the cosine of gravity is a constant and a slope to within 3 %, so that names are shared.
LITTLE_TRAVEL = 0.5
FASTER = (
    "Log at the rate of the controller, or log the mean of the drive over a row: this drive changes from row to row, "
    "and what acted between the rows is unknown."
)


class ServoPlant(Plant):
    """A rigid axis with logged drive and position.

    ``law``: friction terms of the base model. ``given_model``: returned if nothing can be diagnosed.
    """

    inverse: InverseView
    observer: ObserverView
    whole = "drive"
    headline = servo_run.LONGEST_RUN
    horizons = servo_run.horizons_around(headline)

    def __init__(self, record: ServoRecord, law: tuple[str, ...], given_model: Any, tolerance: float):
        self.record, self.law, self.given_model, self.tolerance = record, law, given_model, tolerance
        self.units, self.own_units, self.logged = record.units, record.shown, record.logged
        self.gap_word = f"missing {DRIVEN_BY.get(record.units[0], 'drive')}"
        self.scale = rms(record.drive) if len(record) else 0.0
        self._folded: tuple[ObserverView, ServoHypothesis] | None = None
        self.lead = 0.0
        self.sharp = False  # whether waves are looked for where single samples are noise

    def check(self) -> list[DataProblem]:
        """See `whsklearn.gap.data_check.check_servo`."""
        return check_servo(self.record)

    # --- models and views -------------------------------------------------------------------
    def base(self, rng: np.random.Generator) -> ServoHypothesis:
        """The base model, fitted; a reading whose sign was lost is unfolded first."""
        base = self._open(self.record)
        straight = unfold(self.record.position, self.record.dt)
        if straight is not None:
            # |q| is also that of -q, with which the drive would gain the energy that friction takes
            straight *= np.copysign(1.0, self.record.drive @ np.gradient(straight))
            given = self.record, self.inverse, self.observer, base
            unfolded = self._open(dataclasses.replace(self.record, position=straight))
            if servo_run.misfit(self.observer, unfolded) < HALF * servo_run.misfit(given[2], base):
                self._folded = (given[2], base)
                return unfolded
            self.record, self.inverse, self.observer, base = given
        return base

    def _open(self, record: ServoRecord) -> ServoHypothesis:
        """Set up both views of a record; return its base model."""
        self.record = record
        self.inverse, base = start_of(record, self.law, self.tolerance)
        self.observer = observer_view(self.inverse, base.scene, tolerance=self.tolerance).coarsened(base)
        return base

    def made(self, model: ServoHypothesis, rng: np.random.Generator) -> ServoPlant:
        """The plant of a record that the model itself makes in the same experiment."""
        ideal = servo_own.needed(self.inverse, model)
        record = servo_own.own_record(self.inverse, model, rng, self.record.drive, model.timing * self.record.dt, ideal)
        noise = self.inverse.drive_noise(self.inverse.gap(model)) * rng.standard_normal(len(record))
        record = dataclasses.replace(record, drive=record.drive + noise)
        other = ServoPlant(record, self.law, None, self.tolerance)
        other.observer = dataclasses.replace(self.observer, record=record)
        return other

    def to_simulate(self, model: ServoHypothesis) -> ServoHypothesis:
        """Choose the numbers with the best free run: as found, corrected by own records, or refitted along the run.

        The horizon of the proof is chosen first, and the three are compared at it, each with and without the half
        sample of age that a held drive has in inverse dynamics.  Over a longer one, at which no model of this record
        can be simulated, a pendulum without inertia had the smaller drift (XL330 10h28m24).  A stop is fitted along the
        run too: with the numbers of inverse dynamics it had half a sample of damping, which is the hold's.
        """
        self.headline, self.horizons = self._horizons(model)
        sides = (True, False) if model.has_play else ()
        tried = [model, *(m for side in sides for m in self._by_run(model, "backlash", on_load=side))]
        others = [self.observer.fit(m) for m in two_mass.splits_of_friction(model)]
        if [t.name for t in self.corrected.terms] == [t.name for t in model.terms]:
            others.append(self.corrected)
        # a body that friction alone holds stays near any path; it asks for more drive than reaches it
        tried += [m for m in others if rms(self.inverse.left(m)) < self.scale / self.inverse.target(m)[1]]
        # a fit that ends with no inertia, or with far too much, has failed
        kept = [m for m in tried if model.has_inertia(m)] or self.inverse.of_differences(model) or tried
        # The noise of the drive's reading makes a fit along the run too sluggish, and inverse dynamics counts the hold.
        kept = [dataclasses.replace(m, timing=m.timing - hold) for m in kept for hold in (0.0, HOLD)]
        return min([*kept, *self._evolved(kept)], key=lambda m: servo_run.train_error(self.observer, m, self.headline))

    def _evolved(self, tried: list[ServoHypothesis]) -> list[ServoHypothesis]:
        """What a search finds around the model with a play that leaves least near the record, if that is not noise.

        Runs that restart tell the starts of such a search less well: one with a contact of 8 Hz in place of 74 Hz had
        half the error of one from which the search reached the play.
        """
        view, plays = self.observer, [m for m in tried if m.has_play]
        if not plays:
            return []
        start = min(plays, key=lambda m: view.rms(view.gap(m), fitted=True))
        done = quiet(view.rms(view.gap(start), fitted=True), view.floor, self.tolerance * self.scale)
        return [] if done else [servo_run.evolved(view, start)]

    def contributes(self, base: ServoHypothesis, model: ServoHypothesis) -> bool:
        """Whether the effects take `LEAST_SHARE` of the power of the torque that the free runs lack.

        Over a short horizon h a missing torque tau displaces an axis by tau h^2 / (2 J).  Where a slow force is
        missing, the base model compensates with an inertia that is far too large.  Such a sluggish axis leaves the
        path slowly whatever torque is missing, so a correct repair need not follow the path any better.
        """
        y, held = self.measured()
        after, before = (m.inertia * rms((y - self.simulate(m, self.headline))[held]) for m in (model, base))
        return after**2 < (1.0 - LEAST_SHARE) * before**2

    def retold(self, model: ServoHypothesis) -> ServoHypothesis:
        """A play seen from the load in the place of a coupling, if it halves the error of the free run.

        To first order the one is steps of a second derivative of the drive and the other that derivative itself, which
        is also all that a wide play leaves behind the filter.
        """
        if not model.load_side or model.has_play:
            return model
        error = partial(servo_run.train_error, self.observer, horizon=self._horizons(model)[0])
        best, view = min((model, *self._by_run(model, "flexible_coupling")), key=error), self.observer
        if quiet(view.rms(view.gap(best)), view.floor, self.tolerance * self.scale):
            return model
        return next((m for m in self._by_run(model, "backlash") if error(m) < HALF * error(best)), model)

    def _by_run(self, model: ServoHypothesis, name: str, *, on_load: bool = True) -> list[ServoHypothesis]:
        """The model with the transmission ``name`` found along the run; empty if that drops it.

        Inverse dynamics takes the measured motion to be the motor's; its form for the load side is only first order.
        """
        i = next(i for i, t in enumerate(model.terms) if t.kind.code in TWO_MASS)
        rest = self.observer.fit(model.without(i))
        fitted = servo_run.with_load(self.observer, rest, dataclasses.replace(candidate(name), on_load=on_load))
        terms = fitted.terms
        return [fitted.with_terms((*terms[:i], terms[-1], *terms[i:-1]))] if len(terms) == len(model.terms) else []

    def _runs_worse(self, before: ServoHypothesis, after: ServoHypothesis) -> bool:
        """Whether a limit or a gain makes the free run worse.

        If it removes nearly all of the drive, it "explains" a target that it has itself made small, with almost no
        inertia.  An effect that adds to the drive or delays it does not change the target, and a lag is judged by the
        drive before it, so what these explain is really explained.
        """
        kind = after.terms[-1].kind
        if kind.delays or not (kind.transforms or kind.driven) or not self._weighs(before):
            return False
        if not self._weighs(after):
            return True
        horizon, _ = self._horizons(after)
        # With numbers fitted along it, except a limit, which would leave the drive: with those of inverse dynamics a
        # true friction by the load ran 27 % farther off, where its own run has a thirtieth of the base model's error.
        ways = ((m,) if kind.transforms else (m, self.observer.fit(m)) for m in (before, after))
        old, new = (min(servo_run.train_error(self.observer, m, horizon) for m in way) for way in ways)
        return not new <= old < np.inf  # they are equal if the drive reaches its limit in held-out samples only

    def _weighs(self, model: ServoHypothesis) -> bool:
        """Whether inertia is a considerable share of the drive that reaches the axis; else a free run shows nothing."""
        acceleration = np.gradient(self.inverse.motion.velocity, self.inverse.scene.dt)
        return model.inertia * rms(acceleration) > self.tolerance * self.scale / self.inverse.target(model)[1]

    def _horizons(self, model: ServoHypothesis) -> tuple[float, tuple[float, ...]]:
        """(headline, all) horizons at which this model can be simulated (`servo_run.predictable`)."""
        made = self.made(model, np.random.default_rng(0))
        longest = servo_run.horizon_of(model, model.scene, self.tolerance)
        headline = servo_run.predictable(made.observer, model, longest)
        return headline, servo_run.horizons_around(headline)

    def learn(self, model: ServoHypothesis) -> tuple[ServoHypothesis, tuple[Curve, ...]] | None:
        """Learn curves in the inverse view; the age of the drive is the one with the best free run on fitted samples.

        Inverse dynamics counts half a sample of age for the hold, which a simulation includes anyway.
        """
        found = servo_learned.learn(self.inverse, model)
        if found is None:
            return None
        grown, curves = found
        tried = [dataclasses.replace(grown, timing=age) for age in (model.timing, grown.timing - HOLD, grown.timing)]
        return min(tried, key=lambda m: servo_run.train_error(self.observer, m, self.headline)), curves

    def reading(self, base: ServoHypothesis, model: ServoHypothesis) -> Reading:
        """A lost sign, with the record as given; or a coarse encoder grid, if the missing torque shows no effect."""
        if self._folded is None:
            return Reading([] if model.added else coarse_encoder(self.observer, self.observer.fit(model)))
        observer, folded = self._folded
        other = ServoPlant(observer.record, self.law, None, self.tolerance)
        other.observer = observer
        effect = get_effect("sensor_rectification")(fraction=1.0)  # type: ignore[call-arg]
        named = NamedEffect(effect, {}, float(len(self.record)), 1.0)
        return Reading([named], given=(other, folded))

    def aliases(self, name: str) -> tuple[str, ...]:
        """Names that no record of drive and position can distinguish from ``name``."""
        also = OVER_LITTLE_TRAVEL.get(name, ()) if float(np.ptp(self.record.position)) < LITTLE_TRAVEL else ()
        return tuple(dict.fromkeys([*aliases(name), *(a for a in also if self.units[1] == "rad")]))

    def linearised(self, model: ServoHypothesis) -> Linearised:
        """Residual and derivatives of inverse dynamics."""
        return self.inverse.linearised(model)

    # --- the search ---------------------------------------------------------------------------
    def looks(
        self, model: ServoHypothesis, rng: np.random.Generator, beside: ServoHypothesis | None = None
    ) -> list[Any]:
        """Look at every candidate beside the model, in the record and in the model's own records.

        If ``beside`` is given, the model is ``beside`` without one of its effects.
        """
        self.own, self.corrected = servo_own.own(self.inverse, model, rng)
        self.inverse.own = self.own
        self.n_effective = self.own.n_effective
        return servo_families.looks(
            self.inverse, self.inverse.fit(model), self.own, self.tolerance * self.scale, beside, waves=self.sharp
        )

    def explained(self, model: ServoHypothesis, grown: ServoHypothesis, look: Any) -> tuple[float, float]:
        """(gain, size) of a fitted effect, in the direction of regression in which it was found."""
        before = self.errors(model)
        if not look.swapped:
            after = self.inverse.taken_off(grown) * self.errors(grown)
            return gain(float(before @ before), float(after @ after), self.n_effective), self.size(before, after)
        g, share = servo_families.explained_acceleration(self.inverse, model, grown)
        return g, max(self.size(before, self.errors(grown)), self.rms(before) * float(np.sqrt(share)))

    def refine(self, model: ServoHypothesis, look: Any) -> ServoHypothesis:
        """The candidate with its shape polished and sizes solved for; held numbers are freed if the gain is enough."""
        grown = polished(self.inverse, model, look.start)
        for other, n_numbers in self._wider(model, grown, look.start):
            before, after = (rms(self.inverse.gap(m)) ** 2 for m in (grown, other))
            if gain(before, after, self.n_effective) > PAYS * n_numbers:
                grown = other
        return grown

    def _wider(
        self, model: ServoHypothesis, grown: ServoHypothesis, start: Any
    ) -> Iterator[tuple[ServoHypothesis, int]]:
        """The model with numbers freed that a first look holds: an effect's later ones, or an order that was whole."""
        wider = widened(self.inverse, grown)
        if wider is not None:
            yield wider, len(wider.terms[-1].kind.later)
        if start.kind.scanned == "position" and float(start.q[2]).is_integer():
            yield polished(self.inverse, model, start.with_slot(2, start.q[2] * (1.0 + 1e-6))), 1

    def family(self, model: ServoHypothesis) -> Iterator[ServoHypothesis]:
        """The model with one more order of its last term's family at a time, as long as each is justified.

        A family has no more waves than the nameless functions of a turn (`ORDERS`).
        """
        last = model.terms[-1]
        if not (last.kind.cls.repeats and last.kind.scanned == "position"):
            return
        for _ in ORDERS[1:]:
            grown = next_order(self.inverse, model, last.kind)
            if grown is None:
                return
            before, after = (rms(self.inverse.gap(m)) ** 2 for m in (model, grown))
            least = self.tolerance * self.scale
            if gain(before, after, self.inverse.n_effective) < 3.0 * PAYS or before - after < least**2:
                return
            model = grown
            yield grown

    def settled(self, model: ServoHypothesis) -> ServoHypothesis:
        """The model fitted behind the filter that its gap allows, with shapes polished without the filter's artefacts.

        A drive that was logged after it had acted is moved back first.
        """
        late = logged_late(self.inverse, model)
        if late:
            self.lead += late * self.record.dt
            self._open(with_earlier_drive(self.record, late))
        self.inverse.own = None
        other = best_view(self.inverse, model, self.tolerance, sharp=self.sharp)
        if not 1.0 / WIDER < other.cutoff / self.inverse.cutoff < WIDER:
            self.inverse = other
        model = self.inverse.fit(reversing_early(self.inverse, model))
        if model.added:  # with the artefacts of the previous model, the fit of a Stribeck curve is too wide
            self.inverse.own = servo_own.own(self.inverse, model, np.random.default_rng(0))[0]
            model = looking_settled(self.inverse, self.inverse.fit(model))
        return self._around(model)

    def _around(self, model: ServoHypothesis) -> ServoHypothesis:
        """The model with the range of its inertia around its own, if that has left the range and is known to its width.

        A base model without the limit of a drive that is nearly always reached had seven times the inertia.
        """
        if model.has_inertia(model):
            return model
        error = float(np.sqrt(covariance(self.inverse.linearised(model))[0, 0]))
        if not 0.0 < error < np.log(WIDEST):
            return model
        return dataclasses.replace(model, scene=dataclasses.replace(model.scene, inertia=model.inertia))

    def along_the_run(self, model: ServoHypothesis) -> ServoHypothesis:
        """The model with numbers fitted along its own run, if they also reduce the residual of inverse dynamics.

        A strong effect changes how long the axis sticks.  Shapes fitted with the artefacts of a model without it may
        end in another local minimum.
        """
        view, before = self.inverse, self.rms(self.errors(model))
        if before <= QUIET * view.own.floor or stop.holds(model) or model.has_play:
            return model
        other = self.observer.fit(model)
        found, _ = servo_own.own(view, other, np.random.default_rng(0))
        view.own, kept = found, view.own
        other = looking_settled(view, view.fit(other))
        if self.rms(self.errors(other)) < (1.0 - SAME) * before:
            return other
        view.own = kept
        return model

    def told_by_run(self, model: ServoHypothesis, rivals: list[str]) -> tuple[ServoHypothesis, list[str]]:
        """A lag in the place of a delay, or the reverse, if it leaves less in a free run.

        The other is a rival if, and only if, neither leaves half the power of the other's error.  Inverse dynamics
        compares them by the drive before the lag, where the noise of the encoder is larger by the lag over the width of
        the filter, and so are errors about when the axis stuck: a delay of 10 ms left less than the lag of 12 ms that
        made the record, whose run has a twentieth of its error.
        """
        for i, t in enumerate(model.terms):
            for name in t.effect.aliases if t.kind.delays else ():
                swapped = model.replaced(i, dataclasses.replace(t, kind=candidate(name)))
                horizon, _ = self._horizons(model)
                one, two = (self.observer.fit(m) for m in (model, swapped))
                power = [servo_run.train_error(self.observer, m, horizon) ** 2 for m in (one, two)]
                decided, better = min(power) < HALF * max(power), power[1] < power[0]
                rest = rivals
                if i == len(model.terms) - 1:  # otherwise they are another effect's
                    rest = [r for r in rivals if r not in (name, t.name)]
                    rest += [] if decided else [t.name if better else name]
                return (self.settled(two) if better else model), rest
        return model, rivals

    def sharpened(self, model: ServoHypothesis) -> bool:
        """Whether a higher cut-off still shows a wave worth naming, though not in single samples; it is used then."""
        other = best_view(self.inverse, model, self.tolerance, sharp=True)
        if other.cutoff < WIDER * self.inverse.cutoff:
            return False
        self.sharp = True
        return True

    def snapshot(self) -> dict[str, Any]:
        """A search also changes what the present view knows of own records."""
        return super().snapshot() | {"inverse": copy(self.inverse)}

    def errors(self, model: ServoHypothesis) -> Array:
        """Residual of the model at the judged samples."""
        return self.inverse.gap(model)

    def complete(self, before: Array, model: ServoHypothesis) -> bool:
        """An axis has one place: see `silent`."""
        return self.silent(model)

    def silent(self, model: ServoHypothesis) -> bool:
        """Whether a model leaves no more than noise and what is not worth naming.

        The noise of own records is that of the encoder times the inertia, and that of a base model which compensates
        for a slow force is far too large: a spring was certain in the place of a pendulum's gravity.
        """
        floor = self.own.floor * min(1.0, model.inertia / self.corrected.inertia)
        return bool(quiet(self.rms(self.errors(model)), floor, self.tolerance * self.scale))

    def too_little(self, model: ServoHypothesis) -> str:
        """A play explains most of what is left, as does what comes beside it; see `half_shown` for waves.

        Impacts correlate a little with everything: beside the cogging of a motor a play of 3 % of the drive bent all
        other numbers along the run, until no name was left.  True plays explain three quarters and more.
        """
        rest = model.without(len(model.terms) - 1)
        if model.has_play and self.size(left := self.errors(rest), self.errors(model)) < HALF**0.5 * self.rms(left):
            beside = " beside the play" if rest.has_play else ""
            return f"it explains too little of the residual{beside}, and impacts correlate a little with everything"
        return self.half_shown(model)

    def half_shown(self, model: ServoHypothesis) -> str:
        """A part of a wave may be any smooth function of the place, as long as something else is missing.

        It was named for the gravity of three joints of an arm, which other joints pull at.  Beside another force over
        the position it corrects what that one has wrong: with a third of a wave, a spring about a wrong centre did what
        it does about its own beside an offset.
        """
        last = model.terms[-1]
        if not last.kind.of_part(last.q, model.scene):
            return ""
        if any(t.effect.place == last.effect.place == "position" for t in model.terms[model.n_base : -1]):
            return "the travel shows less than a period of such a wave, and another force over it does the rest"
        said = "the travel shows less than a period of such a wave, and something else is missing beside it"
        return "" if self.silent(model) else said

    def enough(self, model: ServoHypothesis) -> bool:
        """Whether the record says enough for a name to be certain.

        There are `PER_NUMBER` independent samples for each number, as there are in all but short logs, and friction
        that a Stribeck curve is named for falls with speed somewhere.
        """
        viscous = surroundings(self.inverse, model).size("viscous")
        falls = all(t.effect.falls_beside(viscous) for t in model.terms if isinstance(t.effect, Stribeck))
        return bool(self.inverse.n_effective >= PER_NUMBER * model.vector().size) and falls

    def objection(self, model: ServoHypothesis, grown: ServoHypothesis) -> str:
        """The objection to an effect: a physical one, too many numbers, a worse run."""
        last, view = len(grown.terms) - 1, self.inverse
        if unphysical(view, grown, last) and (said := unphysical(view, grown, last, silent=self.silent(grown))):
            return said
        if grown.vector().size > self.inverse.n_effective:
            return "with it the model has more numbers than the record has independent samples"
        return "the simulation runs farther from the record with it" if self._runs_worse(model, grown) else ""

    # --- proof --------------------------------------------------------------------------------
    def simulate(self, model: ServoHypothesis, horizon: float) -> Array:
        """See `whsklearn.gap.plants.servo_run.restarted_run`."""
        return servo_run.restarted_run(self.observer, model, horizon)

    def measured(self, *models: ServoHypothesis) -> tuple[Array, NDArray[np.bool_]]:
        """Position and the mask of held-out samples without the edges."""
        return self.observer.record.position, servo_run.held_out(self.observer)

    def figures(self, base: ServoHypothesis, model: ServoHypothesis, nameless: float = 0.0) -> Figures:
        """The gap of inverse dynamics in the unit of the drive, as an engineer would compute it.

        The residual of the model's own records, due to filters and noise, is subtracted.  The numbers are solved for,
        because those refitted along the run suit the run; learned curves keep theirs, which are smoothed: solved for
        again, a curve over the model's own torque becomes the drive itself.

        If the model has two masses, the figures come from the observer, and nothing counts as nameless.  Inverse
        dynamics of the load side needs the motor's motion, which nobody measured; an impact that comes a sample early
        or late is a large torque for an instant, but hardly changes the path; and behind a spring with little damping
        a load rings with the noise of the measured motion.
        """
        if any(t.kind.code in TWO_MASS for t in model.terms):
            seen = self.observer
            return Figures(seen.rms(seen.gap(base)), seen.rms(seen.gap(model)), seen.floor, by_run=True)
        view = self.inverse
        if view.own is None:  # the last effect was taken back, and no look has been taken at the residual
            self.own, _ = servo_own.own(view, model, np.random.default_rng(0))
            view.own = self.own
        before, after = (
            view.rms(view.as_learned(m) if m.has_curves else view.fit_with_gap(m)[1]) for m in (base, model)
        )
        return Figures(before, after, self.own.floor, nameless)

    # --- report -------------------------------------------------------------------------------
    def gap(self, model: ServoHypothesis) -> Gap:
        """The gap of inverse dynamics, measured signals, and the numbers of the base model with their columns."""
        view = self.inverse
        columns, _ = view.columns(model, view.torque(model))
        named = zip(self.numbers(model).items(), columns.T, strict=False)
        constants = {k: (v, x[view.at]) for (k, (v, _)), x in named}
        return Gap(view.gap(model), view.step, signals(view, self.units), constants)

    def numbers(self, model: ServoHypothesis) -> dict[str, tuple[float, str]]:
        """Inertia, friction and age of the drive, in SI symbols of drive and position.

        Inertia has its own unit if the drive is a torque or a force.
        """
        drive, position = self.units
        rows = {"inertia": (model.inertia, inertia_unit(drive, position))}
        for t in model.terms[: model.n_base]:
            unit = next(iter(t.effect.quantities.values())).unit.replace("Nm", drive).replace("rad", position)
            rows[t.name] = t.q[0], "" if unit == "1" else unit
        return rows | {"age of the drive (samples)": (round(model.timing, 6), "")}

    def told(self, base: ServoHypothesis, model: ServoHypothesis) -> Told:
        """Whiteness of the residual, remarks, and the series that the page draws."""
        view, both = self.observer, (("before", base), ("after", model))
        view.weigh(0.0)
        tests = [whiteness(view.whitened(view.gap(m)), name) for name, m in both]
        runs = {name: servo_run.restarted_run(view, m, self.headline) for name, m in both}
        drawn = pictures(self.inverse, base, model, self.units, self.gap_word) | {"floor": self.own.floor}
        drawn |= {"runs": runs, "held": servo_run.held_out(view)}
        return Told(tests, self._notes(model), drawn, experiment=FASTER if self._chatters(model) else "")

    def _chatters(self, model: ServoHypothesis) -> bool:
        """Whether the drive changes from row to row, and the model leaves more than noise."""
        return not self.silent(model) and chatters(self.record.drive - self.record.drive.mean())

    def _notes(self, model: ServoHypothesis) -> list[str]:
        """Remarks on how the record was used."""
        view, notes = self.observer, [self.record.in_place_of_drive] if self.record.in_place_of_drive else []
        if self.lead:
            notes.append(
                f"The drive was logged about {1e3 * self.lead:.0f} ms after it had acted, and is used that much "
                "earlier: the clocks of drive and position differ."
            )
        if model.early:
            notes.append(
                f"Dry friction reverses about {1e3 * model.early.lead:.1f} ms before the velocity does, as in a solver "
                "of contacts (MuJoCo: solreffriction); the model includes this (early_reversal)."
            )
        if self._chatters(model):
            notes.append(
                "The drive changes from row to row. If its controller is faster than the log, other values acted "
                "between the rows, and what they add is in the gap."
            )
        return [
            *notes,
            f"Position noise {self.record.told(view.noise, self.units[1])} (from sixth differences); the gap is seen "
            f"up to {view.filter.cutoff:.1f} Hz, where that noise makes {100 * view.floor / self.scale:.2f} % "
            "of the rms drive.",
            "The drive is replayed and an observer holds the model near the measurement, so no controller is needed.",
            SPLIT,
        ]

    def system(self, model: ServoHypothesis) -> Any:
        """The repaired `ServoAxis`."""
        from whsklearn.models import AxisModel
        from whsklearn.systems.servo import ServoAxis
        from whsklearn.systems.servo_parts import Drive

        effects, dt = model.effects, model.scene.dt
        axis = ServoAxis(
            inertia=model.inertia,
            law=[t.effect for t in model.terms[: model.n_base]],  # type: ignore[arg-type]
            effects=effects,
            drive=Drive(delay=max(0.0, model.timing) * dt),
            sample_rate=1.0 / dt,
        )
        # in the steps of the model that is saved and exported, so that both give the same free run
        return dataclasses.replace(
            axis, substeps=AxisModel(axis.inertia, axis.law, effects, dt=dt, logged="position").steps
        )


def servo_plant(model: Any, log: Any, *, law: str | None, tolerance: float, columns: dict[str, Any]) -> ServoPlant:
    """The plant of a log; ``model`` is ``"servo"`` or a `ServoAxis`, whose law becomes that of the base model."""
    given = None if isinstance(model, str) else model
    if given is not None and law is None:
        law = ",".join(t.name for t in given.law.terms)
    record = servo_record(log, columns)
    names = law_names(law, "viscous,coulomb")
    return ServoPlant(record, names, given, tolerance)


def law_names(law: str | None, default: str) -> tuple[str, ...]:
    """Names of a law given as text."""
    names = tuple(n.strip() for n in (default if law is None else law).split(",") if n.strip())
    if not names:
        raise ArgumentError("The friction law is empty; name at least one term, such as viscous.")
    fit = [n for n in effect_names() if n not in UNSEEN and candidate(n).linear == 1]
    for name in names:
        if name not in fit:
            raise ArgumentError(
                f"{name!r} cannot be part of the base law of an axis; expected some of {', '.join(sorted(fit))}."
            )
    return names


def signals(view: Any, units: tuple[str, str]) -> dict[str, tuple[Array, str]]:
    """The signals that the gap may follow, at the judged samples of the inverse view."""
    motion, dt = view.motion, view.scene.dt
    drive, rad = units
    picked = {
        "time": (view.time, "s"),
        "position": (motion.position, rad),
        "velocity": (motion.velocity, f"{rad}/s"),
        "reversal": (since_reversal(motion.velocity, dt, 0.01 * view.scene.speed), "s"),
    }
    if np.ptp(motion.position) > 2 * np.pi:
        picked["angle in the turn"] = (np.mod(motion.position, 2 * np.pi), rad)
    out = {k: (x[:: view.every][view.at], u) for k, (x, u) in picked.items()}
    return out | {"drive": (view.drive[view.at], drive)}


def pictures(view: Any, base: Any, model: Any, units: tuple[str, str], what: str) -> dict[str, Any]:
    """Overlay, gap over time, its spectra by frequency and by order, and its axes."""
    gaps = view.gap(base), view.gap(model)
    highest = max(1.0, min(highest_order(view), 2 * np.pi * 2 * view.cutoff / view.scene.speed))
    orders = np.arange(0.5, highest, max(0.1, highest / DRAWN))
    return {
        "time": view.time, "measured": view.record.position, "gap_time": view.time[:: view.every][view.at],
        "usable": np.ones(gaps[0].size, dtype=bool),
        "axes": signals(view, units), "units": units, "what": what,
        **spectra(*gaps, view.step, view.motion.position[:: view.every][view.at], orders),
    }  # fmt: skip
