"""A servo axis as a plant: drive in, position out, the controller need not be known.

Two views: inverse dynamics while much is missing, an observer once little is; free runs prove.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from whsklearn.effects import get_effect
from whsklearn.gap.data_check import Problem, check_servo
from whsklearn.gap.diagnosis import NamedEffect
from whsklearn.gap.evidence import Evidence
from whsklearn.gap.filters import whiteness
from whsklearn.gap.plant import PlantDefaults
from whsklearn.gap.plants import servo_evidence as rules
from whsklearn.gap.plants import servo_free_run, servo_learned, servo_screening
from whsklearn.gap.plants import servo_stop as stop
from whsklearn.gap.plants.servo_candidates import TWO_MASS, aliases, candidate
from whsklearn.gap.plants.servo_inverse import InverseView
from whsklearn.gap.plants.servo_model import AxisModel
from whsklearn.gap.plants.servo_nameless import explainable
from whsklearn.gap.plants.servo_observer import ObserverView
from whsklearn.gap.plants.servo_pictures import pictures, signals
from whsklearn.gap.plants.servo_sensors import coarse_encoder, unfold
from whsklearn.gap.plants.servo_start import best_view, observer_view, start_of
from whsklearn.gap.record import SPLIT, ServoRecord, rms
from whsklearn.gap.values import Learned, Linearised

Array = NDArray[Any]
HOLD = 0.5  # samples of age that a drive held over a sample has on average
OVER_LITTLE_TRAVEL = {"input_offset": ("gravity_imbalance",), "asymmetric_coulomb": ("gravity_imbalance",),
                      "cable_spring": ("gravity_imbalance",), "gravity_imbalance": ("cable_spring",)}  # fmt: skip


class ServoPlant(PlantDefaults):
    """A rigid axis whose drive and position are logged.

    Parameters
    ----------
    record : ServoRecord
    law : tuple of str
        Friction terms of the base model.
    given_model : object
        What is handed back if nothing can be diagnosed.
    tolerance : float
        Smallest effect worth a name, rms as a share of the rms drive.
    """

    inverse: InverseView
    observer: ObserverView
    whole = "drive"
    horizons: tuple[float, ...] = (0.1, 0.5, 2.0)
    headline = rules.LONGEST_RUN

    def __init__(self, record: ServoRecord, law: tuple[str, ...], given_model: Any, tolerance: float):
        self.record, self.law, self.given_model, self.tolerance = record, law, given_model, tolerance
        self.units = record.units
        self.gap_word = {"Nm": "missing torque", "N": "missing force"}.get(record.units[0], "missing drive")
        self.scale = rms(record.drive) if len(record) else 0.0
        self._folded: tuple[ObserverView, AxisModel] | None = None
        self.behind = False  # whether the encoder was found behind the coupling, where inverse dynamics has no form

    def check(self) -> list[Problem]:
        """See `whsklearn.gap.data_check.check_servo`."""
        return check_servo(self.record)

    # --- models and views -------------------------------------------------------------------
    def base(self, rng: np.random.Generator) -> AxisModel:
        """The base model, fitted; a reading whose sign was lost is unfolded first."""
        base = self._open(self.record)
        straight = unfold(self.record.position, self.record.dt)
        if straight is not None:
            given = self.record, self.inverse, self.observer, base
            unfolded = self._open(dataclasses.replace(self.record, position=straight))
            if servo_free_run.misfit(self.observer, unfolded) < rules.UNFOLDED * servo_free_run.misfit(given[2], base):
                self._folded = (given[2], base)
                return unfolded
            self.record, self.inverse, self.observer, base = given
        return base

    def _open(self, record: ServoRecord) -> AxisModel:
        """Both views of a record, and its base model fitted in the one that is to be trusted."""
        self.record = record
        self.inverse, base = start_of(record, self.law, self.tolerance)
        self.observer = observer_view(record, base.scene, self.inverse.start, tolerance=self.tolerance).coarsened(base)
        return base if self.large(base) else self.observer.fit(base)

    def large(self, model: AxisModel) -> bool:
        """Whether so much is missing that only inverse dynamics shows it."""
        if self.behind:
            return False
        return self.inverse.rms(self.inverse.gap(model)) > rules.LARGE_GAP * float(np.std(self.record.drive))

    def view(self, model: AxisModel, after: Any | None) -> Any | None:
        """Inverse dynamics while much is missing, again behind the filter that its gap allows, then the observer."""
        if after is self.observer:
            return None
        if after is None and not self.behind and (self.large(model) or stop.regions(self.inverse, model)):
            return self.inverse
        if isinstance(after, InverseView):
            self.inverse = after
        if isinstance(after, InverseView) and model.added and self.large(model):
            other = best_view(after, model, self.tolerance)
            if other.cutoff > rules.WIDER * after.cutoff:
                self.inverse = other
                return self.inverse
        if model.added and (self.large(model) or stop.holds(model)):  # a stop's law is too rough to run beside
            return None
        if isinstance(after, InverseView) and model.added:  # the inertia beside what was missing is the true one
            scene = dataclasses.replace(model.scene, inertia=model.inertia)
            self.observer = observer_view(self.record, scene, after.start, tolerance=self.tolerance).coarsened(model)
            if self.lost(model):
                return None
        return self.observer

    def starts_over(self, base: AxisModel, model: AxisModel, view: Any) -> bool:
        """Whether the coupling that inverse dynamics named is seen from behind, and the search must begin anew.

        Inverse dynamics takes the measured motion for the motor's, and no observer changes the side of a term that it
        is given.  So the same name from the load's side is fitted as the observer's own search would fit it, and where
        its free run is better by as much as tells two transmissions apart, all candidates are tried again by the
        observer.  The numbers here are thrown away: this decides which view goes first, and names nothing.
        """
        terms = [t for t in model.added if t.kind.code in TWO_MASS and not t.kind.on_load]
        if self.behind or not isinstance(view, InverseView) or not terms or stop.holds(model):
            return False
        headline, _ = self._horizons(model)
        rigid = self.observer.fit(base)
        other = servo_screening.refined_alone(self.observer, rigid, dataclasses.replace(terms[0].kind, on_load=True))
        own, its = (
            min(servo_free_run.train_error(self.observer, m, headline) for m in models)
            for models in ((model, self.observer.fit(model)), (other,))
        )
        self.behind = its < (1.0 - rules.PLAY_OR_DAMPER) * own
        return self.behind

    def coarse(self, model: AxisModel) -> bool:
        """Whether only inverse dynamics shows what this model lacks."""
        return stop.holds(model) or self.large(model) or (bool(model.added) and self.lost(model))

    def trusted(self, model: AxisModel) -> InverseView | ObserverView:
        """The view that judges this model."""
        return self.inverse if self.coarse(model) else self.observer

    def lost(self, model: AxisModel) -> bool:
        """Whether the observer's model leaves the record's path, and so sees more missing torque than there is.

        Both views measure the same torque.  Under fast feedback, friction is known too badly for any model to run on
        the drive alone (a motor whose inertia is a few milliseconds of its drive), and what the observer then calls
        missing torque is its own drift.
        """
        if model.load_side:  # inverse dynamics has no form of it to compare with
            return False
        seen = self.observer.rms(self.observer.gap(model))
        return seen > rules.DRIFTS * self.inverse.rms(self.inverse.gap(model))

    def verdict_view(self, base: AxisModel) -> Any:
        """Inverse dynamics if the base model lacks much, the observer otherwise."""
        return self.view(base, None)

    def surrogate(self, model: AxisModel, rng: np.random.Generator) -> ServoPlant:
        """The plant of a record that the model itself made in the same experiment."""
        view = self.observer.surrogate(model, rng)
        other = ServoPlant(view.record, self.law, None, self.tolerance)
        other.observer = view
        return other

    def settle(self, model: AxisModel) -> AxisModel:
        """The numbers for simulation: the model as found, or refitted by the observer, whichever runs freely better.

        The horizon of the proof is settled first, and is the one they are compared at: over a longer one, at which no
        model of this record can be simulated, a pendulum without inertia had the smaller drift (XL330 10h28m24).
        """
        self.headline, self.horizons = self._horizons(model)
        if not self.coarse(model) or stop.holds(model):  # an observer does not see where a contact begins
            return model
        both = model, self.observer.fit(model)
        return min(both, key=lambda m: servo_free_run.train_error(self.observer, m, self.headline))

    def _horizons(self, model: AxisModel) -> tuple[float, tuple[float, ...]]:
        """(headline, all) horizons at which this model can be simulated at all (`servo_free_run.predictable`)."""
        made = self.surrogate(model, np.random.default_rng(0))
        longest = servo_free_run.horizon_of(model, model.scene, self.tolerance)
        headline = servo_free_run.predictable(made.observer, model, longest)
        return headline, (headline / 5.0, headline, 4.0 * headline)

    def follows(self, model: AxisModel) -> float:
        """Share of the gap that nameless functions of the motion predict; 0 beside a play.

        The knocks of a play come a sample early or late: torque for an instant, and no path.
        """
        return 0.0 if model.has_play else explainable(self.trusted(model), model)

    def learn(self, model: AxisModel) -> Learned | None:
        """Curves of the inverse view; the age of the drive is that with which the free run is best on fitted samples.

        Inverse dynamics counts half a sample of age for the hold, which a simulation does by itself.
        """
        if self.inverse.quiet(model, self.tolerance * self.scale):
            return None
        found = servo_learned.learn(self.inverse, model)
        if found is None:
            return None
        ages = (model.timing, found.model.timing - HOLD, found.model.timing)
        tried = [dataclasses.replace(found.model, timing=age) for age in ages]
        best = min(tried, key=lambda m: servo_free_run.train_error(self.observer, m, self.headline))
        return found._replace(model=best)

    def read_off(self, model: AxisModel) -> list[Any]:
        """A coarse encoder, a folded sensor: what no missing torque shows; looked for where that shows nothing."""
        if model.added:
            return []
        if self._folded is not None:
            effect = get_effect("sensor_rectification")(fraction=1.0)  # type: ignore[call-arg]
            return [NamedEffect(effect, {}, float(len(self.record)), rules.SIGN_SEEN, 1.0)]
        return coarse_encoder(self.observer, model)

    def aliases(self, name: str) -> tuple[str, ...]:
        """Names that no record of drive and position can tell from ``name``."""
        also = OVER_LITTLE_TRAVEL.get(name, ()) if float(np.ptp(self.record.position)) < rules.LITTLE_TRAVEL else ()
        return tuple(dict.fromkeys([*aliases(name), *(a for a in also if self.units[1] == "rad")]))

    def doubtful(self, model: AxisModel, index: int, taken: Evidence, rival: Evidence) -> bool:
        """Whether a rival of the same transmission, nearly as good, runs nearly as well with all numbers fitted.

        Damping and play hold a load back alike, and a first fit of a play may stand in a poor minimum: what tells them
        apart is the free run of both, settled.
        """
        if taken.name == rival.name or any(get_effect(e.name).port != "block" for e in (taken, rival)):
            return False
        if rival.delta_bic < (1.0 - rules.PLAY_OR_DAMPER) * taken.delta_bic:
            return False
        terms = model.terms
        other = self.observer.fit(model.with_terms((*terms[:index], rival.fitted.model.terms[-1], *terms[index + 1 :])))
        own, its = (servo_free_run.train_error(self.observer, m, self.headline) for m in (model, other))
        return its < (1.0 + rules.PLAY_OR_DAMPER) * own

    def commoner(self, name: str) -> tuple[str, ...]:
        """Names preferred to ``name`` on a tie."""
        return get_effect(name).commoner

    def linearised(self, model: AxisModel) -> Linearised:
        """Of the residual of the view that is to be trusted."""
        return self.trusted(model).linearised(model)

    def as_given(self, base: AxisModel) -> tuple[ServoPlant, AxisModel]:
        """The record as it was given, before a folded reading was unfolded, and its base model."""
        if self._folded is None:
            return self, base
        observer, model = self._folded
        other = ServoPlant(observer.record, self.law, None, self.tolerance)
        other.observer = observer
        return other, model

    # --- proof --------------------------------------------------------------------------------
    def simulate(self, model: AxisModel, horizon: float) -> Array:
        """See `whsklearn.gap.plants.servo_free_run.free_run`."""
        return servo_free_run.free_run(self.observer, model, horizon)

    def measured(self, *models: AxisModel) -> tuple[Array, NDArray[np.bool_]]:
        """Position and the mask of held-out samples without the edges."""
        return self.observer.record.position, servo_free_run.held_out(self.observer)

    def figures(self, base: AxisModel, model: AxisModel) -> tuple[float, float, float]:
        """(gap before, after, floor) of inverse dynamics, in the unit of the drive: what an engineer would compute.

        Behind a coupling it would need the motor's motion, which nobody measured: there the observer tells them.
        """
        view = self.observer if model.load_side else self.inverse
        return view.rms(view.gap(base)), view.rms(view.gap(model)), view.floor(model)

    # --- report -------------------------------------------------------------------------------
    def gap_to_locate(self, model: AxisModel) -> Array:
        """The gap of inverse dynamics at the samples of `signals`."""
        return self.inverse.gap(model)

    def signals(self, model: AxisModel) -> dict[str, tuple[Array, str]]:
        """Name -> (measured signal at the judged samples, unit)."""
        return signals(self.inverse, self.units)

    def regressors(self, model: AxisModel) -> tuple[dict[str, tuple[float, Array]], Array, float]:
        """(name -> (number of the base model, its column at the judged samples), gap, seconds a sample)."""
        view = self.inverse
        numbers = {"inertia": model.inertia} | {t.name: t.q[0] for t in model.terms[: model.n_base]}
        columns, _ = view.columns(model, view.torque(model))
        named = zip(numbers.items(), columns.T, strict=False)
        return {k: (v, x[view.at]) for (k, v), x in named}, view.gap(model), view.step

    def residual_tests(self, base: AxisModel, model: AxisModel) -> list[dict[str, Any]]:
        """Whiteness of what is left, before and after."""
        self.observer.weigh(0.0)
        return [
            whiteness(self.observer.whitened(self.observer.gap(m), on="all"), name)
            for name, m in (("before", base), ("after", model))
        ]

    def parameters(self, model: AxisModel) -> dict[str, float]:
        """The base model's numbers."""
        rows = {"inertia": model.inertia}
        rows |= {t.name: t.q[0] for t in model.terms[: model.n_base]}
        return rows | {"age of the drive (samples)": model.timing}

    def parameter_units(self, model: AxisModel) -> dict[str, str]:
        """In drive and position as logged; an inertia by its own name where the drive is a torque or a force."""
        drive, position = self.units
        inertia = {("Nm", "rad"): "kg m²", ("N", "m"): "kg"}.get(self.units, f"{drive} s²/{position}")
        units = {t.name: next(iter(t.effect.quantities.values())).unit for t in model.terms[: model.n_base]}
        spelled = {k: u.replace("Nm", drive).replace("rad", position) for k, u in units.items()}
        return {"inertia": inertia, **{k: "" if u == "1" else u for k, u in spelled.items()}}

    def notes(self, base: AxisModel, model: AxisModel) -> list[str]:
        """Remarks on how the record was used."""
        view, skipped = self.observer, self.inverse.skipped
        left_out = (
            f"{max(skipped[0], 0.0):.3g} to {skipped[1]:.3g} s follow another law than the rest: left out."
            if skipped
            else ""
        )
        return ([left_out] if left_out else []) + [
            f"Position noise {view.noise:.3g} {self.units[1]} (from sixth differences); the gap is seen "
            f"up to {view.filter.cutoff:.1f} Hz, where that noise makes {100 * view.floor() / self.scale:.2f} % "
            "of the rms drive.",
            "The drive is replayed and the model held near the measurement by an observer, so no controller is needed.",
            SPLIT,
        ]

    def pictures(self, base: AxisModel, model: AxisModel) -> dict[str, Any]:
        """Series that the page draws."""
        runs = {
            "before": servo_free_run.free_run(self.observer, base, self.headline),
            "after": servo_free_run.free_run(self.observer, model, self.headline),
        }
        return pictures(self.inverse, base, model, self.units, self.gap_word) | {
            "runs": runs, "held": servo_free_run.held_out(self.observer),
        }  # fmt: skip

    def system(self, model: AxisModel) -> Any:
        """The repaired `ServoAxis`."""
        from whsklearn.systems.servo import ServoAxis
        from whsklearn.systems.servo_parts import Drive

        return ServoAxis(
            inertia=model.inertia,
            law=[t.effect for t in model.terms[: model.n_base]],  # type: ignore[arg-type]
            effects=tuple(t.effect for t in model.added),
            drive=Drive(delay=max(0.0, model.timing) * model.scene.dt),
            sample_rate=1.0 / model.scene.dt,
        )


def servo_plant(model: Any, log: Any, *, law: str | None, tolerance: float, columns: dict[str, Any]) -> ServoPlant:
    """The plant of a log; ``model`` is ``"servo"`` or a `ServoAxis`, whose law is then the base model's."""
    given = None if isinstance(model, str) else model
    if given is not None and law is None:
        law = ",".join(t.name for t in given.law.terms)
    record = log if isinstance(log, ServoRecord) else ServoRecord.from_frame(pd.DataFrame(log), **columns)
    names = law_names(law, "viscous,coulomb")
    return ServoPlant(record, names, given, tolerance)


def law_names(law: str | None, default: str) -> tuple[str, ...]:
    """Names of a law given as text."""
    names = tuple(n.strip() for n in (default if law is None else law).split(",") if n.strip())
    if not names:
        raise ValueError("The friction law is empty; name at least one term, such as viscous.")
    for name in names:
        if candidate(name).linear != 1:
            raise ValueError(f"{name!r} cannot stand in the base law of an axis; expected friction such as coulomb.")
    return names
