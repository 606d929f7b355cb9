"""A physical axis, fitted by its free run from an inverse-dynamics start."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from whsklearn.effects import (
    Coulomb,
    EarlyReversal,
    FlexibleCoupling,
    FrictionLaw,
    InputOffset,
    LoadFriction,
    SpeedHinge,
    Viscous,
)
from whsklearn.effects.base import Array
from whsklearn.filtering.records import HOLDS
from whsklearn.identification.axis_inverse import FEWEST_TURNS, Start, acting, form_columns, inverse_starts, next_wave
from whsklearn.identification.axis_numbers import (
    PIECE,
    axis_log,
    axis_residual,
    coarse,
    in_pieces,
    position_effects,
    shooting_log,
)
from whsklearn.identification.linear_fit import fit_output_error
from whsklearn.identification.view import View, derivative, window_of
from whsklearn.identification.windows import axis_score
from whsklearn.models import AxisModel
from whsklearn.models.axis import spring_steps
from whsklearn.recursion.batch.axis_free_run import (
    HANGS,
    LARGEST,
    SETTLING,
    AxisFit,
    AxisForm,
    AxisLog,
    axis_motion,
    behind_the_spring,
    beside_the_states,
    costs,
    covariance_of,
    fit_pieces,
    handed_over,
    sensitivities,
    settled,
)
from whsklearn.validation import whiteness_test

KNOTS = (0.1, 0.3, 0.6, 0.85)  # quantiles of speed at which a free law may bend
SHOOTING = (
    0.25,
    0.5,
    2.0,
)  # s, lengths of the pieces of multiple shooting: from those fitted first to those by which windows are judged
# Of the rms drive: a force that is fitted where there is none, and that happens to help on held-out data, is up to 0.2
# % (benchmarks/which_structure.py, gravity of axes of MuJoCo)
LEAST_FORCE = 0.01
# Of the squared residual that one order must take off: chance, the best of 2,000 orders, takes 2 ln(2000) / n, or 0.03
# of 500 independent samples; and how many orders are sought, as a motor's poles, slots and gear have one each
LEAST_WAVE, MOST_ORDERS = 0.1, 3
TUNINGS, TUNED = 4, 0.01  # steps of the orders at most, and rad over the travel by which the last turns a phase
# Of the error with a held drive, below which a smooth one is preferred, or friction that reverses early
SMOOTHER = 0.95
AT_REST = (EarlyReversal().lead, EarlyReversal().impedance)  # MuJoCo's own, from which they are fitted
LEAST_LINEAR = 0.5  # share of the variance that the best linear model may leave; above it no start is close
LONG = 20_000  # samples of the first fits of an axis on a spring; the last fit uses all
# Of the sum of squares over the next shorter pieces, above which the errors of a run in one piece are not independent;
# and how much the logarithm of the product of all variances may be larger than the least
GROWS, NO_WORSE = 1.5, 1.0
AS_LOW = 1.1  # of the least sum of squares, or error over windows: fits that explain a record as well
TINY = 1e-100
# Of the highest speed, below which samples do not count for inverse dynamics: those at rest, and those at which
# friction may be rounded, to which a jump at standstill and viscous friction are fitted as well as they can be
SLOWEST_OF = (0.02, 0.2)
LEVEL = 0.01  # of the test for whiteness
LEAST_TESTED = 60  # samples, somewhat more than twice the lags of the test
BLOCKS = 20  # blocks of the scores of inverse dynamics: each must be longer than the correlation of the missing torque


class UntoldError(ValueError):
    """A weight that a record does not tell from other forces over the position."""


def fit_rigid_axis(log: View, *, loaded: bool = False) -> AxisModel:
    """Inertia, viscous and Coulomb friction, offset, in SI; with friction that grows with the drive if ``loaded``.

    Raises ValueError if it does not surely grow, or as `inverse_starts`.
    """
    model, own = _fit(log, AxisForm(loaded=loaded))
    return determined(model, own) if loaded else model


def fit_free_law_axis(log: View) -> AxisModel:
    """The same with friction bent at four speeds.

    Raises ValueError if the bends are negligible, or as `inverse_starts`.
    """
    speed = np.abs(log.target)
    model, _ = _fit(log, AxisForm(np.unique(np.quantile(speed[speed > 0.02 * speed.max()], KNOTS))))
    return _with_force(model, model.law(0.0, log.target), log)


def fit_hanging_axis(log: View, *, loaded: bool = False, sprung: bool = False) -> AxisModel:
    """The rigid axis with gravity; the output is its position, an angle, which gravity prevents from drifting.

    A spring acts beside gravity if the axis is ``sprung``.  Raises ValueError if gravity or the spring is negligible or
    gravity cancels an offset, or as `fit_rigid_axis`.
    """
    record, form = _of_position(log), AxisForm(orders=HANGS, powers=int(sprung), loaded=loaded)
    if sprung:
        inertia, *_, stiffness = inverse_starts(record, form)[0].theta
        record = replace(record, steps=max(record.steps, spring_steps(abs(stiffness) / inertia, record.dt)))
    model, own = _with_weight(record, form, log)
    if not abs(model.parameters["input_offset"]) > 2.0 * model.standard_errors["input_offset"]:
        # over part of a turn an offset that is not there cancels a weight that is not, until the axis turns further
        model, own = _with_weight(record, form._replace(shifted=False), log)
    numbers = model.parameters
    if abs(numbers["input_offset"]) > np.abs(log.u).max():
        raise UntoldError(
            f"Gravity would cancel an offset of the drive of {numbers['input_offset']:.2g}, more than it ever was: "
            "over this range a weight cannot be told from other forces that follow the position."
        )
    return determined(model, own)


def _with_weight(record: View, form: AxisForm, log: View) -> tuple[AxisModel, dict[str, float]]:
    """The fit of an axis with a weight, if it and a spring beside it are enough of the drive to be there."""
    model, own = _fit(record, form)
    forces = {"Gravity": model.parameters["gravity_imbalance"]}
    if form.powers:
        forces["The spring"] = abs(model.parameters["cable_spring"]) * float(np.std(log.y))
    for name, force in forces.items():
        if (share := force / np.std(log.u)) < LEAST_FORCE:
            raise ValueError(f"{name} would be {100 * share:.2g} % of the drive, so the axis without it is equivalent.")
    return model, own


def fit_placed_axis(log: View, powers: int) -> AxisModel:
    """The rigid axis with a force that is a polynomial of the position, whatever its cause; the output is its position.

    Raises ValueError if the force is negligible, or as `inverse_starts`.
    """
    record, form = _of_position(log), AxisForm(powers=powers)
    try:
        more = [spring_start(replace(log, logged="output", target=log.y))]
    except ValueError:
        more = []
    inertia, *_, stiffness = (more or [inverse_starts(record, AxisForm(powers=1))[0].theta])[0]
    record = replace(record, steps=max(record.steps, spring_steps(stiffness / inertia, record.dt)))
    model, own = _fit(record, form, [np.r_[theta, np.zeros(powers - 1)] for theta in more])
    force, line = sum(e.value(position=log.y) for e in model.effects[1:]), [log.y] * (powers > 1)
    return determined(_with_force(model, force, log, line), own)


def fit_cogging_axis(log: View, *, hangs: bool = False) -> AxisModel:
    """The rigid axis with up to `MOST_ORDERS` waves over its position, the output, beside gravity if it ``hangs``.

    Raises ValueError if there is none, or as `inverse_starts`.
    """
    form = AxisForm(orders=HANGS if hangs else HANGS[:0])
    for _ in range(MOST_ORDERS):
        order, share, size = next_wave(log, form)
        if share < LEAST_WAVE or size < LEAST_FORCE:
            break
        tuned = _tuned(log, form._replace(orders=np.append(form.orders, order)))
        if tuned is None:
            break
        form = tuned
    if form.orders.size == hangs:
        raise ValueError("No wave over the position is found in what is left of the drive.")
    return determined(*_fit(log, form))


def _tuned(log: View, form: AxisForm) -> AxisForm | None:
    """The form with the orders of its waves by the free run, in Gauss-Newton steps from those of inverse dynamics.

    None if the run does not surely show the last wave, or if one has less than two periods over the travel.  Over many
    turns a small error of an order is a large one of the phase: 0.001 of 12 left three times the noise.  A step that
    turns the phase by more than a quarter is not taken.  An order that was found while another wave was missing takes
    more than one step.
    """
    theta = min((s.theta for s in inverse_starts(log, form)), key=lambda theta: axis_score(theta, form, log))
    last = slice(form.growth.start - 2, form.growth.start)
    for _ in range(TUNINGS):
        pieces = shooting_log(log, SHOOTING[1], form)
        theta, covariance, _, cost = fit_pieces(theta, pieces)
        if not np.isfinite(cost):
            return None
        amplitude = float(np.linalg.norm(theta[last]))
        spread = float(np.sqrt(theta[last] @ covariance[last, last] @ theta[last])) / max(amplitude, TINY)
        if not max(2.0 * spread, np.sqrt(2.0) * LEAST_FORCE * np.std(log.u)) < amplitude:
            return None
        found = _of_orders(theta, handed_over(theta, settled(theta, pieces)))
        if found is None:
            break
        orders, turned = form.orders.copy(), np.abs(found.estimate) * np.ptp(log.y)
        orders[orders != HANGS[0]] += np.where(turned < np.pi, found.estimate, 0.0)
        if not orders[orders != HANGS[0]].min() * np.ptp(log.y) >= FEWEST_TURNS:
            return None
        form = form._replace(orders=orders)
        if turned.max() < TUNED:
            break
    return form


def _with_force(model: AxisModel, force: Array, log: View, more: Sequence[Array] = ()) -> AxisModel:
    """The model, if its force over the record differs from viscous and Coulomb friction and an offset by enough, and
    from what a simpler model has ``more``, (n,) each.
    """
    plain = np.column_stack([log.target, np.sign(log.target), np.ones_like(log.target), *more])
    own = force - plain @ np.linalg.lstsq(plain, force, rcond=None)[0]
    share = float(np.std(own) / np.std(log.u))
    if share < LEAST_FORCE:
        raise ValueError(f"It would add {100 * share:.2g} % to the drive, so a simpler axis is equivalent.")
    return model


def fit_sprung_axis(log: View, powers: int) -> AxisModel:
    """The rigid axis on a spring with the given number of powers of the position, which is the output.

    The drive is taken either as held between samples or as a smooth signal, whichever leaves the smaller error; the two
    differ for a system whose phase changes by half a radian per sample, such as the Silverbox.

    Raises ValueError if the best linear model of second order is not a mass on a spring, or explains almost none of the
    record.
    """
    record = _of_position(log)
    theta, form = spring_start(log), AxisForm(powers=powers)
    theta = np.r_[theta, np.zeros(powers - 1)]
    steps = max(spring_steps(theta[4] / theta[0], log.dt) // 2, 1)
    short = record.part(0, min(record.u.size, LONG))
    found = []
    for hold in HOLDS:
        early = replace(short, steps=steps, hold=hold)
        ended = AxisFit(theta, theta, theta, np.inf)
        for seconds in (*SHOOTING, np.inf):
            ended = fit_pieces(ended.theta, shooting_log(early, seconds, form))
        found.append((ended.cost, ended.theta, hold))
    _, theta, hold = min(found, key=lambda f: f[0])
    whole = replace(record, steps=steps, hold=hold)
    best = without_step(fit_pieces(theta, shooting_log(whole, np.inf, form)), whole, np.inf, form)
    if not np.isfinite(best.cost):
        raise ValueError("The run of an axis on a spring does not stay finite.")
    model, _ = model_of(best, whole, form, np.inf)
    if model.steps > spring_steps(np.pi**2, 1.0):
        raise ValueError("The axis would oscillate on its spring faster than half the sampling rate can show.")
    return model


def determined(model: AxisModel, own: dict[str, float]) -> AxisModel:
    """The model, if the record tells of a load behind a spring its inertia, of a weight on which side it is, of a
    spring whether it pulls or pushes, of cogging that it is there, and of friction whether it grows with the drive.

    What is free to be anything else is spent on the friction at rest: of a rigid axis that rests, a load of 0.1 of the
    inertia on a spring of no stiffness left two thirds of the error over windows.  The inertia of a weight may be free:
    that of a geared hobby servo is little beside its friction, and a slow motion says nothing of it.  A number of which
    two estimators differ is not free, so for inertia and friction the errors of the fit alone count, which are its
    ``own``.
    """
    errors, numbers = model.standard_errors, model.parameters
    inertia, unsure = numbers["inertia"], own["inertia"]
    coupled = any(isinstance(e, FlexibleCoupling) for e in model.effects)
    if coupled and not 2.0 * unsure < inertia:  # its interval holds zero
        raise ValueError(f"Its inertia would be {inertia:.2g} with a standard error of {unsure:.2g}.")
    both = {"cable_spring", "gravity_imbalance"} <= set(numbers)
    if both and not 2.0 * errors.get("gravity_imbalance", 0.0) <= numbers["gravity_imbalance"]:
        raise UntoldError("The weight cannot be told from the spring, so the axis with one of them is equivalent.")
    if errors.get("gravity_imbalance__phase", 0.0) > 1.0:  # rad
        raise UntoldError("On which side the weight is cannot be told, so the axis without it is equivalent.")
    if not max(2.0 * own.get("load_friction", 0.0), LEAST_FORCE) < numbers.get("load_friction", 1.0):
        raise ValueError("Friction does not surely grow with the drive, so the axis without it is equivalent.")
    waves = [k for k in numbers if k.startswith("cogging") and "__" not in k]
    if not all(2.0 * errors.get(k, 0.0) <= numbers[k] for k in waves):
        raise ValueError("A wave over the position may be nothing, so the axis without it is equivalent.")
    alone = "hardening_spring" not in numbers
    if alone and not 2.0 * errors.get("cable_spring", 0.0) <= abs(numbers.get("cable_spring", 0.0)):
        raise ValueError("Whether the spring pulls or pushes cannot be told, so the axis without it is equivalent.")
    return model


def without_step(fit: AxisFit, log: View, seconds: float, form: AxisForm) -> AxisFit:
    """A fit of pieces without the bias of its integration step, by another one with half of the step.

    Leapfrog has an error of the second order in the step, so (4 theta(h / 2) - theta(h)) / 3 has one of the fourth
    (Richardson 1911).  At 0.1 rad of an oscillation per step, an inertia of 0.002 % is 0.08 % too small.
    """
    finer = fit_pieces(fit.theta, shooting_log(replace(log, steps=2 * log.steps), seconds, form))
    theta = np.clip(finer.theta + (finer.theta - fit.theta) / 3.0, *form.limits)
    theta[0] = max(theta[0], 0.5 * finer.theta[0])
    return finer._replace(theta=theta)


def _of_position(log: View) -> View:
    """The record with its output as the position of an axis."""
    return replace(log, logged="position", target=derivative(log.y, log.dt, log.bounds)[0])


def spring_start(log: View) -> Array:
    """Inertia, viscous and Coulomb friction, offset and stiffness of the best linear model of second order."""
    linear = fit_output_error(log, 2)
    left = np.concatenate([log.y[a:b] - linear.simulate(log.u[a:b]) for a, b in itertools.pairwise(log.bounds)])
    if not np.var(left) < LEAST_LINEAR * np.var(log.y):
        raise ValueError("The best linear model of second order explains almost nothing of the output.")
    poles = np.log(np.roots(linear.denominator).astype(complex)) / log.dt
    gain = sum(linear.numerator) / sum(linear.denominator)
    square, fade = float(np.prod(poles).real), float(-np.sum(poles).real)
    if not (gain > 0.0 and square > 0.0 and fade > 0.0 and abs(np.sum(poles).imag) < 1e-9 * abs(poles).max()):
        raise ValueError("The best linear model of second order is not a mass on a spring.")
    stiffness = 1.0 / gain
    return np.array([stiffness / square, stiffness * fade / square, 0.0, -stiffness * linear.offset, stiffness])


def _fit(log: View, form: AxisForm, more: Sequence[Array] = ()) -> tuple[AxisModel, dict[str, float]]:
    """Among the results of all fits, the parameters that simulate windows of the record best.

    A controller that is faster than its log acts between the samples too, so the drive is also taken as a smooth curve
    through them. Held, it acts half a sample late, which is what limits a robot's log of 100 Hz.  If the residual is
    not white, dry friction may reverse early, as that of a solver of contacts: taken for one that holds at once, that
    of MuJoCo put inertias 1 % off, at up to 10 standard errors.  Something else that is missing may look so too, such
    as cogging, but then its lead is not known.  It can also look like the other behaviour of the drive, so both are
    tried with it.
    """
    held = coarse(log)
    smooth = replace(held, hold=HOLDS[1])
    best, hold = _best_of(held, form, more), held.hold
    other = _best_of(smooth, form, [best.fit.theta], best)
    tried = (held, best), (smooth, other)
    if other.score < SMOOTHER * best.score:
        best, hold = other, smooth.hold
    whole = replace(log, hold=hold)
    ended = _finished(best, whole, form)
    if log.target.min() < 0.0 < log.target.max() and not white(axis_residual(ended.fit.theta, whole, form), whole):
        early = form._replace(early=True)
        lead = early.reversal.start
        found = None
        for record, plain in tried:
            start = np.insert(plain.fit.theta, lead, AT_REST)
            # from the shortest pieces, as the other numbers have to move away from those without it
            found = _best_of(record, early, [start], found)
            least = found.fit.theta[lead] - 2.0 * np.sqrt(found.fit.covariance[lead, lead])
            if found.score < best.score and least > early.limits[0][lead]:
                best, whole, form = found, replace(log, hold=record.hold), early
        if form.early:
            ended = _finished(best, whole, form)
    return model_of(ended.fit, whole, form, ended.seconds)


def _finished(found: Minimum, log: View, form: AxisForm) -> Minimum:
    """A fit of a search with all fine steps of the record; one that `grows` keeps its errors, and a start itself."""
    if coarse(log).steps == log.steps or not found.fit.covariance.any():
        return found
    ended = fit_pieces(found.fit.theta, in_pieces(log, form, found.seconds))
    if not np.isfinite(ended.cost):
        return found
    return found._replace(fit=ended._replace(covariance=found.fit.covariance) if found.grows else ended)


class Minimum(NamedTuple):
    """A fit over pieces of so many ``seconds``, and its error over windows, which is least for pieces of ``nearest``.

    ``grows``: whether it is of one piece whose sum of squares is much larger than that of the pieces before.
    """

    score: float
    fit: AxisFit
    seconds: float = np.inf
    grows: bool = False
    nearest: float = np.inf


def _best_of(log: View, form: AxisForm, more: Sequence[Array], rival: Minimum | None = None) -> Minimum:
    """The best of the fits of a record with one hold, from the best of its own starts and of ``more`` numbers.

    The other behaviour of the drive of a ``rival`` is fitted over the pieces that suit the rival first, and over others
    only where it is better.
    """
    starts = inverse_starts(log, form)
    starts += [starts[0]._replace(theta=theta) for theta in more]
    least, start = min(((axis_score(s.theta, form, log), s) for s in starts), key=lambda pair: pair[0])
    found = Minimum(least, start_as_fit(start, axis_log(log, form)))
    lengths = (*SHOOTING, np.inf) if log.logged == "position" else (np.inf,)
    if rival is None:
        return _best_minimum(log, form, start, found, lengths)
    first = _best_minimum(log, form, start, found, (rival.nearest,))
    return first if first.score >= SMOOTHER * rival.score else _best_minimum(log, form, start, first, lengths)


def model_of(best: AxisFit, log: View, form: AxisForm, seconds: float) -> tuple[AxisModel, dict[str, float]]:
    """The numbers of a fit over pieces of so many seconds as an axis, with standard errors, and those of the fit alone,
    whatever is missing.
    """
    free = np.less(*form.limits)
    covariance = best.covariance
    if not form.coupled and covariance.any():
        age = long = _of_timing(best.theta, in_pieces(log, form))
        if log.logged == "position" and seconds != PIECE:
            # what a timing does to a fit is what it does over the fit's pieces; long ones know it better
            age = _of_timing(best.theta, in_pieces(log, form, seconds))
        if age is not None and long is not None:
            covariance = age._replace(estimate=long.estimate, covariance=long.covariance).widened(covariance)
    orders = None
    if (form.orders != HANGS[0]).any() and covariance.any():
        pieces = shooting_log(log, SHOOTING[1], form)  # noise of the drive adds up along longer ones
        orders = _of_orders(best.theta, handed_over(best.theta, settled(best.theta, pieces)))
        covariance = covariance if orders is None else orders.widened(covariance)
    covariance = covariance * np.outer(free, free)
    alone = standard_errors(best.theta, covariance, log, form)
    incomplete = not covariance.any() or not white(axis_residual(best.theta, log, form), log)
    if incomplete and not form.coupled:
        # two estimators agree if nothing is missing, and their difference shows what is (Hausman 1978): its square less
        # the variance of the other estimates the squared bias, which is nothing where inverse dynamics says little
        others = [_of_torques(best.theta, log, form, slowest) for slowest in SLOWEST_OF[: 2 - bool(form.knots.size)]]
        errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        apart, spread = (np.array([o[k] for o in others]) for k in (0, 1))
        apart = (best.theta - apart) ** 2
        wider = np.sqrt(errors**2 + np.maximum(apart - spread**2, 0.0).max(axis=0))
        if errors[free].min() > TINY * wider[free].max():
            scale = wider / np.where(free, errors, 1.0)
            covariance = covariance * np.outer(scale, scale)
        else:  # those of a diverged run are arbitrary, and the start itself has none
            covariance = np.diag(errors**2 + spread[0] ** 2 + apart[0]) * free
    model = axis_of(best.theta, log, form)
    known = standard_errors(best.theta, covariance, log, form)
    if orders is not None:
        names = [k for k in model.parameters if k.endswith("__order")]
        known |= dict(zip(names, np.sqrt(np.diag(orders.mean_square)).tolist(), strict=True))
    return replace(model, standard_errors=known), alone


class Unfitted(NamedTuple):
    """What a fit leaves of numbers that it keeps fixed: by how much they are off (q,), with what covariance (q, q), and
    the numbers of the fit as functions of them, to first order (p, q).
    """

    estimate: Array
    covariance: Array
    by: Array

    @property
    def mean_square(self) -> Array:
        """Square of what they are off by, shape (q, q): the covariance, and what the estimate's square has beyond it.

        The square of an estimate is expected to be that of the truth and the variance, so their sum counts this twice.
        """
        beyond = float(self.estimate @ np.linalg.pinv(self.covariance, hermitian=True) @ self.estimate)
        share = max(1.0 - 1.0 / beyond, 0.0) if beyond > 0.0 else 0.0
        return np.asarray(self.covariance + share * np.outer(self.estimate, self.estimate))

    def widened(self, covariance: Array) -> Array:
        """A covariance of the fit (p, p) with what these numbers add to it."""
        return np.asarray(covariance + self.by @ self.mean_square @ self.by.T)


def _unfitted(theta: Array, pieces: AxisLog, others: list[AxisLog], steps: Array) -> Unfitted | None:
    """Of numbers by which the logs of ``others`` differ by ``steps`` (q,); None if the run diverges."""
    run, rows = sensitivities(theta, pieces)
    if not np.abs(run).max() < LARGEST:  # beyond it, differences are not numbers
        return None
    fixed = [(axis_motion(theta, other) - run) / step for other, step in zip(others, steps, strict=True)]
    both, _ = beside_the_states(np.vstack([*fixed, rows]), pieces)
    error, q = pieces.target - run, len(others)
    if not max(np.abs(both).max(), np.abs(error).max()) < LARGEST:
        return None
    by = np.asarray(np.linalg.lstsq(both[q:].T, both[:q].T, rcond=1e-9)[0], dtype=float)
    alone = both[:q] - by.T @ both[q:]
    scale = np.linalg.norm(alone, axis=1) + TINY
    estimate = np.linalg.lstsq((alone / scale[:, None]).T, error, rcond=1e-9)[0] / scale
    # without one of fewer pieces than numbers, some direction is not seen at all
    bounds = pieces.bounds if pieces.bounds.size > both.shape[0] + 1 else pieces.bounds[[0, -1]]
    return Unfitted(estimate, covariance_of(both, error, np.r_[estimate, theta], bounds)[:q, :q], by)


def _of_timing(theta: Array, pieces: AxisLog) -> Unfitted | None:
    """The unknown age of the drive, in fine steps, of which only the whole samples are known.

    A controller that is faster than its log holds its drive, so the drive acts about half of the controller's period
    later than a curve through the samples.  The inertia of viscous axes in such loops was up to 2 % off, at 20 standard
    errors.  A drive that is held has an age too: that of a computation, or of a simulation whose position is half a
    step ahead.  A fortieth of a sample put viscous friction 0.3 % off, at 8 standard errors.
    """
    pieces = handed_over(theta, settled(theta, pieces))
    flat, steps = pieces.u.ravel(), pieces.u.shape[1]
    begins = pieces.bounds[:-1] * steps
    later = np.r_[flat[0], flat[:-1]]
    later[begins] = flat[begins]
    age = _unfitted(theta, pieces, [pieces._replace(u=later.reshape(pieces.u.shape))], np.ones(1))
    if age is None:
        return None
    known = steps**2 / 12.0  # whole samples are found before any fit, by `skew`; what is left is uniform
    share = known / (known + age.covariance)
    return age._replace(estimate=share[0] * age.estimate, covariance=share * age.covariance)


def _of_orders(theta: Array, pieces: AxisLog) -> Unfitted | None:
    """The orders of all waves but gravity, in 1/rad."""
    form = pieces.form
    steps = np.diag(1e-5 * form.orders)[form.orders != HANGS[0]]
    others = [pieces._replace(form=form._replace(orders=form.orders + step)) for step in steps]
    return _unfitted(theta, pieces, others, steps.max(axis=1))


def axis_of(theta: Array, log: View, form: AxisForm) -> AxisModel:
    """Convert the kernel's numbers to an axis."""
    grows, last = form.growth, theta.size - form.knots.size
    more, effects = (
        (0.0, [*behind_the_spring(theta)]) if form.coupled else position_effects(theta[4 : grows.start], form)
    )
    effects += [LoadFriction(c) for c in theta[grows].tolist()]
    effects += [EarlyReversal(*theta[form.reversal].tolist())] * form.early
    hinges = [SpeedHinge(w, k) for w, k in zip(theta[last:], form.knots, strict=True)]
    return AxisModel(
        float(theta[0]),
        FrictionLaw([Viscous(theta[1]), Coulomb(theta[2]), *hinges]),
        (InputOffset(float(theta[3]) + more), *effects),
        hold=log.hold,
        side="load" if form.at_load else "motor",
        dt=log.dt,
        logged="position" if log.logged == "position" else "velocity",
    )


