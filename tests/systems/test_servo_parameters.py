"""Numbers of an axis by name, there and back."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.effects import (
    Cogging,
    Coulomb,
    Stribeck,
    Viscous,
)
from whsklearn.systems import ServoAxis, Transmission


def test_parameters_come_and_go_by_name():
    axis = ServoAxis(
        law=[Viscous(0.1), Coulomb(0.2), Stribeck(0.05, 0.1)],
        effects=[Cogging(0.1, 7.0), Cogging(0.2, 14.0), Coulomb(0.01)],
        transmission=Transmission(),
    )
    assert axis.term_names == ("inertia", "viscous", "coulomb", "stribeck", "cogging", "cogging2", "coulomb2")
    names = ["inertia", "stribeck__velocity", "cogging2__order", "coulomb2", "drive__delay", "transmission__gap"]
    new = axis.with_vector(names, [0.04, 0.2, 21.0, 0.03, 0.002, 0.001])
    np.testing.assert_allclose(new.vector(names), [0.04, 0.2, 21.0, 0.03, 0.002, 0.001])
    assert axis.parameters["inertia"] == 0.05
    untouched = set(axis.parameters) - set(names)
    assert all(new.parameters[n] == axis.parameters[n] for n in untouched)
    assert new.with_parameters(axis.parameters) == axis


def test_unknown_parameters_are_refused_and_the_known_listed():
    with pytest.raises(ValueError, match=r"charm.*inertia"):
        ServoAxis().with_parameters(charm=1.0)
    with pytest.raises(ValueError, match="charm"):
        ServoAxis().vector(["charm"])
    with pytest.raises(ValueError, match="transmission__gap"):
        ServoAxis().with_parameters(transmission__gap=0.1)
