"""Published recursions beside the default, one pass over Example 5.1.

    python benchmarks/race.py                    # 20 seeds, a few minutes
    python benchmarks/race.py --runs 100

Every method reads N samples once, in order, knows the orders and the form of the law, and starts from the same guess
where it needs one: all friction weights right in sign, poles at zero.  ModelErrors by the free run against noise-free
output, averaged over three fresh records, as `accuracy.py` does; one that runs away counts as NMSE 1, and how often.

| name | what it is |
|---|---|
| key-term RLS | key-term separation and least squares over an auxiliary model: Voros 2003, IEEE TAC 48(12); |
|              | here `RMILSRegressor(gradient="pseudolinear", p=1)`, the published reading |
| RPEM         | recursive prediction error method with the exact gradient, one start: Wigren 1993, Automatica 29(4); |
|              | here `RMILSRegressor(memory=0, p=1, n_starts=1)`; "all starts" is without the last |
| EKF          | joint extended Kalman filter over signals and parameters: Ljung 1979, IEEE TAC 24(1) |
| UKF          | joint unscented Kalman filter: Wan, van der Merwe 2000, AS-SPCC |
| particles    | particle filter with kernel shrinkage of the parameters, a = 0.99: Liu, West 2001 |
| LAVA-R       | linear predictor and a sparse correction in sines of the past: Mattsson, Zachariah, Stoica 2018, |
|              | Automatica 93; knows neither orders nor law; 10 past u and y each |

The Kalman filters' signs are tanh(10 dx), as they need a slope (particles take the sign itself); their parameters get
a random walk of 1e-3 that falls with the square root of time.  All filters know the true noise variance: a favour.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import click
import numpy as np
from joblib import Parallel, delayed

from benchmarks.accuracy import SNR_DB, median_interval
from whsklearn import RMILSRegressor, WienerHammersteinLags, WienerHammersteinSystem
from whsklearn.datasets import make_wiener_hammerstein
from whsklearn.effects import reduced_law
from whsklearn.metrics import nmse

if TYPE_CHECKING:
    from collections.abc import Callable

Array = np.ndarray
FREE_RUN = "simulation"
START = np.array([0.5, 0.0, 0.0, 0.1, 0.5, 0.1, 0.0, 0.0, 0.0])  # a2, b1, b2, viscous, coulomb, stribeck, c2, d1, d2
DEVIATION = np.array([2.0, 0.7, 0.4, 0.2, 0.5, 0.3, 0.5, 0.5, 0.3])
WALK = 1e-3
STATES = 3  # x(t), x(t-1), v(t-1)


def step(states: Array, theta: Array, u: tuple[float, float], sharpness: float) -> Array:
    """Next states, (..., 3), from u(t-1), u(t-2) and parameters (..., 9)."""
    x, before, _ = np.moveaxis(states, -1, 0)
    a2, b1, b2, viscous, coulomb, stribeck = np.moveaxis(theta[..., :6], -1, 0)
    new = u[0] + a2 * u[1] - b1 * x - b2 * before
    dx = x - before
    sign = np.tanh(sharpness * dx) if np.isfinite(sharpness) else np.sign(dx)
    return np.stack([new, x, viscous * dx + coulomb * sign - stribeck * np.tanh(dx)], axis=-1)


def predicted(states: Array, theta: Array, y: tuple[float, float], sharpness: float) -> Array:
    """y_hat(t) = v(t-1) + c2 v(t-2) - d1 y(t-1) - d2 y(t-2), where v(t-1) is of the states' x."""
    x, before, v2 = np.moveaxis(states, -1, 0)
    viscous, coulomb, stribeck, c2, d1, d2 = np.moveaxis(theta[..., 3:], -1, 0)
    dx = x - before
    sign = np.tanh(sharpness * dx) if np.isfinite(sharpness) else np.sign(dx)
    v1 = viscous * dx + coulomb * sign - stribeck * np.tanh(dx)
    return v1 + c2 * v2 - d1 * y[0] - d2 * y[1]