def standard_errors(theta: Array, covariance: Array, log: View, form: AxisForm) -> dict[str, float]:
    """Standard errors of the axis' own numbers, to first order; knots and orders, which a fit keeps, have none here."""
    names = [k for k in axis_of(theta, log, form).parameters if not k.endswith(("__knot", "__order"))]

    def numbers(at: Array) -> Array:
        known = axis_of(at, log, form).parameters
        return np.array([known[k] for k in names])

    steps = np.maximum(1e-6 * np.abs(theta), 1e-9 * np.sqrt(np.maximum(np.diag(covariance), 0.0)) + 1e-300)
    if form.coupled:  # a share whose error is large stays a share
        steps[-3:] = 1e-6 * theta[-3:]
    slopes = np.array([(numbers(theta + d) - numbers(theta)) / h for d, h in zip(np.diag(steps), steps, strict=True)]).T
    spread = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", slopes, covariance, slopes), 0.0))
    return dict(zip(names, spread.tolist(), strict=True))


def _best_minimum(log: View, form: AxisForm, start: Start, found: Minimum, lengths: Sequence[float]) -> Minimum:
    """The best fit from ``found``: a position over pieces of these lengths (s), the shortest first, else as one run.

    If gravity is large compared with the inertia, the free run from a slightly wrong start diverges within a second,
    and its least squares end anywhere. Therefore the best start is first fitted over sufficiently short pieces, and
    among all results the one that simulates windows best is used.
    """
    least, theta = found.score, found.fit.theta
    better: list[Minimum] = []
    for seconds in lengths:
        pieces = settled(theta, in_pieces(log, form, seconds), SETTLING)
        if better and _lost(theta, pieces):
            break
        ended = fit_pieces(theta, pieces)
        if np.isfinite(ended.cost) and start.holds(ended.theta):
            reached = axis_score(ended.theta, form, log)
            grows = np.isinf(seconds) and bool(better) and ended.cost > GROWS * better[-1].fit.cost
            if (
                reached < AS_LOW * least
            ):  # a start has no errors of its own, so it stays only where it is clearly better
                least, theta = min(reached, least), ended.theta
                better.append(Minimum(reached, ended, seconds, grows))
    return best_known(better) if better else found


