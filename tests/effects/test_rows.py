"""Each equation stands once: columns, compiled rows, the servo's pass and the chain give the same numbers."""

from __future__ import annotations

import ast
import math
from pathlib import Path

import numpy as np
import pytest
from sklearn.utils import Bunch

import whsklearn
from benchmarks import house
from tests.systems.torque import torque_along
from whsklearn.effects import ContactStop, ParameterChange, codes, effect_names, get_effect
from whsklearn.effects.equations import smooth_sign, tanh
from whsklearn.effects.rows import law_values, term
from whsklearn.gap.plants.servo_candidates import catalogue
from whsklearn.systems import WienerHammersteinSystem
from whsklearn.systems import _servo_kernel as ob

SHAPES = {
    codes.VISCOUS: (0.0, 0.0, 0.0),
    codes.COULOMB: (0.0, 0.0, 0.0),
    codes.TANH: (0.4, 0.0, 0.0),
    codes.TANH_DIFFERENCE: (0.2, 1.1, 0.0),
    codes.STRIBECK_TANH: (0.7, 0.0, 0.0),
    codes.STRIBECK_EXP: (0.5, 1.6, 0.0),
    codes.QUADRATIC_DRAG: (0.0, 0.0, 0.0),
    codes.ASYMMETRIC_COULOMB: (0.0, 0.0, 0.0),
    codes.ASYMMETRIC_VISCOUS: (0.0, 0.0, 0.0),
    codes.POSITION_FRICTION: (3.0, 0.4, 0.0),
    codes.POWER: (3.0, 0.0, 0.0),
    codes.HINGE: (0.3, 0.0, 0.0),
    codes.CONSTANT: (0.0, 0.0, 0.0),
    codes.NATURAL_SPLINE: (-0.5, 0.7, 1.5),
    codes.SPEED_HINGE: (0.2, 0.0, 0.0),
}
ODD = (
    codes.VISCOUS, codes.COULOMB, codes.TANH, codes.TANH_DIFFERENCE, codes.STRIBECK_TANH, codes.STRIBECK_EXP,
    codes.QUADRATIC_DRAG,
)  # fmt: skip
SIGNED = (codes.COULOMB, codes.STRIBECK_EXP, codes.ASYMMETRIC_COULOMB, codes.ASYMMETRIC_VISCOUS)
POINTS = [(x, dx) for x in (-1.3, -0.2, 0.6, 2.0) for dx in (-1.7, -0.31, 0.05, 0.8)]


def test_every_code_is_tested():
    known = {v for k, v in vars(codes).items() if k.isupper() and not k.startswith("N_")}
    assert {v for v in known if v < codes.LEARNED_POSITION} == set(SHAPES)


