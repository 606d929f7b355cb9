"""Fitted estimators of each kind; fitting one of each takes a second, so all modules share them."""

from __future__ import annotations

import pytest
from sklearn.base import clone

from tests.estimators.fitted_models import MODELS
from whsklearn.datasets import make_wiener_hammerstein


@pytest.fixture(scope="package")
def record():
    return make_wiener_hammerstein(160, random_state=0)


@pytest.fixture(scope="package")
def fitted(record):
    return {name: clone(model).fit(*record) for name, model in MODELS.items()}