def _lost(theta: Array, pieces: AxisLog) -> bool:
    """Whether runs of pieces leave more than the means of the pieces do: then what they leave says nothing of the
    numbers, as in `mean_error`, and a descent from there wanders about.
    """
    error = pieces.target - axis_motion(theta, handed_over(theta, pieces))
    return not costs(error, pieces).sum() < costs(pieces.target, pieces, level=True).sum()


def best_known(found: list[Minimum]) -> Minimum:
    """The fit over the longest pieces of those that predict windows as well and know their numbers as well.

    Noise of the drive and missing torques add up along a run, so that of a long run the first seconds decide, and its
    numbers are known less well than those of pieces. Noise of the position does not, and then a long run is best.
    A run in one piece does not show how far its own errors are independent, so its sum of squares must not be larger.
    If it is, but predicts windows so much better that it is used, its numbers are known as well as those of the pieces
    before it, from which they differ: of an axis with 0.5 % of noise in its drive, a weight was 13 of the run's own
    standard errors off.

    ``found``: from the shortest pieces to the longest.
    """
    nearest = min(found, key=lambda f: f.score)
    alike = [f for f in found if f.score <= AS_LOW * nearest.score]
    honest = [f for f in alike if not f.grows] or alike
    unknown = [float(np.sum(np.log(np.diag(f.fit.covariance) + TINY))) for f in honest]
    known = zip(honest[::-1], unknown[::-1], strict=True)
    best = next(f for f, u in known if u <= min(unknown) + NO_WORSE)
    if best.grows:
        pieces = found[-2].fit
        apart = best.fit.theta - pieces.theta
        best = best._replace(fit=best.fit._replace(covariance=pieces.covariance + np.outer(apart, apart)))
    return best._replace(nearest=nearest.seconds)


