"""Significance: p-values from records that a model simulates itself, and whether two explanations differ.

Every decision of the gap workflow answers one of two questions, *is there an effect* and *which one*, by comparison
with records that the fitted model simulates itself (`whsklearn.gap.search`). The functions here are the statistics of
that comparison; they work on arrays only.
"""

from __future__ import annotations

import numpy as np
from scipy.special import fdtrc  # with `scipy.stats`, which checks its arguments, a p-value takes three times as long
from scipy.stats import norm

from whsklearn.gap.record import Array

# The gain of one superfluous number is chi-squared with one degree of freedom, and the largest of many such gains has a
# Gumbel scale of 2: no spread over a scan is below that.
LEAST_SCALE = 2.0
N_NULL = 15  # records that a model simulates itself; they give the moments of a Gumbel law to within a quarter
# Of its own records whose artefacts or errors are averaged: the mean is known to 0.45 of their spread, a floor to a
# tenth.
N_OWN = 5
N_DRAWS = 60  # of noise or numbers alone: a spread to 9 %, the moments of a Gumbel law to an eighth
GATE = 0.1  # p-value below which effects are fitted, which takes seconds; the level at which they are named is lower
N_BLOCKS = 40  # per record: errors of neighbouring samples depend on each other, those of blocks hardly


def n_effective(residual: Array, most: float = np.inf) -> float:
    """Independent samples in a coloured residual, (sum S)^2 / sum S^2 of its spectrum S, at most ``most``.

    ``residual`` is (n,). ``most``: for example 2 f_c T, after a filter with the cut-off f_c.

    References
    ----------
    Bayley and Hammersley 1946, The "effective" number of independent observations in an autocorrelated time series,
    Supplement to the JRSS 8(2), 184-197.

    Examples
    --------
    >>> import numpy as np
    >>> white = np.random.default_rng(0).standard_normal(4000)
    >>> 3600 < n_effective(white) < 4400
    True
    """
    power = np.abs(np.fft.rfft(residual - residual.mean())[1:]) ** 2
    total = float(power.sum())
    if total <= 0.0:
        return 1.0
    # a periodogram has E P^2 = 2 S^2, and the real transform contains every second line: 2 * 2
    return float(np.clip(4.0 * total**2 / float(power @ power), 1.0, min(most, residual.size)))


def gain(before: float, after: float, n: float) -> float:
    """g = n ln(RSS before / RSS after), twice the log likelihood ratio of ``n`` independent samples."""
    return float(n * np.log(max(before, 1e-300) / max(after, 1e-300)))


def p_value(g: float, null: Array, families: int = 1, degrees: float = 0.0) -> float:
    """Probability that the model's own records reach ``g``, times the number of families that were tried.

    Over a scan of shapes, each null gain is the largest of many and follows a Gumbel law with the moments of the null
    gains.  For columns of one shape, a gain from noise is c times chi-squared, where c is one only if the noise has the
    colour that `n_effective` assumes (a step that follows the direction contains less of slow noise).  The mean null
    gain gives c, and the ratio to it follows Snedecor's F.  If several columns see noise of different sizes, the
    degrees of freedom are those of their spread (Satterthwaite 1946, Biometrics Bulletin 2(6), 110-114).

    ``g``: gain in the record.
    ``null`` (m,): gains of the same scan in the model's own records.
    ``families``: number of families tried (Bonferroni).
    ``degrees``: number of columns of one shape, or half for a column whose size has a fixed sign; zero after a scan.

    References
    ----------
    Gumbel 1958, Statistics of Extremes, Columbia University Press; Davison and Hinkley 1997, Bootstrap Methods and
    their Application, Cambridge University Press, ch. 4.

    Examples
    --------
    >>> import numpy as np
    >>> null = np.array([3.0, 5.0, 4.0, 6.0, 2.0, 4.0, 5.0, 3.0, 4.0])
    >>> p_value(4.0, null) > 0.2, p_value(40.0, null, families=30) < 1e-4
    (True, True)
    """
    null = np.asarray(null, dtype=float)
    mean = float(np.mean(null))
    if degrees > 0.0 and mean > 0.0:
        k = max(1.0, degrees)
        used = min(k, max(1.0, 2.0 * mean**2 / max(float(np.var(null)), 1e-300)))
        return float(min(1.0, families * degrees / k * fdtrc(used, null.size * used, g * degrees / (k * mean))))
    scale = max(float(np.std(null, ddof=1)) * np.sqrt(6.0) / np.pi if null.size > 1 else 0.0, LEAST_SCALE)
    centre = mean - np.euler_gamma * scale
    with np.errstate(over="ignore"):  # a refit can end much worse than it began; p is one then
        return float(min(1.0, -families * np.expm1(-np.exp((centre - g) / scale))))


