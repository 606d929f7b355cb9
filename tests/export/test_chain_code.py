"""A chain in C gives what it gives here."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import WienerHammersteinSystem
from whsklearn.export import export_model
from whsklearn.models import ChainModel, LinearModel


@pytest.mark.parametrize(
    "model",
    [
        WienerHammersteinSystem.example(),
        WienerHammersteinSystem([1.0], [], [1.0], [0.5], law="viscous,coulomb"),
        LinearModel([0.0, 0.5], [1.0, -0.5], offset=0.2),
        ChainModel([0.1], [1.0, -0.9], WienerHammersteinSystem.example().law, [1.0], [1.0], dt=0.01, logged="position"),
    ],
    ids=["example", "hammerstein", "output_error", "integrating"],
)
def test_chains(model, drive, tmp_path, replay):
    export_model(model, to="c", out=tmp_path)
    np.testing.assert_allclose(replay(drive), model.simulate(drive), rtol=0, atol=1e-12)
