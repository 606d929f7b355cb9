"""From fitted numbers to the library's effects."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gap.plants.example_chain import PARTS, PLAIN, TRUE, U, term
from whsklearn import WienerHammersteinSystem
from whsklearn.gap.plants.chain_candidates import BENDS, CATALOGUE
from whsklearn.gap.plants.chain_effects import found_effect, library_effect
from whsklearn.gap.plants.chain_model import Term, free_run


@pytest.mark.parametrize(
    "fitted",
    [
        term("cogging", 0.1, -0.2, 0.6), term("quadratic_drag", 0.1), term("dead_zone", 0.2),
        term("output_offset", 0.3),
        term("backlash", 0.3), term("position_friction", 0.1, 0.1, 0.7), term("hardening_spring", 0.01, 0.0),
        term("presliding_hysteresis", 0.2, 0.8), term("actuator_lag", 0.8), term("disturbance_tone", 0.1, 0.2, 0.05),
        term("encoder_eccentricity", 0.05, 0.02, 0.9), term("parameter_change", 0.1, 300.0),
    ],
    ids=lambda t: t.name,
)  # fmt: skip
def test_the_librarys_system_runs_as_the_fitted_model_does(fitted):
    system = WienerHammersteinSystem(**PARTS, effects=[library_effect(fitted)])
    np.testing.assert_allclose(system.simulate(U), free_run(PLAIN, TRUE.plus(fitted)), atol=1e-9)


def test_a_wave_is_told_by_amplitude_and_phase():
    told = found_effect(term("cogging", 3.0, -4.0, 0.6)).labelled()
    assert told == {"amplitude": 5.0, "phase": pytest.approx(np.arctan2(4.0, 3.0)), "order": 0.6}


def test_what_the_library_has_in_another_form_only_is_told_and_not_handed_on():
    coupling = term("flexible_coupling", 0.1, 0.2)
    at_input = Term(next(k for k in CATALOGUE if k.variant == "at the input"), (0.1, 0.1, 0.05))
    between = Term(BENDS[0], (0.8,))
    assert [library_effect(t) for t in (coupling, at_input, between)] == [None] * 3
    assert "resonance" in found_effect(coupling).equation
    assert found_effect(between).place == "law"
    assert "u" not in found_effect(between).equation.replace("saturation", "")
