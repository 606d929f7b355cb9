"""References keep their height, start at rest and are drawn from the seed."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.datasets import reference_signal

KINDS = ["sine", "multisine", "staircase", "sweep", "rich"]


@pytest.mark.parametrize("kind", KINDS)
def test_height_length_and_seed(kind):
    path = reference_signal(kind, 10.0, 500.0, 0.7, random_state=3)
    assert path.shape == (5000,)
    assert np.abs(path).max() <= 0.7 * 1.35  # the rich one is a triangle with tones on it
    np.testing.assert_array_equal(path, reference_signal(kind, 10.0, 500.0, 0.7, random_state=3))


@pytest.mark.parametrize("kind", ["multisine", "staircase", "sweep", "rich"])
def test_the_axis_is_not_kicked_at_the_start(kind):
    path = reference_signal(kind, 20.0, 1000.0)
    speed = np.abs(np.diff(path))
    assert speed[:20].max() < 0.1 * speed.max()


def test_a_multisine_has_its_eight_tones_and_no_other():
    path = reference_signal("multisine", 50.0, 200.0, random_state=0)[1000:9000]  # 40 s: a whole number of periods
    power = np.abs(np.fft.rfft(path)) ** 2
    frequencies = np.fft.rfftfreq(path.size, 1 / 200)
    tones = np.isclose(frequencies[:, None], 0.1 + 0.4 * np.arange(8)).any(axis=1)
    assert power[tones].sum() / power[1:].sum() > 0.999


@pytest.mark.parametrize("wrong", [{"kind": "square"}, {"duration": -1.0}, {"sample_rate": np.inf}, {"amplitude": 0.0}])
def test_what_cannot_be_is_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong)) if "kind" not in wrong else "Unknown reference"):
        reference_signal(**{"kind": "sine", "duration": 5.0, "sample_rate": 100.0, **wrong})
