"""The smallest estimator that a display can draw."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter
from sklearn.base import BaseEstimator, RegressorMixin


class FirstOrder(RegressorMixin, BaseEstimator):
    """y(t) = -d1 y(t-1) + u(t-1), its one parameter by least squares over all samples seen."""

    def partial_fit(self, X, y):
        new = np.array([-y[:-1] @ (y[1:] - X[:-1, 0]), y[:-1] @ y[:-1]])
        self.moments_ = getattr(self, "moments_", 0.0) + new
        self.parameters_ = {"a": [1.0], "b": [], "c": [1.0], "d": [self.moments_[0] / self.moments_[1]]}
        return self

    fit = partial_fit

    def predict(self, X):
        return lfilter([0.0, 1.0], [1.0, self.parameters_["d"][0]], X[:, 0])

    def predict_ahead(self, X, y, horizon=1):
        out = self.predict(X)
        for t in range(horizon, len(y)):
            out[t] = y[t - horizon]
            for k in range(t - horizon, t):
                out[t] = -self.parameters_["d"][0] * out[t] + X[k, 0]
        return out
