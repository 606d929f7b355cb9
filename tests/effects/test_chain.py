"""Effects at the ports that only a chain of blocks has."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import WienerHammersteinSystem
from whsklearn.effects import codes, get_effect
from whsklearn.effects.chain import CHAIN_FORMS

WIRE = {"a": [1.0], "b": [], "c": [1.0], "d": [], "law": "linear"}  # two delays and nothing else
U = np.sin(0.05 * np.arange(400)) + 0.4 * np.sin(0.31 * np.arange(400))


@pytest.mark.parametrize("name", CHAIN_FORMS)
def test_a_form_keeps_the_name_and_has_a_code_for_every_port(name):
    form = CHAIN_FORMS[name]
    assert form.name == name == get_effect(name).name
    assert get_effect(name) is not form
    known = {v for k, v in vars(codes).items() if k.isupper()}
    at_ports = [form(**options).code for options in form.variants()]
    assert len(set(at_ports)) == len(at_ports) > 1
    assert set(at_ports) <= known


@pytest.mark.parametrize("name", CHAIN_FORMS)
def test_every_port_changes_what_passes(name):
    plain = WienerHammersteinSystem(**WIRE).simulate(U)
    for options in CHAIN_FORMS[name].variants():
        changed = WienerHammersteinSystem(**WIRE, effects=[CHAIN_FORMS[name](**options)]).simulate(U)
        assert np.isfinite(changed).all()
        assert np.abs(changed - plain).max() > 1e-3, options