def start_as_fit(start: Start, log: AxisLog) -> AxisFit:
    """The inverse-dynamics estimate, if nothing simulates better; its errors are the difference of two estimators."""
    error = log.target - axis_motion(start.theta, log)
    return AxisFit(start.theta, np.zeros((start.theta.size,) * 2), error, 0.0)


def white(error: Array, log: View) -> bool:
    """Whether the error of a free run is white, by Ljung and Box; of a smoothed velocity it is taken a window apart."""
    apart = error[:: window_of(log.y.size, log.dt) if log.logged == "position" else 1]
    if not np.isfinite(apart).all():  # it diverged
        return False
    if apart.size <= LEAST_TESTED or not np.ptp(apart) > 1e-9 * np.ptp(log.in_si.y):  # exact but for rounding
        return True
    return whiteness_test(apart).p_value > LEVEL


def _of_torques(theta: Array, log: View, form: AxisForm, slowest: float) -> tuple[Array, Array]:
    """The numbers by inverse dynamics without its own bias, and their standard errors.

    What differentiation, sampling and the encoder do to them, they also do in a record that the model makes of itself
    (indirect inference, Gourieroux, Monfort and Renault 1993).  With that bias, intervals of complete axes were 10 to
    100 times as wide as their errors.
    """
    pieces = in_pieces(log, form)
    cut = replace(log, starts=tuple(pieces.bounds[1:-1].tolist()))
    found, spread = inverse_dynamics(cut, form, slowest)
    run = axis_motion(theta, handed_over(theta, settled(theta, pieces)))
    if not np.abs(run).max() < LARGEST:
        return found, spread
    # its size from the third differences of the error, in which torques are nothing (`noise_floor`), within the pieces,
    # between which the run jumps: of a log at 100 Hz that made the noise five times as large
    error = pieces.target - run
    third = np.concatenate([np.diff(error[i:j], 3) for i, j in itertools.pairwise(pieces.bounds)])
    size = np.std(third) / np.sqrt(20.0)
    noise = size * np.random.default_rng(0).standard_normal(run.size)
    own = replace(cut, y=run + noise) if log.logged == "position" else replace(cut, y=run + noise, target=run + noise)
    return found - (inverse_dynamics(own, form, slowest)[0] - theta), spread


