"""The estimators that jobs compare."""

from __future__ import annotations

import pytest

from whsklearn import WienerHammersteinLags
from whsklearn.cli.candidates import candidates

LAGS = WienerHammersteinLags(3, 1, 2, 1)


def test_each_is_there_once_with_the_orders_window_and_seed_asked_for():
    found = candidates(LAGS, p=7, seed=5, evolution=True)
    assert len({(c.name, c.reading) for c in found}) == len(found) == 9
    for c in found:
        settings = c.model.get_params()
        assert settings["lags__n_a"] == 3
        assert settings.get("random_state", 5) == 5
        assert settings.get("p", 7) == 7


def test_only_what_learns_sample_by_sample_has_a_path_to_draw():
    found = candidates(LAGS, evolution=True)
    assert {c.name for c in found if not c.stream} == {"PEM", "differential evolution"}
    assert all(hasattr(c.model, "partial_fit") for c in found if c.stream)


@pytest.mark.parametrize("p0", [1e6, 3.0])
def test_the_published_readings_start_as_the_article_says_unless_told(p0):
    given = {} if p0 == 1e6 else {"published": {"P0": p0}}
    published = [c.model for c in candidates(LAGS, **given) if c.reading == "pseudolinear" and c.name != "gradient"]
    assert [(m.P0, m.theta0, m.gradient) for m in published] == [(p0, 0.01, "pseudolinear")] * 3
