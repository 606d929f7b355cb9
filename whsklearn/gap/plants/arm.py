"""An arm as a plant: drives and positions of all joints in one rigid-body model; names are pairs (effect, joint).

The residuals of all joints are weighted by their size.  Candidates are ranked within a joint, those of the best joint
first.  If the numbers of another record are given (an identified `ArmModel`), they move only as far as their errors
allow, and a named effect is one that has appeared since.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import ContactStop, Coulomb, LoadFriction, Saturation, Surroundings, Viscous
from whsklearn.effects.base import rms
from whsklearn.gap.calibration import rival_leads
from whsklearn.gap.data_check import DataProblem
from whsklearn.gap.filters import whiteness
from whsklearn.gap.localisation import spectra
from whsklearn.gap.plant import QUIET, Figures, Gap, Linearised, Plant, Told, quiet
from whsklearn.gap.plants import holes_in
from whsklearn.gap.plants.arm_families import families, limited, look_at_limit, nameless_at, polished, starts_of
from whsklearn.gap.plants.arm_terms import (
    AtJoint,
    JointInertia,
    JointTerm,
    Load,
    Weight,
    at_a_joint,
    candidates,
    completed,
    parts_of,
    present,
)
from whsklearn.gap.plants.arm_view import LATEST, ArmRecord, ArmState, ArmView, law_of
from whsklearn.gap.plants.servo_candidates import aliases as of_axis
from whsklearn.gap.plants.servo_inverse import too_large
from whsklearn.gap.plants.servo_model import ServoTerm
from whsklearn.gap.plants.servo_run import LONGEST_RUN, OWN_MOTION, SHORTER_RUNS
from whsklearn.gap.record import SPLIT, Array, training_samples
from whsklearn.gap.search import HALF, LEAST_SHARE, STILL
from whsklearn.gap.tangent import Family, Look, Tangent, chance
from whsklearn.identification.arm_checks import (
    enough_rows,
    in_another_order,
    in_another_scale,
    in_degrees,
    suspicions,
)
from whsklearn.identification.arm_fit import reversals_of
from whsklearn.identification.joint_least_squares import SAME, Known, blocks_of, fitted, updated
from whsklearn.identification.payload import ALIKE, FURTHEST, Beside
from whsklearn.lags.rigid_body import RigidBodyLags
from whsklearn.models.arm import ArmModel
from whsklearn.models.files import as_arm
from whsklearn.systems.arm import Arm
from whsklearn.systems.arm_files import STANDARD_GRAVITY
from whsklearn.systems.servo import fine_steps

UNTOLD = 1e6  # m: the standard error of a centre that no drive tells, in place of infinity
# What joints may lack beside what reverses: without the others, dry friction seems to reverse slowly.
FRICTIONS = Viscous(), Coulomb(), LoadFriction()
# Step of a derivative, as a share of the number, and the precision of its column: one that is to this a combination of
# others tells nothing.  A spring's centre is such beside a joint's offset; taken for a direction of its own, rounding
# gave it a variance of 1e15, beside which every other effect could have been zero.
CHANGED = 1e-4
# Part of half the travel within which a joint is at an end of it. Of what a limit would take off the drive, 0.46 to
# 0.99 is taken there at rest in six logs with a stop, and 0.01 at most in five with a limit.
AT_AN_END = 0.05
SOME = 200  # positions at which the mass matrix is checked for being positive definite


class ArmPlant(Plant):
    """Coupled joints with logged drives and positions.

    ``lags``: arm, law and filter. ``given_model``: returned if nothing can be diagnosed. ``known``: what another record
    knows of the numbers. ``given``: effects of the base model that have no columns.

    Examples
    --------
    >>> from whsklearn.datasets import default_arm, make_arm_log
    >>> q, u = make_arm_log(duration=4.0, return_arrays=True)
    >>> plant = arm_plant(default_arm(), (np.arange(len(q)) / 500.0, q, u), law=None, tolerance=0.004)
    >>> plant.check()
    []
    >>> dry, unit = plant.numbers(plant.base(np.random.default_rng(0)))["yaw.coulomb"]  # 0.3 Nm in truth
    >>> round(dry, 2), unit
    (0.3, 'Nm')
    """

    units: tuple[str, str] = ("Nm", "rad")
    logged: tuple[str, str] = ("Nm", "rad")
    gap_word, whole, gap_unit = "missing drive", "drive", ""
    scale, n_effective = 1.0, 2.0
    horizons: tuple[float, ...] = (*SHORTER_RUNS[1::-1], LONGEST_RUN)
    headline = horizons[-1]
    looked: Sequence[Look] = ()
    repair = ""  # what to check in the log before anything else
    joint = 0  # that the first sentence of the report is about, and so its pictures

    def __init__(
        self, record: ArmRecord, lags: RigidBodyLags, given_model: Any, tolerance: float, known: Known | None = None,
        given: tuple[JointTerm, ...] = (),
    ):  # fmt: skip
        self.record, self.lags, self.given_model, self.tolerance = record, lags, given_model, tolerance
        self.known, self.given = known, given
        self.own_units: dict[str, str] = {}
        self._arms: dict[Any, Arm] = {}
        self._runs: dict[Any, Array] = {}

    # --- the base model ----------------------------------------------------------------------
    def check(self) -> list[DataProblem]:
        """Check for degrees, a wrong order of the columns, gain or sign, and joints that do not move."""
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always", UserWarning)
            try:
                self.view = ArmView(self.lags, self.record, self.known)
                enough_rows(self.view)
            except ValueError as error:
                return [DataProblem("data-arm", "The log cannot be used", str(error))]
        v = self.view
        if v.arm.slides.any():
            self.units = self.logged = ("N", "m") if v.arm.slides.all() else ("Nm", "")
        if turned := in_degrees(v):
            return [DataProblem("data-units", "The positions are in degrees", turned[0])]
        if wrong := in_another_order(v):
            return [DataProblem("data-order", "The joints are in another order", wrong[0])]
        judged = copy(v)  # without what the given model has beside its numbers, such as a dead zone
        judged.target = v.target - sum(v.contribution(t) for t in self.given)
        scales = in_another_scale(judged, known=None if self.known is None else self.known.values)
        self.repair = " ".join(scales)
        texts = [*(str(w.message) for w in said if w.category is UserWarning), *suspicions(v), *scales]
        return [DataProblem("data-arm", "Check the log", text, fatal=False) for text in texts]

    def base(self, rng: np.random.Generator) -> ArmState:
        """The rigid arm with its law, fitted; or the given arm, within what is known of it."""
        n = self.view.n_joints
        if self.known is None and (reversals := reversals_of(self.view, FRICTIONS)):
            self.lags.set_params(reversals=reversals)
            self.view = ArmView(self.lags, self.record)
        model = self.settled(ArmState(np.zeros(len(self.lags.base_.names)), np.zeros(n), self.given, len(self.given)))
        self.view.hear_stops(model)
        return self.settled(model)

    # --- the search --------------------------------------------------------------------------
    def settled(self, model: ArmState) -> ArmState:
        """Weight the joints by their residuals and polish every shape; twice, because each changes the other."""
        view = self.view
        for _ in range(2):
            model = view.fit(model)
            view.weigh(model)
            for i, t in enumerate(model.terms):
                if t.shape and (self.known is None or i >= model.n_base):
                    # the ages as the shape leaves them: without a load they stand for it, at their limits
                    rest = replace(view.fit(model.without(i)), timing=model.timing)
                    term = polished(view, self._tangent(rest, np.zeros((0, view.keep.size))), t)
                    model = view.fit(model.replaced(i, term))
        return self._centred(view.fit(model))

    def _centred(self, model: ArmState) -> ArmState:
        """The same with the offset of a joint in the rest position of a spring that was added there.

        c (q - q_0) + o = c (q - (q_0 - o / c)): a fit of both leaves the spring at any rest position, with an offset
        that nothing but the spring gives.
        """
        names, terms = list(self.lags.base_.names), list(model.terms)
        if self.known is not None:
            return model
        for i, t in enumerate(model.terms):
            offset = f"{t.joint}.input_offset"
            if i < model.n_base or "input_offset" not in t.effect.covers or offset not in names or not t.q[0]:
                continue
            stiffness, centre = t.q
            moved = centre - float(model.numbers[names.index(offset)]) / stiffness
            if t.effect.quantities["centre"].low < moved < t.effect.quantities["centre"].high:
                terms[i] = replace(t, q=(stiffness, moved))
        return self.view.fit(model.with_terms(tuple(terms)))

    def _tangent(self, model: ArmState, null: Array) -> Tangent:
        """The residual of a fitted model; its numbers, the ages of drives within bookkeeping, and the speeds over which
        dry friction reverses are projected out.
        """
        view = self.view
        late = model.timing >= LATEST * view.dt  # then the age is not a nuisance but a candidate
        x, _ = view.design(model, ~late & np.any(view.rate != 0.0, axis=0))
        x = np.hstack([x, view.widths])
        known = view.known_rows(x.shape[1]) if self.known is not None else None
        left = view.left(model) + np.where(view.keep, view.phi @ (model.numbers - view.expected), 0.0)
        return Tangent(left.ravel(), null, x, self.n_effective, view.flat_weight(), known)

    def looks(self, model: ArmState, rng: np.random.Generator, beside: Any = None) -> list[Look]:
        """Look at every candidate at every joint and at nameless functions of each joint's motion, beside the model."""
        view = self.view
        self.own = view.own(view.fit(model), rng)
        view.artefact, self.n_effective = self.own.mean, float(self.own.counts.sum())
        view._fits = {}
        model = view.fit(model)
        self.tangent = self._tangent(model, self.own.null.reshape(len(self.own.null), -1))
        there = present(law_of(self.lags.axes_), model.terms)
        kinds = candidates(view.arm, there, frozen=self.known is not None, weight=view.weights_of_links.shape[2])
        limits: list[AtJoint] = []
        rest: list[AtJoint] = []
        for k in (k for k in kinds if k.cls is not Load or view.weighs(k)):
            (limits if k.transforms and not k.delays else rest).append(k)
        pairs = [(f, self.tangent.look(f)) for f in (*families(view, rest), *nameless_at(view))]
        looks = [self._sized(look) for _, look in pairs if look is not None]
        looks += [self._sized(look) for k in limits if (look := look_at_limit(view, k, self.tangent)) is not None]
        n = len(looks)
        looks = [replace(k, p_value=chance(k, k.null, n, 0.0)) for k in outermost(looks, view.arm)]
        looks.sort(key=lambda k: -k.score)
        usual = self._usual(model)  # beside what has changed at one joint, what was there before at another is no gap
        asked = [i for i, k in enumerate(looks) if not k.place or not k.place <= usual]
        looks = [k if i in asked else replace(k, p_value=1.0) for i, k in enumerate(looks)]
        for i in [i for i in asked if looks[i].name][:1]:
            for family in [f for f, k in pairs if k is not None and k.start is looks[i].start]:
                looks[i] = self._beside(looks[i], family, model, rng, len(looks))
        self.looked = looks
        return self.looked

    def snapshot(self) -> dict[str, Any]:
        """A look also changes what the view knows of own records."""
        return super().snapshot() | {"view": copy(self.view)}

    def _beside(self, look: Look, family: Family, model: ArmState, rng: np.random.Generator, families: int) -> Look:
        """The look with its p-value from null records with the colour of the residual that the family itself leaves.

        A strong slow effect is part of the residual from which null records take their colour, and so hides in them.
        As in any F-test the noise is that of the larger model; for a weak effect both are the same.  To choose between
        two families, the null records that both have in common are used.
        """
        view = self.view
        rest = view.left(view.fit(model.with_term(look.start)))
        null, _ = view.null(rest, self.own.apart, rng)
        beside = self._tangent(model, null.reshape(len(null), -1)).look(family)
        assert beside is not None
        return replace(look, p_value=chance(look, beside.null, families, 0.0))

    def _usual(self, model: ArmState) -> set[str]:
        """The joints at which a model with effects leaves no more than the arm's own record may leave."""
        if not model.added or self.known is None or not self.known.unexplained:
            return set()
        return set(np.array(self.view.arm.joints)[self._shares(self.errors(model)) <= QUIET * self.floor].tolist())

    def _sized(self, look: Look) -> Look:
        """The look with its size as a share of the drive of the joint where it is largest."""
        before = after = self.tangent.rows[:, 0]
        if len(look.place) != 1:  # its columns lie on the rows of several joints
            kind = look.start.kind
            columns = self.view.body(kind) if kind.cls is Load else self.view.columns(kind, look.start.shape)
            columns = self.tangent._weighted(columns)
            columns -= self.tangent.plane @ (self.tangent.plane.T @ columns)
            after = before - columns @ np.linalg.lstsq(columns, before, rcond=1e-9)[0]
        return replace(look, size=self._share(before, after, look.size**2 * before.size, look.place))

    def size(self, before: Array, after: Array) -> float:
        """Rms of the change of the residual, as a share of the drive of the joint where it is largest."""
        return self._share(before, after, float(before @ before) - float(after @ after))

    def _share(self, before: Array, after: Array, power: float, place: frozenset[str] = frozenset()) -> float:
        """Rms of so much power, as a share of a joint's drive: of the joint of its place, or where it is largest.

        At several joints it is divided between them like the change of the residual.
        """
        view = self.view
        whole = np.maximum(view.keep.sum(axis=0), 1) * (view.weight * view.drive_rms) ** 2
        gone = np.sum((before**2 - after**2).reshape(-1, view.n_joints), axis=0)
        if len(place) == 1:
            gone = np.isin(view.arm.joints, list(place)).astype(float)
        shares = np.divide(gone, whole, out=np.zeros(gone.size), where=whole > 0.0)  # a joint at rest has no rows
        if gone.sum() <= 0.0:  # a second offset changes nothing but the rounding
            return 0.0
        return float(np.sqrt(max(power, 0.0) * max(shares.max(), 0.0) / gone.sum()))

    def explained(self, model: ArmState, grown: ArmState, look: Look | AtJoint) -> tuple[float, float]:
        """As of any plant; numbers of another record that need move less with the effect count as explained by it.

        Without the effect they bend to it as far as their errors allow, and what is left then shows little of it.
        """
        before, after = self.errors(model), self.errors(grown)
        first, last = self._moved(model), self._moved(grown)
        power = float(before @ before) + first - float(after @ after) - last
        more = self._likelihood(after) - self._likelihood(before) + (first - last) / self.view.repeats
        return more, self._share(before, after, power, look.place)

    def _likelihood(self, errors: Array) -> float:
        """Twice the log likelihood of errors, each joint with a variance of its own (but for a constant).

        The weights are those of the model before, so a joint that lacks much counts for little beside the others: by
        the power of all joints, two names looked alike that left 0.14 and 0.39 % of a drive of which 7 % was missing.
        """
        powers = np.sum(errors.reshape(-1, self.view.n_joints) ** 2, axis=0)
        return -float(self.own.counts @ np.log(np.maximum(powers, 1e-300)))

    def leads(self, taken: Any, other: Any, before: Array, rng: np.random.Generator) -> Array:
        """As of any plant, at the joints where one of the two acts; an error of the model may favour the one taken.

        An error that the arm left before is the same wherever the motion is the same, so noise of its colour is not all
        that it does: at worst all of it lies along the difference of the two.
        """
        view = self.view
        at = self._acting(*(f.model.with_terms(f.model.terms[-1:]) for f in (taken, other)))
        missing, one, two = (e.reshape(-1, at.size)[:, at].ravel() for e in (before, taken.errors, other.errors))
        n, apart = float(self.own.counts[at].sum()), float(np.sum((two - one) ** 2))
        usual = float(np.sum((view.keep.sum(axis=0) * (self.floor * view.drive_rms * view.weight) ** 2)[at]))
        along = min(1.0, np.sqrt(usual / max(apart, 1e-300)))
        return rival_leads(missing, one, two, n, rng) + 2.0 * n * along * apart / max(float(two @ two), 1e-300)

    def gap_share(self, look: Look, step: Any) -> float:
        """Share of the weighted residual of all joints: sizes are shares of the drives of different joints."""
        return float(-np.expm1(-max(look.gain, 0.0) / step.n_effective))

    def complete(self, before: Array, model: ArmState) -> bool:
        """Whether what is left at the joints of its terms may stay without a name: see `whsklearn.gap.conclude`."""
        (first, last), here = (self._shares(e) for e in (before, self.errors(model))), self._acting(model)
        silent = quiet(last, self.floor, self.tolerance)
        return bool(np.all((silent | (last <= STILL * first))[here]))

    def enough(self, model: ArmState) -> bool:
        """Whether a name can be certain: not if a drive seems to have a wrong gain, unit or sign.

        Joints share numbers, so a wrong gain leaves an error at all of them, for which a name may stand.
        """
        return not self.repair

    def _against_its_stop(self, model: ArmState, grown: ArmState) -> str:
        """The objection that a term explains little outside the contact with its joint's stop, which is in the model.

        A push has a form of its own, which a stop's spring and damper give only roughly: a dead zone was named, with
        certainty, for what it leaves of MuJoCo's. A servo axis is not judged in contact at all
        (`whsklearn.gap.plants.servo_stop`).
        """
        view, joint = self.view, grown.terms[-1].joint
        stop = next((t for t in model.terms if t.joint == joint and t.kind.cls is ContactStop), None)
        if stop is None or grown.terms[-1].kind.cls is Load:  # a mass is felt at every joint that carries it
            return ""
        j = view.arm.joints.index(joint)
        before, after = (view.left(view.fit(m))[:, j] ** 2 for m in (model, grown))
        free = np.abs(view.contribution(stop)[:, j]) < self.tolerance * view.drive_rms[j]
        gone = before - after
        outside = float(gone[free].sum()) >= LEAST_SHARE * float(gone.sum())
        return "" if outside else "it explains little outside the contact with the stop"

    def _at_rest(self, t: JointTerm) -> str:
        """The objection that a limit takes off the drive while the joint rests at an end of its travel: a stop does.

        A controller winds up against a stop, and static friction can be said to hold what a limit leaves of that.
        """
        if t.kind.cls is not Saturation:
            return ""
        q, v = (x[:, t.kind.index] for x in self.view.moved[:2])
        lost, near = self.view.lost(t.kind, t.shape) ** 2, AT_AN_END * 0.5 * np.ptp(q)
        there = (np.abs(v) < self.lags.slow * rms(v)) & ((q < q.min() + near) | (q > q.max() - near))
        held = lost[there].sum() > HALF * lost.sum()
        return "it acts while the joint rests at an end of its travel, as a stop does" if held else ""

    def _moved(self, model: ArmState) -> float:
        """How far the numbers are from those of another record, squared, in the unit of the power of the errors."""
        view = self.view
        return float(np.sum((view.known_rows(view.root.shape[1]) @ (view.fit(model).numbers - view.expected)) ** 2))

    def refine(self, model: ArmState, look: Look) -> ArmState:
        """The candidate with its shape polished and all sizes solved for."""
        if look.start.kind.transforms and not look.start.kind.delays:
            return limited(self.view, self.tangent, model, look.start)
        fits = (self.view.fit(model.with_term(polished(self.view, self.tangent, t))) for t in starts_of(look.start))
        return min(fits, key=lambda m: float(np.sum(self.errors(m) ** 2)))

    def errors(self, model: ArmState) -> Array:
        """The residual of the model, weighted by joint and ordered by instant, as a share of the drives that arrive."""
        view = self.view
        return np.asarray((view.left(view.fit(model)) * view.taken_off(model) * view.weight).ravel())

    def rms(self, errors: Array) -> float:
        """Rms of the errors of each joint that moves, as a share of its drive; their geometric mean.

        The weights of a fit follow the joints' residuals, so that it makes this mean small. By the power of all joints,
        friction that six of them lack was refused at the first: as its weight grew, the others were left with more.
        """
        shares = self._shares(errors)[self.view.keep.any(axis=0)]
        return float(np.exp(np.mean(np.log(np.maximum(shares, 1e-300)))))

    def _shares(self, errors: Array) -> Array:
        """Rms of the errors of each joint, as a share of its drive."""
        view = self.view
        return view.by_joint(errors.reshape(-1, view.n_joints) / view.weight) / np.maximum(view.drive_rms, 1e-300)

    def aliases(self, name: str) -> tuple[str, ...]:
        """Names that no record of drives and positions can distinguish from this one, at the same joint."""
        effect, at, joint = name.partition(" at ")
        try:
            return tuple(f"{a}{at}{joint}" for a in of_axis(effect))
        except ValueError:
            return ()

    def units_at(self, joint: str) -> tuple[str, str]:
        """N and m at a joint that slides."""
        arm = self.view.arm
        sliding = {j for j, slides in zip(arm.joints, arm.slides, strict=True) if slides}
        return ("N", "m") if sliding & {joint, *re.split(r"[+-]", joint)} else ("Nm", "rad")

    @property
    def per(self) -> Array:
        """What positions are divided by, (n_joints,): each joint's own motion if some slide and others turn."""
        slides = self.view.arm.slides
        mixed = slides.any() and not slides.all()
        return np.std(self.view.moved.position, axis=0) if mixed else np.ones(slides.size)

    def objection(self, model: ArmState, grown: ArmState) -> str:
        """The objection to a term: to its numbers, that fewer would do, or that it explains too little."""
        return (
            self._implausible(grown)
            or self._plainer(model, grown)
            or self._against_its_stop(model, grown)
            or self._no_better(model, grown)
            or self._cancelled(model, grown)
        )

    def _implausible(self, grown: ArmState) -> str:
        """The physical objection to the numbers of the last term."""
        t = grown.terms[-1]
        if said := self._at_rest(t):
            return said
        if t.kind.cls is Load and max(map(abs, t.shape)) >= FURTHEST:
            return "its centre is as far away as a payload can plausibly be"
        base = dict(zip(self.lags.base_.names, grown.numbers, strict=True))
        total = t.q[0] + base.get(f"{t.joint}.{t.effect.name}", 0.0) if t.kind.linear == 1 else 1.0
        if t.kind.positive and total <= 0.0:
            return f"its size would be {total:.3g}, but a physical one is positive"
        if (kind := t.kind.catalogued) is not None:
            fields, ranges = kind.fields[t.kind.linear :], kind.ranged(self.view.scene(t.kind))
            if said := too_large(ServoTerm(kind, t.q)) or t.effect.implausible(self._beside_it(grown)):
                return said
            n = 2 if t.kind.cls is ContactStop else 1  # the first is a place or width; a stop's second, its softness
            for field, value, (low, high) in list(zip(fields, t.shape, ranges, strict=True))[:n]:
                quantity = kind.cls.quantities[field]
                below = low and value <= low + 1e-3 * abs(low) and not quantity.open_below
                if below or (value >= high - 1e-3 * abs(high) and not quantity.open_above):
                    return f"its {field} reaches the limit of the plausible range"
        return ""

    def _plainer(self, model: ArmState, grown: ArmState) -> str:
        """The objection that a term with fewer numbers explains nearly as much as the last one."""
        t, view = grown.terms[-1], self.view
        shaped = t.kind.catalogued is not None and not t.effect.elementary and t.kind.n_numbers > 1
        plainer = [
            (c.name.replace("_", " "), JointTerm(replace(t.kind, cls=c.cls, catalogued=c), (0.0,)))
            for c in (at_a_joint() if shaped else ())
            if c.cls.elementary and len(c.fields) == 1
        ]
        if t.kind.splits:
            plainer.append(("a spring without a play", replace(t, q=(0.0, *t.q[1:]))))
        for name, term in plainer:
            plain = view.fit(model.with_term(term))
            beyond, most = (self.size(*map(self.errors, pair)) for pair in ((plain, grown), (model, plain)))
            stays = float(self._shares(self.errors(grown))[view.arm.joints.index(t.joint)])
            # Beyond it, a shape must explain the share of the power that a name must, or more than stays without one,
            # and in any case what may stay or is not worth a name: MuJoCo's dry friction is soft, and adding a distance
            # of some mrad explains 3 to 5 % of it (`python -m benchmarks.blind_arms --kinds coulomb`).
            if beyond < max(min(self.tolerance, most), STILL * most, min(stays, LEAST_SHARE**0.5 * most)):
                return f"{name} explains as much with fewer numbers"
        return ""

    def _no_better(self, model: ArmState, grown: ArmState) -> str:
        """The objection that the last term explains too little, or nothing on blocks that were not fitted."""
        t, view = grown.terms[-1], self.view
        at = [view.arm.joints.index(j) for j in t.kind.place or view.arm.joints]
        if {view.arm.joints[i] for i in at} <= self._usual(model):
            return "before it, no more was left at its joint than the arm's own record may leave"
        there = float(self._shares(self.errors(model.with_terms(())))[at].max())
        if model.added and self.explained(model, grown, t.kind)[1] < STILL * there:
            return "it explains no more than may stay without a name beside the effects already found"
        before, after = (view.held_out(view.fit(m)) * view.weight * view.drive_rms for m in (model, grown))
        if np.nansum(after[at] ** 2) >= np.nansum(before[at] ** 2):
            return "on blocks of the record that were not fitted, the error is no smaller with it"
        if t.kind.cls is Load:
            # A mass is felt at every joint that carries it. A play lets the pull of its link through at its own joint
            # only, so that a mass which explains it is too much at the joints before.
            usual = np.maximum(before, self.floor * view.weight * view.drive_rms)
            if np.any(worse := after > QUIET * usual):
                joint = view.arm.joints[int(np.argmax(worse))]
                return f"on blocks of the record that were not fitted, it makes the error of {joint} larger"
        return ""

    def _cancelled(self, model: ArmState, grown: ArmState) -> str:
        """The objection that other terms nearly cancel the last one."""
        t, view = grown.terms[-1], self.view
        # What is removed by an effect that other terms nearly cancel, such as a spring against gravity, is the error of
        # columns unless it is a larger part of the effect than what stays is of the drive, on real arms 4 to 10 %.  All
        # joints carry a mass, and gravity is always large.
        asked = view.by_joint(view.contribution(t))
        closed = view.by_joint(view.left(view.fit(model))) ** 2 - view.by_joint(view.left(grown)) ** 2
        j = int(np.argmax(closed / np.maximum(view.drive_rms**2, 1e-300)))  # a joint at rest has no rows
        removed = float(np.sqrt(max(closed[j], 0.0)))
        if t.kind.place and asked[j] * self._shares(self.errors(grown))[j] > removed:
            return f"it would add {asked[j]:.3g} to remove {removed:.3g}: other terms cancel it"
        return ""

    def _beside_it(self, grown: ArmState) -> Surroundings:
        """The record and the model along the joint of the last term, as effects judge by them."""
        view, kind = self.view, grown.terms[-1].kind
        motion, at = view.signals(kind.direction), np.flatnonzero(kind.direction)
        sizes: dict[str, float] = {}
        of_law = {n.rpartition("."): x for n, x in zip(self.lags.base_.names, grown.numbers, strict=True)}
        own = [(name, float(x)) for (joint, _, name), x in of_law.items() if joint == kind.joint]
        for name, x in (*own, *((t.effect.name, t.q[0]) for t in grown.terms if t.joint == kind.joint)):
            sizes[name] = sizes.get(name, 0.0) + x
        return Surroundings(
            motion.position, motion.velocity, motion.drive, sizes=sizes, carried=True, step=float(view.grid[at].max()),
            dt=view.dt, turns=not view.arm.slides[at].any(),
        )  # fmt: skip

    def linearised(self, model: ArmState) -> Linearised:
        """The free numbers, and their covariance by leaving out blocks of the record (`updated`)."""
        view = self.view
        model, n = view.fit(model), len(model.numbers)
        weight, rows = view.flat_weight(), view.keep.ravel()
        base = view.design(model.with_terms(()), view.timed(model))[0]
        at, columns = base.shape[1], (base * weight[:, None])[rows]
        u, size, _ = np.linalg.svd(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), full_matrices=False)
        plane = u[:, size > SAME * size[0]]
        whole = view.left(model) + view.phi @ (model.numbers - view.expected)
        for t in model.terms:
            whole = whole + view.contribution(t)
            for slot in range(len(t.q)):
                step = CHANGED * max(abs(t.q[slot]), 1e-6)
                moved = (view.contribution(t.with_slot(slot, t.q[slot] + step)) - view.contribution(t)) / step
                one = (moved.ravel() * weight)[rows]
                rest = one - plane @ (plane.T @ one)
                new = rms(rest) > CHANGED * rms(one)
                columns = np.column_stack([columns, one if new else 0.0 * one])
                plane = np.column_stack([plane, rest / np.linalg.norm(rest)]) if new else plane
        target = (whole.ravel() * weight)[rows]
        known, block = view.known_rows(columns.shape[1]) / np.sqrt(view.repeats), blocks_of(view.keep)
        spread = updated(columns, target, block, known)[1]
        own = np.r_[:n, at : columns.shape[1]]
        for t in model.terms:
            here = slice(at, at := at + len(t.q))
            if t.kind.cls is Load:
                free = np.r_[: here.start, here.stop : columns.shape[1]]
                beside = Beside(columns[:, free], target, known[:, free], block, np.nonzero(view.keep)[1])
                if (told := beside.weigh(t.joint, (view.body(t.kind) * weight[:, None])[rows])) is not None:
                    errors = np.nan_to_num([told[0].mass_error, *told[0].centre_error], posinf=UNTOLD)
                    spread[here, :] = spread[:, here] = 0.0
                    spread[here, here] = np.diag(errors**2)

        def rebuild(z: Array) -> ArmState:
            at, terms = n, []
            for t in model.terms:
                terms.append(replace(t, q=tuple(map(float, z[at : at + len(t.q)]))))
                at += len(t.q)
            return replace(model, numbers=z[:n], terms=tuple(terms))

        x = np.concatenate([model.numbers, *(t.q for t in model.terms)])
        wide, none = np.full(x.size, np.inf), np.zeros((0, x.size))
        return Linearised(x, -wide, wide, none[:, 0], none, rebuild, spread[np.ix_(own, own)])

    def to_simulate(self, model: ArmState) -> ArmState:
        """The model as it is; also sets the longest horizon at which it can follow a record of its own."""
        other = self.made(model, np.random.default_rng(0))
        y, held = other.measured()
        for horizon in reversed(self.horizons):
            self.headline = horizon
            error = (y - other.simulate(model, horizon))[held]
            if rms(error) < OWN_MOTION * np.std(y[held]):
                break
        return model

    # --- proof -------------------------------------------------------------------------------
    def made(self, model: ArmState, rng: np.random.Generator) -> ArmPlant:
        """The plant of a record that the model itself makes along the measured motion.

        Its drives contain noise with the colour of what the model leaves of the real ones.
        """
        view = self.view
        other = ArmPlant(self.record, self.lags, None, self.tolerance, self.known)
        path, drive = view.read(view.moved.position, rng), view.along(model, view.moved)
        for t in (t for t in model.terms if t.kind.delays):
            drive += np.outer(view.lost(t.kind, t.shape), t.kind.direction)
        drive += view.unexplained(model, rng)
        other.record, other.view = replace(self.record, position=path, drive=drive), view
        other._made, other._judged, other._arms = True, (model,), self._arms
        return other

    _made = False
    _judged: tuple[ArmState, ...] = ()

    def simulate(self, model: ArmState, horizon: float) -> Array:
        """Free runs of all joints from the drives, restarted at the measured motion; shape (n n_joints,).

        Gravity that the file lacks is evaluated along the measured motion and subtracted from the drives.
        """
        view = self.view
        key = model.numbers.tobytes(), model.terms, horizon
        if key in self._runs:
            return self._runs[key]
        drive, path = self.record.drive, self.record.position
        moved = view.moved if not self._made else view.motion_of(path)
        if not self._made:
            for t in (t for t in model.terms if t.kind.cls is Weight):
                rows = view.time[view.kept]
                drive = drive - np.column_stack([np.interp(view.time, rows, x) for x in view.contribution(t).T])
        arm = self._arm(model)
        steps = fine_steps([e for row in arm.effects for e in row if e.port == "block"], view.dt)

        def run(u: Array, q: Array, v: Array, link: Array, rate: Array) -> Any:
            return arm.simulate_drive(
                u, position=q, velocity=v, link_position=link, link_velocity=rate, resync=horizon,
                sample_rate=self.lags.sample_rate, substeps=steps,
            ).position  # fmt: skip

        try:
            behind = view.behind(model, moved)
            free = self.record.by_piece(run, drive, moved.position, moved.velocity, *behind)
            self._runs[key] = np.asarray((free / self.per).ravel())
        except FloatingPointError:
            self._runs[key] = np.full(path.size, np.nan)
        return self._runs[key]

    def _arm(self, model: ArmState) -> Arm:
        """The arm that moves as the model does: the physical one nearest to its numbers if with these none can."""
        view, key = self.view, (model.numbers.tobytes(), model.terms)
        if key in self._arms:
            return self._arms[key]
        arm = self.lags.interpret(model.numbers, physical=False)
        some = view.moved.position[:: max(len(view.time) // SOME, 1)]
        gives = any(e.quantities[e.size].positive and e.magnitude < 0.0 for row in arm.effects for e in row)
        motors = view.motors(model)
        links = arm.mass_matrix(some) - np.diag([motors.get(j, 0.0) for j in arm.joints])
        if gives or np.linalg.eigvalsh(links).min() <= 0.0:  # friction that drives, or too uncertain
            arm = self._physical(model)
        self._arms[key] = completed(arm, model.terms, motors)
        return self._arms[key]

    def _physical(self, model: ArmState) -> Arm:
        """The arm of the base numbers with physical links; numbers that the record leaves open are the file's."""
        view = self.view
        if self.known is not None:
            spread = self.known.covariance
        else:
            x, y = view.design(model, np.zeros(view.n_joints, dtype=bool))
            shape = view.target.shape
            white = fitted(x.reshape(*shape, -1), y.reshape(shape), view.keep, view.weight)[1]
            n = len(model.numbers)
            spread = white[:n, :n] * view.keep.sum() / self.n_effective
        return self.lags.interpret(model.numbers, spread, motors=view.motors(model))

    def measured(self, *models: ArmState) -> tuple[Array, NDArray[np.bool_]]:
        """Positions of all joints, one after the other, and the mask of held-out samples away from the ends.

        Models are compared at the joints of their effects: the errors of the others, which may be larger, would hide
        them.
        """
        train = training_samples(self.record.position)
        edge = max(int(self.view.kept[0]), round(max(self.horizons) * self.lags.sample_rate))
        for s, _ in self.record.pieces:
            train[s][:edge] = train[s][-edge:] = True
        return (self.record.position / self.per).ravel(), np.outer(~train, self._acting(*models, *self._judged)).ravel()

    def figures(self, base: ArmState, model: ArmState, nameless: float = 0.0) -> Figures:
        """Shares of the drive at the joint of the named effects with the largest change, or at that with the gap.

        If an identified arm is the base model, its own record says how much of each drive it leaves anyway.  All that
        is left beyond that has no name, whether or not a function of the motion explains it: the impacts of a play are
        no function of what the encoder sees.  Elsewhere than at the named effects a joint counts if it would count in
        a record without any.
        """
        before, after = (self._shares(self.errors(m)) for m in (base, model))
        named, floor = self._acting(model), self.floor
        j = int(np.argmax(np.where(named, before**2 - after**2, -np.inf) if model.added else after / floor))
        if self.known is not None and self.known.unexplained:
            loud = ~quiet(after, floor, np.where(named, 0.0, self.tolerance))
            still = float(np.sqrt(np.max(np.where(loud, after**2 - floor**2, 0.0), initial=0.0)))
            if before[j] <= floor[j]:  # it was there before, and what explains it has no certain name
                still = float(before[j])
        else:
            here = frozenset(np.array(self.view.arm.joints)[named] if model.added else ())
            sizes = [k.size for k in self.looked if not k.name and (k.size >= self.tolerance or k.place & here)]
            still = max((size for size in sizes if size <= nameless), default=0.0)
        self.joint, self.subject = j, f" of {self.view.arm.joints[j]}"
        return Figures(float(before[j]), float(after[j]), float(floor[j]), still)

    def _acting(self, *models: ArmState) -> NDArray[np.bool_]:
        """The joints at which the terms of these models act, shape (n_joints,); all if there is no term."""
        places = [t.kind.place for m in models for t in m.added]
        joints = self.view.arm.joints
        if not all(places):
            places = []
        return np.array([not places or any(j in p for p in places) for j in joints])

    @property
    def floor(self) -> Array:
        """What chance leaves of each drive, as a share, (n_joints,): encoder noise, or what its own record leaves.

        Noise and errors of a model are shares of what a drive does, so a record in which it varies more, such as one
        with a load, leaves more by the same factor.
        """
        view, known = self.view, self.known
        left, varied = (known.unexplained, known.varied) if known is not None else ({}, {})
        joints = view.arm.joints
        more = [max(1.0, now / varied.get(j, np.inf)) for j, now in zip(joints, view.varies, strict=True)]
        usual = np.array([left.get(j, 0.0) for j in joints]) * more / np.maximum(view.drive_rms, 1e-300)
        return np.maximum(np.maximum(self.own.floor, usual), 1e-12)

    # --- report ------------------------------------------------------------------------------
    def _joints(self, base: ArmState, model: ArmState) -> list[dict[str, Any]]:
        """One row for each joint: what is missing on held-out blocks before and after, the floor, the names."""
        missing = zip(*(self.view.held_out(self.view.fit(m)) for m in (base, model)), self.floor, strict=True)
        return [
            {"name": joint, "missing": dict(zip(("before", "after", "floor"), map(float, shares), strict=True)),
             "names": [t.name for t in model.added if joint in (t.kind.place or {t.joint})]}
            for joint, shares in zip(self.view.arm.joints, missing, strict=True)
        ]  # fmt: skip

    def gap(self, model: ArmState) -> Gap:
        """The gap of the joint of `figures`, as a share of its drive; no constant is freed on its own."""
        view, j = self.view, self.joint
        left = np.asarray(view.left(view.fit(model))[:, j] / max(view.drive_rms[j], 1e-300))
        return Gap(left, view.step, self._signals(j), {})

    def _signals(self, j: int) -> dict[str, tuple[Array, str]]:
        """Name -> (signal of that joint at the rows, unit)."""
        view = self.view
        unit = "m" if view.arm.slides[j] else "rad"
        name, moved = view.arm.joints[j], (x[view.kept, j] for x in view.moved)
        out = {"time": (view.time[view.kept], "s")}
        for what, x, u in zip(("position", "velocity"), moved, (unit, f"{unit}/s"), strict=False):
            out[f"{what} of {name}"] = (x, u)
        return out | {f"drive of {name}": (view.target[:, j], "N" if view.arm.slides[j] else "Nm")}

    def numbers(self, model: ArmState) -> dict[str, tuple[float, str]]:
        """The numbers of the arm and its law."""
        unit = self.view.arm.unit_of
        return {k: (float(v), unit(k)) for k, v in zip(self.lags.base_.names, model.numbers, strict=True)}

    def told(self, base: ArmState, model: ArmState) -> Told:
        """Whiteness of the residual at the joint reported first, remarks, series of the page, and rows of joints."""
        numbers = (
            "keep within the errors with which they were identified" if self.known else "are fitted to this record"
        )
        notes = [
            f"The gap of each joint is a share of its own rms drive, below {self.lags.cutoff_:.1f} Hz and without slow "
            f"samples; the numbers of the arm {numbers}. A free run is of all joints, and judged at those with a named "
            "effect, or at all if there is none.",
            SPLIT,
        ]
        if not self.units[1]:
            notes.append(
                "Some joints slide and others turn: errors of free runs are shares of each joint's rms motion."
            )
        tests = [whiteness(self.gap(m).left, name) for name, m in (("before", base), ("after", model))]
        first = f"Repair the log first: {self.repair}" if self.repair else ""
        return Told(tests, notes, self._pictures(base, model), self._joints(base, model), experiment=first)

    def _pictures(self, base: ArmState, model: ArmState) -> dict[str, Any]:
        """Series of the joint that is reported first, and of all joints."""
        view, j = self.view, self.joint
        n = view.n_joints
        gaps = [view.left(view.fit(m)) for m in (base, model)]
        runs = {name: self.simulate(m, self.headline) for name, m in (("before", base), ("after", model))}
        orders = np.arange(0.5, 40.0, 0.25)
        share = max(view.drive_rms[j], 1e-300)
        rows, name, signals = view.time[view.kept], view.arm.joints[j], self._signals(j)
        motion = signals[f"position of {name}"][1]
        return {
            "time": self.record.time, "measured": self.record.position[:, j],
            "output": f"position of {name}" + (f" ({motion})" if not self.units[1] else ""),
            "runs": {k: x.reshape(-1, n)[:, j] * self.per[j] for k, x in runs.items()},
            "held": self.measured()[1].reshape(-1, n)[:, j], "gap_time": rows, "usable": view.keep[:, j],
            "floor": float(self.floor[j]), "axes": signals, "units": self.units,
            "what": f"{self.gap_word} of {name}, as a share",
            "joints": {
                joint: (rows, view.target[:, i], *(np.where(view.keep[:, i], g[:, i], np.nan) for g in gaps),
                        self.units_at(joint)[0])
                for i, joint in enumerate(view.arm.joints)
            },
            **spectra(
                gaps[0][:, j] / share, gaps[1][:, j] / share, view.step, view.moved.position[view.kept, j], orders
            ),
        }  # fmt: skip

    def system(self, model: ArmState) -> ArmModel:
        """The repaired arm with physical links; with gravity, all its numbers are fitted again."""
        if any(t.kind.cls is Weight for t in model.terms):
            heavy = replace(as_arm(self.lags.robot), gravity=STANDARD_GRAVITY)
            lags = RigidBodyLags(heavy, self.lags.sample_rate, self.lags.law, self.lags.effects)
            other = ArmPlant(self.record, lags, None, self.tolerance)
            other.view = ArmView(lags, self.record)
            none = ArmState(np.zeros(len(lags.base_.names)), model.timing)
            return other.system(
                other.settled(none.with_terms(tuple(t for t in model.terms if t.kind.cls is not Weight)))
            )
        motors, (numbers, spread) = self.view.motors(model), self._measured_numbers(model)
        arm, missing = completed(self._physical(model), model.terms, motors), self.view.held_out(self.view.fit(model))
        errors = np.sqrt(np.maximum(np.diag(spread), 0.0))
        return ArmModel(
            arm, numbers, dt=self.view.dt, logged="position", standard_errors=dict(zip(numbers, errors, strict=True)),
            units={"input": "Nm", "output": "rad"}, covariance=spread, reversals=self.lags.reversals or {},
            unexplained=self._by_joint(missing * self.view.drive_rms), varied=self._by_joint(self.view.varies),
        )  # fmt: skip

    def _by_joint(self, values: Array) -> dict[str, float]:
        return {j: float(x) for j, x in zip(self.view.arm.joints, values, strict=True) if np.isfinite(x)}

    def _measured_numbers(self, model: ArmState) -> tuple[dict[str, float], Array]:
        """Base numbers of the arm with all terms, by name, and their covariance: what a next record starts from."""
        fit, lags = self.linearised(model), self.lags

        def arm_of(x: Array) -> Arm:
            state = fit.rebuild(x)
            arm = lags.interpret(state.numbers, physical=False)
            return parts_of(completed(arm, state.terms, self.view.motors(state)))[0]

        other = RigidBodyLags.of_arm(arm_of(fit.x), lags.sample_rate).fit(self.record.position)
        numbers, steps = other.weights_of(arm_of(fit.x)), CHANGED * np.maximum(np.abs(fit.x), CHANGED)
        moved = (other.weights_of(arm_of(fit.x + row)) - numbers for row in np.diag(steps))
        slopes = np.column_stack([change / step for change, step in zip(moved, steps, strict=True)])
        spread = slopes @ fit.covariance @ slopes.T
        return dict(zip(other.base_.names, map(float, numbers), strict=True)), spread


def outermost(looks: list[Look], arm: Arm) -> list[Look]:
    """The looks without a load at a link if one further out explains as much: on a joint's axis, both move alike.

    Nor is there a load if the inertia of a joint explains as much: a mass that does no more has its centre on the axis
    of another joint, which three numbers would have to hit by chance.
    """
    terms = [(k.start, k) for k in looks if isinstance(k.start, JointTerm)]
    loads = {arm.index(t.joint): k for t, k in terms if t.kind.cls is Load}
    motors = [(arm.n_joints, k) for t, k in terms if t.kind.cls is JointInertia and t.kind.index is not None]
    beside = [*loads.items(), *motors]
    inner = [k for i, k in loads.items() if any(j > i and other.gain > k.gain - ALIKE for j, other in beside)]
    return [k for k in looks if not any(k is one for one in inner)]


def record_of(log: Any, arm: Arm) -> ArmRecord:
    """Return the record of an arm; raise an error that says what is wrong with the log."""
    wanted = f"expected time (n,), positions and drives (n, {arm.n_joints}) of {', '.join(arm.joints)}, in that order"
    starts = None
    if isinstance(log, ArmRecord):
        log, starts = (log.time, log.position, log.drive), log.starts
    if hasattr(log, "columns"):
        log = _of_frame(log, arm)
    if not isinstance(log, tuple) or len(log) != 3:
        raise ValueError(f"The log of an arm is a {type(log).__name__}, {wanted}; give fit((time, positions, drives)).")
    time, position, drive = signals = [np.asarray(x, dtype=float) for x in log]
    n, shapes = time.size, [x.shape for x in signals]
    if shapes != [(n,), (n, arm.n_joints), (n, arm.n_joints)] or n < 2:
        raise ValueError(f"The log has shapes {', '.join(map(str, shapes))}, {wanted}.")
    steps = np.diff(time)
    if not all(np.isfinite(x).all() for x in signals) or np.any(steps <= 0.0):
        raise ValueError("The log has missing values or a time that does not increase; repair or remove those rows.")
    if starts is None:
        starts = tuple((np.flatnonzero(holes_in(steps)) + 1).tolist())
    return ArmRecord(time, position, drive, starts)


def _of_frame(frame: Any, arm: Arm) -> tuple[Any, Any, Any]:
    """Time, positions and drives of a frame with the columns of `whsklearn.datasets.make_arm_log`."""
    units = [("m", "n") if slides else ("rad", "nm") for slides in arm.slides]
    places, drives = (
        [f"{name}_{what}_{unit[i]}" for name, unit in zip(arm.joints, units, strict=True)]
        for i, what in enumerate(("position", "torque"))
    )
    if missing := [c for c in ("time_s", *places, *drives) if c not in frame.columns]:
        raise ValueError(
            f"The log of an arm is a DataFrame without {', '.join(missing)}; rename its columns, or give "
            "fit((time, positions, drives)) in SI."
        )
    return frame["time_s"].to_numpy(), frame[places].to_numpy(), frame[drives].to_numpy()


def arm_plant(model: Any, log: Any, *, law: str | None, tolerance: float) -> ArmPlant:
    """The plant of a log; where its time has holes, it falls into segments.

    The effects at the joints of an `Arm` are its base law; the numbers of an `ArmModel` stay fixed.
    """
    arm, terms = parts_of(model.arm if isinstance(model, ArmModel) else model)
    record = record_of(log, arm)
    lags = RigidBodyLags.of_arm(arm, 1.0 / record.dt, law, reversals=getattr(model, "reversals", None))
    if not isinstance(model, ArmModel):
        return ArmPlant(record, lags, model, tolerance, given=() if law else terms)
    lags.fit(record.position)
    return ArmPlant(record, lags, model, tolerance, Known.of(model, lags.base_.names), terms)