def stable(theta: Array) -> Array:
    """Whether both blocks are (Jury)."""
    b1, b2, d1, d2 = theta[..., 1], theta[..., 2], theta[..., 7], theta[..., 8]
    return (np.abs(b2) < 1) & (np.abs(b1) < 1 + b2) & (np.abs(d2) < 1) & (np.abs(d1) < 1 + d2)


def system_of(theta: Array) -> WienerHammersteinSystem:
    """The chain with these parameters."""
    return WienerHammersteinSystem([1.0, theta[0]], theta[1:3], [1.0, theta[6]], theta[7:], reduced_law(*theta[3:6]))


def sigma_points(mean: Array, covariance: Array) -> tuple[Array, Array]:
    """2n points around a Gaussian and their weights (the centre's is zero: the cubature form)."""
    n = mean.size
    root = np.linalg.cholesky(covariance + 1e-12 * np.eye(n)) * np.sqrt(n)
    return np.vstack([mean + root.T, mean - root.T]), np.full(2 * n, 0.5 / n)


def kalman(u: Array, y: Array, variance: float, unscented: bool, sharpness: float = 10.0) -> Array:
    """Parameters after one pass of a joint Kalman filter, by Jacobians or by points."""
    z = np.concatenate([np.zeros(STATES), START])
    P = np.diag(np.concatenate([np.full(STATES, 1e-6), DEVIATION**2]))

    def transition(z: Array, past: tuple[float, float]) -> Array:
        return np.concatenate([step(z[..., :STATES], z[..., STATES:], past, sharpness), z[..., STATES:]], axis=-1)

    def output(z: Array, past: tuple[float, float]) -> Array:
        return predicted(z[..., :STATES], z[..., STATES:], past, sharpness)

    for t in range(2, y.size):
        inputs, outputs = (u[t - 1], u[t - 2]), (y[t - 1], y[t - 2])
        # the states are x(t-1), x(t-2), v(t-2) now; v(t-1) is a function of the first two
        if unscented:
            points, weights = sigma_points(z, P)
            answers = output(points, outputs)
            centre = weights @ answers
            cross = (weights * (answers - centre)) @ (points - z)
            S = weights @ (answers - centre) ** 2 + variance
        else:
            slope = jacobian(lambda w: np.atleast_1d(output(w, outputs)), z)[0]  # noqa: B023
            centre, cross = output(z, outputs), slope @ P
            S = cross @ slope + variance
        gain = cross / S
        previous = z.copy()
        z = z + gain * (y[t] - centre)
        if not stable(z[STATES:]):
            z[STATES:] = previous[STATES:]
        P = P - np.outer(gain, gain) * S
        if unscented:
            points, weights = sigma_points(z, P)
            moved = transition(points, inputs)
            z = weights @ moved
            P = (weights * (moved - z).T) @ (moved - z)
        else:
            F = jacobian(lambda w: transition(w, inputs), z)  # noqa: B023
            z = transition(z, inputs)
            P = F @ P @ F.T
        P[np.diag_indices(STATES)] += 1e-9
        P[range(STATES, z.size), range(STATES, z.size)] += (WALK / np.sqrt(t)) ** 2
        P = 0.5 * (P + P.T)
    return z[STATES:]


def jacobian(function: Callable[[Array], Array], z: Array) -> Array:
    """By complex steps, exact to rounding."""
    step_size = 1e-30
    return np.stack([function(z + 1j * step_size * e).imag / step_size for e in np.eye(z.size)], axis=1)