def vuong(worse: Array, better: Array) -> float:
    """How certainly one set of errors is the smaller: mean over standard error of the difference of 40 block sums.

    Neither model need be right. If both are equally good, this is a standard normal deviate.  Errors of a free run may
    depend on each other for longer than a block, so the standard error is that of an autoregression of the first order:
    of errors correlated over a tenth of the record, independent blocks would make a deviate of 2.0 in place of 1.

    ``worse``, ``better`` (n,): errors of the two models at the same samples.

    References
    ----------
    Vuong 1989, Likelihood ratio tests for model selection and non-nested hypotheses, Econometrica 57(2), 307-333;
    Andrews and Monahan 1992, An improved heteroskedasticity and autocorrelation consistent covariance matrix estimator,
    Econometrica 60(4), 953-966, for the standard error.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> e = rng.standard_normal(4000)
    >>> vuong(e + 0.5, e) > 5.0, abs(vuong(e, e)) < 1e-9
    (True, True)
    """
    size = max(1, worse.size // N_BLOCKS)
    n = worse.size // size
    d = (worse[: n * size] ** 2 - better[: n * size] ** 2).reshape(n, size).sum(axis=1)
    spread = float(np.std(d, ddof=1)) if n > 1 else 0.0
    if spread == 0.0:
        return 0.0
    apart = d - d.mean()
    after_another = max(0.0, float(apart[1:] @ apart[:-1]) / float(apart @ apart))
    longer = np.sqrt((1.0 + after_another) / (1.0 - after_another))  # than independent blocks would make it
    return float(np.mean(d) / (longer * spread / np.sqrt(n)))


def rival_leads(before: Array, taken: Array, other: Array, n: float, rng: np.random.Generator) -> Array:
    """Lead of the explanation taken in records simulated with its rival, near the model without either; shape (m,).

    A record of the rival contains what the rival explains, and noise with the colour of its residual. To first order,
    either explanation fits such a record along what it explains in the real one.

    ``before``, ``taken``, ``other`` (n,): errors of the model without either, with the one taken, with the rival.
    ``n``: independent samples.

    References
    ----------
    Cox 1962 and Williams 1970, see `separable`.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> a, b, noise = rng.standard_normal((3, 2000))
    >>> leads = rival_leads(a + 0.1 * noise, 0.1 * noise, a + 0.1 * noise - 0.5 * b, 2000, rng)
    >>> bool(leads.max() < 0.0)
    True
    """
    power = smoothed_power(other)
    made = coloured(power, (N_DRAWS, other.size), rng) + (before - other)

    def left(explained: Array) -> Array:
        along = made @ explained / max(float(explained @ explained), 1e-300)
        return np.sum((made - along[:, None] * explained) ** 2, axis=1)

    return np.asarray(n * np.log(np.maximum(left(before - other), 1e-300) / np.maximum(left(before - taken), 1e-300)))


def least_lead(alpha: float) -> float:
    """2 ln(1 / alpha), the smallest gain by which one explanation can be better than another at the level ``alpha``."""
    return 2.0 * float(np.log(1.0 / alpha))


def separable(lead: float, z: float, rival_leads: Array, alpha: float) -> bool:
    """Whether the better of two explanations is the right one, at the level ``alpha``.

    Three conditions must hold: the lead is at least 2 ln(1 / alpha), it is significant over blocks (Vuong), and records
    simulated with the *rival* give no such lead (Cox).

    ``lead``: gain of the better minus the gain of the rival. ``z``: `vuong` of the two. ``rival_leads`` (m,): the same
    lead in records simulated with the rival; empty if there are none.

    References
    ----------
    Cox 1962, Further results on tests of separate families of hypotheses, JRSS B 24(2), 406-424; Williams 1970,
    Discrimination between regression models to determine the pattern of enzyme synthesis in synchronous cell
    cultures, Biometrics 26(1), 23-32, for simulated records in its place.
    """
    if lead < least_lead(alpha) or z < norm.isf(alpha):
        return False
    return rival_leads.size == 0 or p_value(lead, rival_leads) <= alpha


def coloured(power: Array, shape: tuple[int, int], rng: np.random.Generator) -> Array:
    """Rows of Gaussian noise, (m, n), with the one-sided periodogram ``power`` of shape (n // 2 + 1,): random phases.

    All rows are transformed at once, which takes a third of the time.

    References
    ----------
    Theiler, Eubank, Longtin, Galdrikian and Farmer 1992, Testing for nonlinearity in time series: the method of
    surrogate data, Physica D 58, 77-94.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.random.default_rng(0).standard_normal(1000)
    >>> power = np.abs(np.fft.rfft(x)) ** 2
    >>> bool(abs(np.std(coloured(power, (1, 1000), np.random.default_rng(1))) / np.std(x) - 1) < 0.1)
    True
    """
    size = np.sqrt(np.maximum(power, 0.0) / 2.0)
    z = rng.standard_normal((shape[0], 2, power.size))
    return np.asarray(np.fft.irfft(size * (z[:, 0] + 1j * z[:, 1]), shape[1]))


# Smallest number of lines on either side: a constant, or a wave with one period in the record, must stand out from its
# band to be distinguished from slow noise.
SLOWEST = 3


def smoothed_power(x: Array) -> Array:
    """Periodogram of shape (n // 2 + 1,), each line the mean over a band of half its own frequency.

    A tone is spread over its band, so noise with this spectrum contains no tone; slow parts stay slow.

    >>> import numpy as np
    >>> power = smoothed_power(np.sin(2 * np.pi * 100 * np.arange(1000) / 1000))
    >>> int(power.argmax()) in range(70, 140), bool(power.max() < 0.1 * 500.0**2)
    (True, True)
    """
    power = np.abs(np.fft.rfft(x)) ** 2
    line = np.arange(power.size)
    half = np.maximum(SLOWEST, line // 4)
    low, high = np.maximum(line - half, 0), np.minimum(line + half + 1, power.size)
    total = np.concatenate([[0.0], np.cumsum(power)])
    return (total[high] - total[low]) / (high - low)


def independent(x: Array, most: float) -> float:
    """Independent samples in noise with the smoothed spectrum of ``x``, at most ``most`` (`n_effective`)."""
    return n_effective(coloured(smoothed_power(x), (1, x.size), np.random.default_rng(0))[0], most)


def null_rows(rest: Array, apart: Array, count: int, rng: np.random.Generator, share: float = 1.0) -> Array:
    """Residuals by chance with the colour of ``rest``, shape (count, n): encoder noise plus coloured noise.

    ``rest`` (n,): residual of the record without artefacts.
    ``apart`` (k, n): encoder noise in the residuals of k records simulated with the model, taken in turn.
    ``share``: share of the samples that count; ``rest`` is zero at the others.
    """
    noise = np.mean([smoothed_power(a) for a in apart], axis=0)
    excess = np.maximum(smoothed_power(rest) - noise, 0.0) / share
    return apart[np.arange(count) % len(apart)] + coloured(excess, (count, rest.size), rng)