def inverse_dynamics(log: View, form: AxisForm, slowest: float) -> tuple[Array, Array]:
    """The numbers by least squares of the torque balance along the measured motion, and their standard errors.

    In closed loop the motion hardly contains the missing torque, while the drive does. These estimates therefore stay
    near the truth where those of a free run, whose input contains the missing torque, do not. The errors are block
    sandwich estimates. On 20 axes with cogging of 7 % of the drive, the intervals of a free run alone contained the
    inertia of 9, and those widened by both estimators that of all 20 (tests/identification/test_axis_fit.py measures
    it).
    """
    from scipy.signal import savgol_filter

    window = window_of(log.y.size, log.dt)
    place = log.y if log.logged == "position" else log.target
    velocity, acceleration = derivative(place, log.dt, log.bounds)
    if log.logged != "position":
        velocity, acceleration = savgol_filter(log.target, window, 2), velocity
    side = np.sign(velocity)
    columns = [acceleration, velocity, side, np.full_like(velocity, form.shifted)]
    columns += form_columns(log.y, velocity, side, acting(log), form)
    moving = np.abs(velocity) > slowest * np.abs(velocity).max()
    rows = np.column_stack(columns) * moving[:, None]
    scale = np.linalg.norm(rows, axis=0)
    scale[scale == 0.0] = 1.0
    rows = rows / scale
    drive = savgol_filter(acting(log), window, 2) * moving
    inverse = np.linalg.pinv(rows.T @ rows, rcond=1e-12, hermitian=True)
    theta = inverse @ (rows.T @ drive)
    edges = np.linspace(0, drive.size, BLOCKS + 1).astype(int)[:-1]
    scores = np.add.reduceat(rows * (drive - rows @ theta)[:, None], edges, axis=0)
    return theta / scale, np.sqrt(np.maximum(np.diag(inverse @ (scores.T @ scores) @ inverse), 0.0)) / scale