@pytest.mark.parametrize("kappa", [0.7, 3.0, 12.0])
@pytest.mark.parametrize("code", list(SHAPES))
def test_derivatives_are_those_of_the_value(code, kappa):
    h = 1e-6
    for x, dx in POINTS:
        _, by_x, by_dx = term(code, *SHAPES[code], x, dx, kappa)
        along = [term(code, *SHAPES[code], x + s * h, dx, kappa)[0] for s in (1, -1)]
        across = [term(code, *SHAPES[code], x, dx + s * h, kappa)[0] for s in (1, -1)]
        assert by_x == pytest.approx((along[0] - along[1]) / (2 * h), rel=1e-5, abs=1e-7)
        assert by_dx == pytest.approx((across[0] - across[1]) / (2 * h), rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("code", SIGNED)
def test_sharper_and_sharper_it_becomes_the_sign(code):
    """The distance to kappa = inf falls faster than any power of kappa away from dx = 0."""
    for x, dx in POINTS:
        limit = term(code, *SHAPES[code], x, dx, math.inf)[0]
        away = [abs(term(code, *SHAPES[code], x, dx, k)[0] - limit) for k in (10.0, 100.0, 1000.0)]
        assert away[0] >= away[1] >= away[2]
        assert away[2] < 1e-12


@pytest.mark.parametrize("kappa", [2.0, math.inf])
@pytest.mark.parametrize("code", ODD)
def test_friction_is_odd_and_nothing_at_rest(code, kappa):
    for _, dx in POINTS:
        assert term(code, *SHAPES[code], 0.4, -dx, kappa)[0] == pytest.approx(
            -term(code, *SHAPES[code], 0.4, dx, kappa)[0]
        )
    assert term(code, *SHAPES[code], 0.4, 0.0, kappa)[0] == 0.0


@pytest.mark.parametrize("kappa", [1.0, 1e9, math.inf])
@pytest.mark.parametrize("code", list(SHAPES))
def test_nothing_but_numbers_comes_out(code, kappa):
    for x in (0.0, -1e3, 1e3):
        for dx in (0.0, 1e-300, -1e3, 1e3):
            assert np.isfinite(term(code, *SHAPES[code], x, dx, kappa)).all()


def test_smooth_sign_is_the_tanh_of_the_paper():
    for dx in (-2.0, -0.01, 0.0, 0.3, 50.0):
        value, slope = smooth_sign(dx, 4.0)
        assert value == pytest.approx(math.tanh(4.0 * dx), abs=1e-15)
        assert slope == pytest.approx(4.0 / math.cosh(min(4.0 * dx, 300.0)) ** 2, abs=1e-15)


def test_a_record_is_its_samples():
    x, dx = np.array(POINTS).T
    values = law_values(np.array([codes.STRIBECK_EXP]), np.array([[0.5, 1.6, 0.0]]), x, dx, 3.0)[0]
    np.testing.assert_array_equal(
        values, [term(codes.STRIBECK_EXP, 0.5, 1.6, 0.0, p, q, 3.0)[0] for p, q in zip(x, dx, strict=True)]
    )


def test_powers_of_x_are_exact():
    for degree in range(5):
        assert term(codes.POWER, float(degree), 0.0, 0.0, -1.5, 0.0, 1.0)[0] == (-1.5) ** degree


def test_a_negative_sharpness_gives_the_sign_with_the_slope_of_the_tanh():
    assert smooth_sign(-1e-20, -2.5) == (0.0, 2.5)  # rest
    for dx in (-3.0, -0.2, 0.0, 1e-6, 0.4, 7.0):
        value, slope = smooth_sign(dx, -2.5)
        assert value == np.sign(dx)
        assert slope == pytest.approx(smooth_sign(dx, 2.5)[1])


def test_tanh_is_that_of_the_c_library():
    z = np.concatenate([np.linspace(-3, 3, 10_001), np.geomspace(1e-300, 700, 1000), [0.0, np.inf, -np.inf]])
    np.testing.assert_allclose([tanh(v) for v in z.tolist()], np.tanh(z), rtol=1e-15)
    assert np.isnan(tanh(np.nan))


PACKAGE = Path(whsklearn.__file__).parent
TRANSCENDENTAL = {"cos", "sin", "exp", "expm1", "tanh", "sign", "clip", "hypot"}
CHANGES = [ParameterChange(0.3, 1.0, p) for p in ("viscous", "coulomb", "gain")]
BUILT_IN = [get_effect(n)() for n in effect_names() if get_effect(n).__module__.startswith("whsklearn.")]
TORQUES = [e for e in BUILT_IN if e.port == "torque" and e.column_kind == "exact"]
STOPS = [ContactStop(9.0, 0.6, 0.1, 0.2, side=s) for s in ("upper", "lower", "both")]
MEMORYLESS = [*(e for e in TORQUES if e.name not in ("presliding_hysteresis", "parameter_change")), *STOPS]


def identity(effect):
    return f"{effect.name}-{effect.options}" if effect.options else effect.name


@pytest.fixture(scope="module")
def signals():
    t = np.arange(500) / 100.0
    q = 1.7 * np.sin(2.0 * t)
    v = np.where((t > 1.0) & (t < 1.2), 0.0, 3.4 * np.cos(2.0 * t))
    return Bunch(time=t, position=q, velocity=v, acceleration=-6.8 * np.sin(2.0 * t), drive=np.cos(3.1 * t))


@pytest.mark.parametrize("effect", [*MEMORYLESS, *CHANGES, get_effect("torque_ripple")()], ids=identity)
def test_the_pass_applies_what_the_columns_say(effect, signals):
    plant = ob.plant_of([effect], ob.bare_parts(1.0))
    applied = torque_along(plant, signals.time, signals.position, signals.velocity, signals.drive)
    np.testing.assert_allclose(applied, effect.contribution(signals), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("effect", [*MEMORYLESS, *CHANGES[:2], get_effect("presliding_hysteresis")()], ids=identity)
def test_the_chain_adds_what_the_columns_say(effect):
    """The law's block is feed-forward, so what an effect adds to v is its contribution at x and dx."""
    dt = 0.01
    parts = {"a": [1.0, 0.4], "b": [0.5], "c": [1.0], "d": [0.2], "law": "viscous"}
    u = np.random.default_rng(0).normal(size=400)
    base = WienerHammersteinSystem(**parts, dt=dt).signals(u)
    more = WienerHammersteinSystem(**parts, dt=dt, effects=[effect]).signals(u)
    dx = np.diff(base.x, prepend=0.0)
    motion = Bunch(time=dt * np.arange(u.size), position=base.x, velocity=dx, acceleration=dx, drive=u)
    np.testing.assert_allclose(more.v - base.v, effect.contribution(motion), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("effect", [e for e in BUILT_IN if e.port == "output"], ids=identity)
def test_the_sensor_reads_what_the_columns_say(effect, signals):
    plant = ob.plant_of([effect], ob.bare_parts(1.0))
    out = ob.follow(plant, np.cos(3.0 * np.arange(300) / 100.0), np.zeros((2, 300)), ob.How(0.01, 2))
    motion = Bunch(time=np.arange(300) * 0.01, position=out[ob.POSITION])
    added = out[ob.MEASURED] - out[ob.POSITION]
    if effect.column_kind == "none":
        assert np.abs(added).max() <= effect.magnitude / 2 + 1e-12
    else:
        np.testing.assert_allclose(added, effect.contribution(motion), atol=1e-12)


def test_every_effect_has_a_code_of_its_own():
    given = [e.code for e in BUILT_IN if e.name != "parameter_change"] + [c.code for c in CHANGES]
    assert len(set(given)) == len(given)
    assert min(given) >= 0


def kernels():
    """Compiled functions of the package outside ``effects/``, with their files."""
    for file in sorted(PACKAGE.rglob("*.py")):
        if file.is_relative_to(PACKAGE / "effects"):
            continue
        for node in ast.walk(house.tree(file)):
            if isinstance(node, ast.FunctionDef) and any("njit" in ast.unparse(d) for d in node.decorator_list):
                yield file.relative_to(PACKAGE), node


def test_no_kernel_outside_the_effects_writes_an_equation_of_its_own():
    """Waves, signs, exponentials and clips are what the equations are made of: no simulator holds one."""
    simulators = ("systems", "gap")
    found = [
        f"{file}: {node.name} calls {ast.unparse(call.func)}"
        for file, node in kernels()
        if file.parts[0] in simulators
        for call in ast.walk(node)
        if isinstance(call, ast.Call) and ast.unparse(call.func).split(".")[-1] in TRANSCENDENTAL
    ]
    assert not found


def test_no_module_outside_the_effects_has_a_table_of_them_by_code():
    """A table of columns or sizes by code, made of signals and scales, is a second place that knows the equations."""
    names = {n for n in vars(codes) if n.isupper()}
    tables = [
        f"{file.relative_to(PACKAGE)}:{node.lineno}"
        for file in sorted(PACKAGE.rglob("*.py"))
        if not file.is_relative_to(PACKAGE / "effects")
        for node in ast.walk(house.tree(file))
        if isinstance(node, ast.Dict)
        if any(isinstance(key, ast.Attribute) and key.attr in names for key in node.keys)
        and any(isinstance(part, ast.Call | ast.BinOp | ast.Attribute) for v in node.values for part in ast.walk(v))
    ]
    assert not tables


def test_a_wave_is_what_stands_before_it_times_a_cosine():
    """Scans of orders and frequencies take the factor before a wave from the effect's own column at order zero."""
    motion = Bunch(time=np.zeros(50), position=np.zeros(50), velocity=np.linspace(-1.0, 1.0, 50), drive=np.arange(50.0))
    turned = Bunch(**{**motion, "position": np.linspace(-3.0, 3.0, 50), "time": np.linspace(0.0, 9.0, 50)})
    for kind in (c for c in catalogue() if c.linear == 2 and c.scanned):
        front = kind.unit_columns((0.0,), motion)[:, 0]
        phase = 2 * np.pi * 1.3 * turned.time if kind.scanned == "time" else 1.3 * turned.position
        wave = np.column_stack([front * np.cos(phase), front * np.sin(phase)])
        np.testing.assert_allclose(kind.unit_columns((1.3,), turned), wave, atol=1e-12, err_msg=kind.name)


def test_no_other_module_numbers_the_effects():
    names = {n for n in vars(__import__("whsklearn.effects.codes", fromlist=["x"])) if n.isupper()}
    again = [
        f"{file.relative_to(PACKAGE)}: {target.id}"
        for file in sorted(PACKAGE.rglob("*.py"))
        if file.name != "codes.py"
        for node in ast.walk(house.tree(file))
        if isinstance(node, ast.Assign)
        for target in ast.walk(node.targets[0])
        if isinstance(target, ast.Name) and target.id in names - {"N_NUMBERS", "N_SHAPE", "TANH"}
    ]
    assert not again
