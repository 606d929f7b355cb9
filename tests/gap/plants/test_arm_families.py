"""Candidates of an arm as families of columns: shapes that are scanned, and the polish of the best."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from tests.gap.plants.test_arm_view import ARM, kind_of, view_of
from whsklearn.effects import Cogging, ContactStop
from whsklearn.gap.plants.arm_families import _varies, families, nameless_at, polished
from whsklearn.gap.plants.arm_terms import JointTerm, candidates
from whsklearn.gap.tangent import Tangent

pytestmark = pytest.mark.usefixtures("library_effects")


def tangent_of(view, model):
    """The look without own records: the residual beside the model's own columns."""
    own, _ = view.design(model, np.zeros(view.n_joints, dtype=bool))
    left = view.left(model).ravel()
    return Tangent(left, np.zeros((1, left.size)), own, 500.0, view.flat_weight())


@pytest.fixture(scope="module")
def waved():
    return view_of({"pitch": [Cogging(0.2, order=7.0)]})


def test_a_family_has_columns_on_the_rows_of_its_joint(waved):
    view, _ = waved
    kinds = [kind_of(n) for n in ("coulomb at yaw", "cogging at pitch", "load_friction at pitch")]
    for family, kind in zip(families(view, kinds), kinds, strict=True):
        assert family.name == kind.name
        assert family.rows == kind.rows
        if kind.catalogued.scanned is None:
            for shapes, columns, _ in family.blocks(None):
                assert columns.shape[:2] == (view.n_rows, len(shapes))


def test_waves_of_every_order_are_scanned_and_the_hidden_one_fits_best(waved):
    view, model = waved
    kind = kind_of("cogging at pitch")
    tangent = tangent_of(view, model)
    family = next(iter(families(view, [kind])))
    found = {}
    for shapes, columns, _ in family.blocks(tangent):
        power, _, _ = tangent.taken(family, columns)
        found |= {shape[0]: p for shape, p in zip(shapes, power[:, 0], strict=True)}
    order = max(found, key=found.__getitem__)
    assert order == pytest.approx(7.0, abs=0.3)
    term = polished(view, tangent, JointTerm(kind, (0.0, 0.0, order)))
    resolution = np.pi / view.scene(kind).reach  # of waves over half a turn
    assert term.shape[0] == pytest.approx(7.0, abs=0.1 * resolution)


@pytest.mark.parametrize("begins", [0.0, 0.5])
def test_tones_are_sought_wherever_the_rows_begin(waved, begins):
    """``begins``: in steps; the filter's end may be as long as any number of half steps."""
    view, model = copy.copy(waved[0]), waved[1]
    view.time = view.time - view.time[view.kept[0]] + (5.0 + begins) * view.step
    tangent = tangent_of(view, model)
    tangent.rows = (
        tangent.rows + 0.1 * np.sin(2 * np.pi * 3.0 * np.repeat(view.time[view.kept], view.n_joints))[:, None]
    )
    ((shapes, _, _),) = next(iter(families(view, [kind_of("disturbance_tone at pitch")]))).blocks(tangent)
    assert min(abs(f - 3.0) for (f,) in shapes) < 0.02


def test_the_damper_of_a_stop_is_found_from_zero():
    view, model = view_of({"pitch": [ContactStop(20.0, 0.3, relaxation=0.005)]})
    kind = next(k for k in candidates(ARM, {}, frozen=False, weight=0) if k.name == "end_stop at pitch" and
                dict(k.catalogued.choice) == {"side": "upper"})  # fmt: skip
    term = polished(view, tangent_of(view, model), JointTerm(kind, (0.0, 0.28, 0.0, 0.0)))
    assert term.shape[0] == pytest.approx(0.3, abs=0.01)
    assert term.shape[1] == pytest.approx(0.005, abs=0.001)


def test_the_polish_leaves_a_term_without_a_shape(waved):
    view, model = waved
    term = JointTerm(kind_of("coulomb at pitch"), (0.1,))
    assert polished(view, tangent_of(view, model), term) is term


def test_nameless_families_are_of_single_joints(waved):
    view, _ = waved
    for family in nameless_at(view):
        assert family.name == ""
        assert len(family.place) == 1
        assert family.rows.step == view.n_joints


def test_the_limit_of_a_joint_that_stands_still_changes_nothing():
    """No sample of it is judged."""
    tangent = Tangent(np.ones(200), np.zeros((1, 200)), np.eye(200, 3), 100.0, np.ones(200))
    drive, lost = np.random.default_rng(0).standard_normal((2, 100))
    assert _varies(tangent, drive, lost, np.ones(100))
    assert not _varies(tangent, drive, lost, np.zeros(100))