def particles(u: Array, y: Array, variance: float, seed: int, count: int = 4000, shrink: float = 0.99) -> Array:
    """Mean of the parameters' particles."""
    rng = np.random.default_rng([seed, 3])
    theta = START + DEVIATION * rng.standard_normal((20 * count, START.size))
    theta = theta[stable(theta)][:count]
    states, log_weight = np.zeros((len(theta), STATES)), np.zeros(len(theta))
    for t in range(2, y.size):
        inputs, outputs = (u[t - 1], u[t - 2]), (y[t - 1], y[t - 2])
        log_weight -= 0.5 * (y[t] - predicted(states, theta, outputs, np.inf)) ** 2 / variance
        weight = np.exp(log_weight - log_weight.max())
        weight /= weight.sum()
        if 1.0 / np.sum(weight**2) < 0.5 * len(theta):
            mean = weight @ theta
            deviation = np.sqrt(weight @ (theta - mean) ** 2)
            positions = (np.arange(len(theta)) + rng.uniform()) / len(theta)
            take = np.minimum(np.searchsorted(np.cumsum(weight), positions), len(theta) - 1)
            new = shrink * theta[take] + (1 - shrink) * mean
            new += np.sqrt(1 - shrink**2) * deviation * rng.standard_normal(theta.shape)
            theta = np.where(stable(new)[:, None], new, theta[take])
            states, log_weight = states[take], np.zeros(len(theta))
        states = step(states, theta, inputs, np.inf)
    weight = np.exp(log_weight - log_weight.max())
    return weight @ theta / weight.sum()


class LavaR:
    """Linear predictor with a sparse correction, per-sample cyclic minimisation (SPICE's square-root criterion)."""

    def __init__(self, n_past: int = 10, harmonics: int = 8, sweeps: int = 3):
        self.n_past, self.harmonics, self.sweeps = n_past, harmonics, sweeps

    def rows(self, u: Array, y: Array, t: int) -> tuple[Array, Array]:
        """(phi, gamma): lagged y and u with a one, and sines of each lagged signal on twice its range."""
        lagged = np.concatenate([y[t - self.n_past : t][::-1], u[t - self.n_past : t][::-1]])
        phase = np.pi * (lagged / self.span + 1.0)[:, None] * np.arange(1, self.harmonics + 1) / 2.0
        return np.append(lagged, 1.0), np.sin(phase).ravel()

    def fit(self, u: Array, y: Array) -> LavaR:
        """One pass."""
        k = self.n_past
        self.span = 1.3 * np.concatenate([np.full(k, np.abs(y).max()), np.full(k, np.abs(u).max())])
        phi, gamma = self.rows(u, y, k)
        n, m = phi.size, gamma.size
        both = np.zeros((n + m, n + m))
        cross, power = np.zeros(n + m), 0.0
        z = np.zeros(m)
        information = 1e-6 * np.eye(n)
        self.theta, self.z = np.zeros(n), z
        for t in range(k, y.size):
            phi, gamma = self.rows(u, y, t)
            row = np.concatenate([phi, gamma])
            both += np.outer(row, row)
            cross += row * y[t]
            power += y[t] ** 2
            count = t - k + 1
            if count < n + 5 or count % 10:
                continue  # the sums are recursive; the minimisation need not run on every sample
            inverse = np.linalg.inv(both[:n, :n] + information)
            T = both[n:, n:] - both[n:, :n] @ inverse @ both[:n, n:]
            rho = cross[n:] - both[n:, :n] @ inverse @ cross[:n]
            kappa = power - cross[:n] @ inverse @ cross[:n]
            weights = np.sqrt(np.diag(both)[n:] / count)
            Tz = T @ z
            for _ in range(self.sweeps):
                for j in range(m):
                    alpha = max(kappa - 2 * rho @ z + z @ Tz, 1e-12)
                    beta, g = T[j, j], rho[j] - Tz[j] + T[j, j] * z[j]
                    alpha_j = max(alpha + 2 * g * z[j] - beta * z[j] ** 2, 1e-12)  # the cost without this coordinate
                    new = 0.0
                    if beta > 1e-9 and beta > weights[j] ** 2 and np.sqrt(alpha_j) * weights[j] < abs(g):
                        root = np.sqrt(max(alpha_j * beta - g**2, 0.0) / (beta / weights[j] ** 2 - 1.0))
                        new = np.sign(g) * max(abs(g) - root, 0.0) / beta
                    if new != z[j]:
                        Tz += T[:, j] * (new - z[j])
                        z[j] = new
            self.theta = inverse @ (cross[:n] - both[:n, n:] @ z)
        return self

    def predict(self, X: Array, output: str = FREE_RUN) -> Array:
        """Free run."""
        u = X[:, 0]
        y = np.zeros(u.size)
        limit = 10 * self.span[0]
        for t in range(self.n_past, u.size):
            phi, gamma = self.rows(u, y, t)
            y[t] = np.clip(phi @ self.theta + gamma @ self.z, -limit, limit)
        return y


