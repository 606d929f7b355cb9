"""Warnings about a record or a setting, in one sentence each; None if there is nothing to warn about."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import t as student_t

from whsklearn.effects.base import Array, Bools, Integers
from whsklearn.effects.law import FrictionLaw
from whsklearn.effects.rows import law_values
from whsklearn.logs.mend import turn_in
from whsklearn.recursion.memory.blocks import KNOWN, first_block
from whsklearn.recursion.memory.starts import lagged, solved
from whsklearn.recursion.rows.predictor import Law

# The past explains nothing of the residual of a static system in white noise, except by chance: a share of 6/n, or 10 %
# at the fewest samples.  With a delay of one sample the share is 100 %, for Example 5.1 at 7.5 dB 30 to 42 % (40 seeds,
# tests/estimators/test_records.py).
PAST, FEWEST, DYNAMIC = 3, 60, 0.2

# A constant of a fifth of the residual of a linear filter makes the free run of Example 5.1 three times worse, one of
# three fifths a hundred times (tests/estimators/test_advice.py).  By chance it is 1/sqrt(n) of the residual only if
# that is white: behind slow blocks it was more than a fifth in 6 of 60 records about zero (the same tests).  The means
# of ten parts tell its standard error, whatever the colour; of 1,000 such records, one may exceed what Student's t
# allows.
WORTH_A_CONSTANT, FEWEST_FOR_A_CONSTANT, TAPS = 0.2, 400, 8
PARTS, NOT_BY_CHANCE = 10, 1e-3
# Ratio of mean to standard deviation up to which an input counts as centred; otherwise an odd law may cause a constant.
CENTRED = 0.1


# Between these rms values of the output, the pure recursion of Example 5.1 at 20 dB has an R2 of 0.96 or more (two
# seeds); at 100 times the original output it is 0.64 to 0.78, at a hundredth 0.71.  For the input it is 0.95 or more
# from 1e-3 to 1e3.
LEAST_OUTPUT, MOST_OUTPUT, LEAST_INPUT, MOST_INPUT = 0.05, 10.0, 5e-4, 2e3
# Share of the one-step error that functions of the input explain behind its own past.  With the right law and orders it
# is 0.005 at most over 2,000 samples, with a law in dx for a law in x, or the reverse, 0.05 to 0.6, with too low orders
# 0.02 to 0.05 (tests/estimators/test_advice.py); by chance a few times `CHANCE`, whose multiple is the other bound.
TOLD_BY_INPUT, BY_CHANCE = 0.03, 5.0
LEAST_TOLD = 1e-4  # of the output's variance; without noise, all that is left of a right model follows the input
FUNCTIONS = (np.positive, np.abs, np.square, np.sign, lambda v: np.clip(v, -4.0, 4.0) ** 3)  # of x and of dx
MOST_LEFT = 0.5  # of the variance of the record: above it the free run leaves more than it explains
# Of what a linear filter of this many taps leaves: a free run that leaves more is no chain of this record.  Sound fits
# of 84 records leave 1.02 times as much at most, those of linear systems (tests/estimators/test_advice.py).
WORSE_THAN_LINEAR, LINEAR_TAPS = 1.5, 64
# Of the one-step error, explained by its own last three values: noise that passes L2's denominator leaves 0.01 at most
# (20 records), noise of the output 0.01 to 0.4 (20 records; tests/estimators/test_advice.py).
TOLD_BY_OWN = 0.03
LOOSE = 100.0  # of P0 times the squares of a column: its weight is then a hundredth off, by the start alone
LATEST, UNSETTLED = 20_000, 300  # samples that are looked at; those at their start, where the state is not known
FEWEST_ROWS = 10  # per parameter; below this a fit follows the noise
SAME = 0.999  # cosine of two terms of a law over the record: a velocity scale ten times the speeds gives 0.9999
INSEPARABLE = 0.999  # correlation of two weights: the variance of each is then 500 times that of their sum
SURE = 3.0  # standard errors by which a weight must have the wrong sign
ENERGY_TAKING = ("viscous", "coulomb", "quadratic_drag")  # dissipative terms, whose weights must be positive
SHUFFLED = 0.05  # share of samples that do not follow the previous one; an ordinary fold has only one or two holes


def of_few_samples(n: int, n_parameters: int) -> str | None:
    """The warning for a record with no more samples than parameters."""
    if n > n_parameters:
        return None
    return f"The record has {n} samples for {n_parameters} parameters, expected more samples; give a longer record."


def of_a_signal_at_rest(X: Array, y: Array) -> str | None:
    """The warning for a record that shows no dynamics."""
    for name, values, what in (("input", X, "excite the axis"), ("output", y, "check its column")):
        if np.ptp(values, axis=0).max() == 0.0:
            return f"The {name} is constant, so the record does not show the dynamics; {what}."
    return None


def of_a_constant(law: FrictionLaw, X: Array, y: Array) -> str | None:
    """The warning for an output with a constant offset that no parameter describes, because all terms are odd."""
    n = len(y) - TAPS
    if n < FEWEST_FOR_A_CONSTANT or not is_odd(law):
        return None
    scale = X.std(axis=0)
    if not scale.all() or np.abs(X.mean(axis=0) / scale).max() > CENTRED:
        return None
    before = [X[TAPS - k : len(X) - k] / scale for k in range(TAPS + 1)]
    rows = np.hstack([np.ones((n, 1)), *before])
    estimate = np.linalg.lstsq(rows, y[TAPS:], rcond=None)[0]
    error, constant = y[TAPS:] - rows @ estimate, float(estimate[0])
    if abs(constant) <= max(WORTH_A_CONSTANT * float(np.std(error)), 1e-9 * float(np.abs(y).max())):
        return None
    means = [part.mean() for part in np.array_split(error, PARTS)]
    if abs(constant) <= student_t.isf(0.5 * NOT_BY_CHANCE, PARTS - 1) * np.std(means, ddof=1) / np.sqrt(PARTS):
        return None
    return (
        f"The output is offset by {constant:.3g} from what the input explains, and neither the law nor the model has a "
        "constant; subtract it (for example with scikit-learn's TransformedTargetRegressor), or add offset to the law."
    )


def of_several_inputs(name: str, n_inputs: int) -> str | None:
    """The warning that columns are treated as inputs, because no structure was given."""
    if n_inputs == 1:
        return None
    return (
        f"X has {n_inputs} columns and lags was not given: {name} treats them as {n_inputs} inputs of one "
        "Wiener-Hammerstein chain; give lags=WienerHammersteinLags() if they are, or fit RLSRegressor if they are "
        "regressors."
    )


def of_a_dynamic_record(name: str, X: Array, y: Array, restart: Bools) -> str | None:
    """The warning for a static regression (no structure was given) of a record whose past predicts its present."""
    if X.shape[1] != 1 or (share := told_by_past(X, y, restart)) <= DYNAMIC:
        return None
    return (
        f"X has one column and lags was not given: {name} fits y = theta x, and the samples before explain "
        f"{100 * share:.0f} % of its residual; give lags=WienerHammersteinLags() for a dynamic system."
    )


def told_by_past(u: Array, y: Array, restart: Bools) -> float:
    """Share of the residual of y = theta u explained by its own last three values and those of u; 0 if too short."""
    late = np.convolve(restart, np.ones(PAST + 1), "full")[: len(u)] == 0
    if np.count_nonzero(late) < FEWEST:
        return 0.0
    left = y - u[:, 0] * float(u[:, 0] @ y) / max(float(u[:, 0] @ u[:, 0]), 1e-300)
    if left @ left <= 1e-20 * (y @ y):
        return 0.0
    before = np.column_stack([np.roll(v, k)[late] for v in (u[:, 0], left) for k in range(1, PAST + 1)])
    explained = before @ np.linalg.lstsq(before, left[late], rcond=None)[0]
    return float(explained @ explained) / max(float(left[late] @ left[late]), 1e-300)


class OneStep(NamedTuple):
    """Shares of the one-step error: what functions of the input explain behind its own past, what that explains, and
    what either may explain by chance.
    """

    by_input: float
    by_own: float
    chance: float


def of_the_law(told: OneStep, theta: Array, law: FrictionLaw, dims: Integers, X: Array, restart: Bools) -> str | None:
    """The warning for a chain whose one-step error follows its input, as where its law is not that of the record.

    ``theta``: natural parameters.
    """
    share = told.by_input
    if share <= max(TOLD_BY_INPUT, BY_CHANCE * told.chance):
        return None
    if (alike := _out_of_scale(theta, law, dims, X[-LATEST:], restart[-LATEST:])) is not None:
        return alike
    return (
        f"Functions of the input explain {100 * share:.0f} % of what this chain leaves one step ahead, so its law or "
        "its orders are not those of the record: try a law in x (law='polynomial') in place of one in dx or the "
        "reverse, other orders, or PEMRegressor(criterion='simulation'), which finds both; whsklearn identify compares "
        "structures."
    )


def _out_of_scale(theta: Array, law: FrictionLaw, dims: Integers, X: Array, restart: Bools) -> str | None:
    """The warning for a law two of whose terms are one over the record, as happens in other units.

    The linear blocks and the weights follow the scale of X and y; a velocity or knots that the law was given do not.
    """
    x, dx = first_block(theta, dims, X, restart, KNOWN)[0]
    values = law_values(law.codes, law.shapes, x, dx, np.inf)
    size = np.linalg.norm(values, axis=1)
    unit = values / np.where(size > 0.0, size, 1.0)[:, None]
    alike = np.argwhere(np.triu(np.abs(unit @ unit.T) > SAME, 1))
    if not len(alike):
        return None
    first, second = (law.labels[i] for i in alike[0])
    return (
        f"The terms {first} and {second} of the law are the same over this record (the rms of x is "
        f"{np.sqrt(np.mean(x**2)):.2g}, of dx {np.sqrt(np.mean(dx**2)):.2g}): give the law a velocity of the size of "
        "dx, as in ReducedStribeck(velocity=...), or knots where x is, as fit places those of law='cubic_spline'."
    )


def one_step(theta: Array, law: Law, u: Array, y: Array, restart: Bools) -> OneStep:
    """What u, x, dx and their powers explain of the latest one-step errors; zeros if there are too few.

    Noise of the output makes the error of a right model follow its own past, and nothing else.
    """
    u, y, restart = u[-LATEST:], y[-LATEST:], restart[-LATEST:]
    skipped = min(UNSETTLED, len(y) // 10)
    if len(y) < FEWEST_FOR_A_CONSTANT:
        return OneStep(0.0, 0.0, 0.0)
    dims, codes, shapes = law
    na, nb, nc, nd, nw = (int(d) for d in dims)
    _, w, c, d = np.split(theta, np.cumsum([na - 1 + nb, nw, nc - 1]))
    (x, dx), _ = first_block(theta, dims, u, restart, KNOWN)
    values = law_values(codes, shapes, x, dx, np.inf)
    error = y - lagged(values, y, restart, nc, nd) @ np.concatenate([np.outer(np.append(1.0, c), w).ravel(), d])
    seen = np.vstack([u.T, *(f(v / max(v.std(), 1e-300)) for v in (x, dx) for f in FUNCTIONS)])
    rows = lagged(np.ascontiguousarray(seen), error, restart, 2, PAST)[skipped:]
    error, own = error[skipped:], rows[:, -PAST:]
    rows = np.column_stack([rows, np.ones(len(rows))])
    if not np.isfinite(rows).all():
        return OneStep(0.0, 0.0, 0.0)
    left = [float(np.sum((error - r @ np.linalg.lstsq(r, error, rcond=1e-10)[0]) ** 2)) / (len(error) - r.shape[1])
            for r in (own, rows)]  # fmt: skip
    size = max(float(np.mean(error**2)), 1e-300)
    by_input = (left[0] - left[1]) / size if left[0] - left[1] > LEAST_TOLD * float(np.var(y)) else 0.0
    return OneStep(by_input, 1.0 - left[0] / size, float(np.sqrt(2.0 * rows.shape[1])) / len(error))


def linear_share(X: Array, y: Array, restart: Bools) -> float:
    """Share of the variance of the latest samples that a linear filter leaves, each of its taps counted as one."""
    X, y, restart = X[-LATEST:], y[-LATEST:], restart[-LATEST:]
    skipped, taps = min(UNSETTLED, len(y) // 10), min(LINEAR_TAPS, len(y) // (2 * FEWEST_ROWS * X.shape[1]))
    past = lagged(np.ascontiguousarray(X.T), y, restart, taps, 0)
    rows = np.column_stack([np.ones(len(y)), X, past])[skipped:]
    known = y[skipped:]
    error = known - rows @ solved(rows, known)
    return float(error @ error) / max(len(error) - rows.shape[1], 1) / max(float(np.var(known)), 1e-300)


def of_scale(X: Array, y: Array) -> str | None:
    """The warning for signals whose scale is too far from one for a recursion that starts with theta and P near one."""
    for name, values, least, most in (("y", y, LEAST_OUTPUT, MOST_OUTPUT), ("X", X, LEAST_INPUT, MOST_INPUT)):
        size = float(np.sqrt(np.mean(values * values)))
        if size > 0.0 and not least <= size <= most:
            return (
                f"The rms of {name} is {size:.3g}, but without memory the recursion starts with parameters of about "
                f"one: divide {name} by {size:.0e}, or give memory=4096, which finds the scale by itself."
            )
    return None


def of_a_tight_start(rows: Array, p0: float) -> str | None:
    """The warning for rows so small that the default P0 holds their weights near theta0, as a ridge penalty does."""
    squares = float(np.max(np.sum(rows * rows, axis=0), initial=0.0))
    if not 0.0 < p0 * squares < LOOSE:
        return None
    return (
        f"No column of X has squares that sum to more than {squares:.2g}, so P0={p0:g} holds the weights near their "
        f"start: multiply X by {1.0 / np.sqrt(squares / len(rows)):.0e}, or give P0={1e4 * LOOSE / squares:.0e}."
    )


def of_an_axis(names: list[str], theta: Array, covariance: Array, n_rows: int, path: Array) -> str | None:
    """The warning for parameters that no real axis can have, with the likely mistake.

    ``names``: names of the columns.
    ``theta`` (n_columns,): weights.
    ``covariance`` (n_columns, n_columns): covariance of the weights.
    ``n_rows``: number of independent rows after the filters.
    ``path`` (n,): the signal that was given as the position.
    """
    if n_rows < FEWEST_ROWS * len(theta):
        return (
            f"The filters leave {n_rows} independent rows for {len(theta)} parameters, expected "
            f"{FEWEST_ROWS * len(theta)} or more; give a longer record, or one with faster motion."
        )
    turn = turn_in(path, "as logged")
    if turn is not None:
        return (
            f"The position leaps by {turn:.6g}, so the angle is wrapped; give np.unwrap(position, period={turn:.6g}), "
            "or read the log with load_log, which unwraps it."
        )
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    if (pair := _inseparable(names, covariance, errors)) is not None:
        return (
            f"{pair[0]} and {pair[1]} cannot be separated in this record, and only their sum is known; give a record "
            "in which the axis moves in both directions and at several speeds."
        )
    for name, value, error in zip(names, theta, errors, strict=True):
        known = not error > 0.0 or abs(value) > SURE * error
        if value < 0.0 and known and (name == "inertia" or name in ENERGY_TAKING):
            return (
                f"The fitted {name} is {value:.3g}, but it cannot be negative: X must be the position and y the drive "
                "(not the other way round), both with the same positive direction."
            )
    if names[0] == "inertia" and errors[0] > 0.0 and abs(theta[0]) < SURE * errors[0]:
        return (
            f"The inertia, {theta[0]:.3g} with a standard error of {errors[0]:.2g}, cannot be distinguished from "
            "zero; check that X is the position and y the drive, or give a record with more acceleration."
        )
    return None


def _inseparable(names: list[str], covariance: Array, errors: Array) -> tuple[str, str] | None:
    """The first two weights that cannot be estimated separately; None if there are none."""
    size = np.outer(errors, errors)
    alike = np.abs(np.divide(covariance, size, out=np.zeros_like(size), where=size > 0.0)) > INSEPARABLE
    pairs = np.argwhere(np.triu(alike, 1))
    return (names[pairs[0][0]], names[pairs[0][1]]) if len(pairs) else None


def of_a_linear_filter(share: float, X: Array, y: Array, restart: Bools) -> str | None:
    """The warning for a free run that leaves this share of the variance where a linear filter leaves less."""
    if share <= LEAST_TOLD or not share > WORSE_THAN_LINEAR * (linear := linear_share(X, y, restart)):
        return None
    return (
        f"The free run of this fit leaves {100 * min(share, 1e4):.3g} % of the variance of its own record, and a "
        f"linear filter only {100 * linear:.3g} %: noise at the output and not within L2, or orders or a law that are "
        "not those of the record; take PEMRegressor(criterion='simulation') or StreamingPEMRegressor, which fit the "
        "free run."
    )


def of_noise_at_the_output(told: OneStep, share: float) -> str | None:
    """The warning for a one-step error that follows its own past, so that the one-step criterion is biased."""
    if not told.by_own > max(TOLD_BY_OWN, BY_CHANCE * told.chance) or not share > LEAST_TOLD:
        return None
    return (
        f"What this chain leaves one step ahead follows its own past ({100 * told.by_own:.2g} % of it), as where noise "
        "is added to the output: the parameters are then off by more than their errors say; compare "
        "PEMRegressor(criterion='simulation') or StreamingPEMRegressor, which fit the free run."
    )


def of_a_weak_run(share: float) -> str | None:
    """The warning for a fit whose own free run leaves this share of the variance, more than it explains."""
    if not share > MOST_LEFT:
        return None
    return (
        f"The free run of this fit leaves {100 * min(share, 1e4):.3g} % of the variance of its own record: noise that "
        "L2 carries on, orders or a law that are not those of the record, or a wrong minimum; compare another "
        "random_state, PEMRegressor, or a longer record."
    )


def of_a_free_run(r2: float) -> str | None:
    """The warning for a free run that is worse than a constant."""
    if not r2 < 0.0:
        return None
    return (
        f"The free run is worse than the mean of the output (NMSE {1.0 - r2:.3g}, R2 {r2:.3g}): the model does not "
        "describe this record. Check columns, units and scale, or try other orders or another law."
    )


def of_the_order(numbers: Integers | None) -> str | None:
    """The warning for samples that are not consecutive, such as the folds of a shuffled KFold."""
    if numbers is None or numbers.size < 2:
        return None
    steps = np.diff(numbers)
    if np.mean(steps != np.median(steps)) <= SHUFFLED:
        return None
    return (
        "The samples are not in time order (a shuffled split?), but a dynamic model needs consecutive samples; use "
        "whsklearn.validation.time_series_split(estimator), or LeaveOneGroupOut() for several records."
    )


def is_odd(law: FrictionLaw) -> bool:
    """Whether every term changes its sign with x and dx."""
    x = np.linspace(0.3, 3.0, 7)
    return bool(np.allclose(law.regressors(x, x[::-1]), -law.regressors(-x, -x[::-1])))