def scored(predict: Callable[[Array], Array], seed: int) -> float:
    """NMSE of the free run over three fresh records; 1 where it is worse than the mean, or runs away."""
    found = []
    for k in range(3):
        X, y = make_wiener_hammerstein(1000, snr_db=None, random_state=[seed, 77, k])
        with np.errstate(all="ignore"):
            run = predict(X)
        found.append(min(nmse(y, run), 1.0) if np.isfinite(run).all() else 1.0)
    return float(np.mean(found))


def one_seed(seed: int, n_samples: int) -> dict[str, tuple[float, float]]:
    """(NMSE, microseconds a sample) of every method."""
    X, y = make_wiener_hammerstein(n_samples, snr_db=SNR_DB, random_state=seed)
    u = X[:, 0]
    clean = WienerHammersteinSystem.example().simulate(u)
    variance = float(np.var(clean)) / 10 ** (SNR_DB / 10)
    lags = WienerHammersteinLags()
    estimators: dict[str, Any] = {
        "key-term RLS": RMILSRegressor(lags, gradient="pseudolinear", p=1, P0=1e6),
        "RPEM": RMILSRegressor(lags, memory=0, p=1, n_starts=1, P0=1.0, random_state=seed),
        "RPEM, all starts": RMILSRegressor(lags, memory=0, p=1, P0=1.0, random_state=seed),
        "RMILS, default, one pass": RMILSRegressor(lags, random_state=seed),
    }
    runs: dict[str, Callable[[], Callable[[Array], Array]]] = {
        name: lambda m=model: m.partial_fit(X, y).predict for name, model in estimators.items()
    }
    runs["EKF"] = lambda: simulation(kalman(u, y, variance, unscented=False))
    runs["UKF"] = lambda: simulation(kalman(u, y, variance, unscented=True))
    runs["particles"] = lambda: simulation(particles(u, y, variance, seed))
    runs["LAVA-R"] = lambda: LavaR().fit(u, y).predict
    out = {}
    for name, run in runs.items():
        begun = time.process_time()
        with np.errstate(all="ignore"):
            predict = run()
        out[name] = (scored(predict, seed), 1e6 * (time.process_time() - begun) / n_samples)
    return out


def simulation(theta: Array) -> Callable[[Array], Array]:
    """Free run of the chain with these parameters."""
    return lambda X: system_of(theta).simulate(X[:, 0])


@click.command(help=__doc__.split("\n\n")[0])
@click.option("--runs", type=int, default=20, show_default=True, help="Seeds, from 0.")
@click.option("--samples", type=int, default=1000, show_default=True)
@click.option("--jobs", type=int, default=1, show_default=True, help="Processes; seconds are of CPU.")
def main(runs: int, samples: int, jobs: int) -> None:
    """Run and print."""
    one_seed(1_000_000, samples)  # compiled before any clock runs
    rows = Parallel(n_jobs=jobs)(delayed(one_seed)(s, samples) for s in range(runs))
    print(f"Example 5.1, {SNR_DB} dB, N = {samples}, seeds 0 to {runs - 1}; NMSE of the free run")
    print(f"{'method':26} {'median':>8}  {'95 % interval':18} {'mean':>8} {'at 1':>5} {'us a sample':>12}")
    for name in rows[0]:
        scores = np.array([r[name][0] for r in rows])
        middle, low, high = median_interval(scores)
        cost = np.median([r[name][1] for r in rows])
        away = np.sum(scores > 0.999)
        print(f"{name:26} {middle:8.4f}  [{low:7.4f}, {high:7.4f}] {scores.mean():8.4f} {away:5d} {cost:12.1f}")


if __name__ == "__main__":
    main()
