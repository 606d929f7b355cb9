"""Which structure a record asks for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.recursion.axis_log import TRUTH, axis_log, slow_drive
from whsklearn.effects import CableSpring, Coulomb, FrictionLaw, Hinge, Power, Viscous
from whsklearn.identification import Compared, identify
from whsklearn.identification.axis_fit import fit_placed_axis, fit_rigid_axis
from whsklearn.identification.compare import (
    _at_floor,
    _better,
    _indices,
    _no_chain,
    _of_position,
    _of_waves_or_stops,
    _of_weight,
    _score,
    _unstable,
    recommend,
)
from whsklearn.identification.linear_fit import fit_arx, fit_output_error
from whsklearn.identification.view import view
from whsklearn.logs import LogError
from whsklearn.models import AxisModel, ChainModel, LinearModel
from whsklearn.recursion.batch.axis_free_run import HANGS, axis_motion
from whsklearn.systems import PIDController, ServoAxis

RNG = np.random.default_rng(0)


@pytest.fixture(scope="module")
def axis_record():
    u = slow_drive(4000, 1)
    log = axis_log(u)
    return u, axis_motion(TRUTH, log), axis_motion(TRUTH, log._replace(of_position=True))


@pytest.mark.parametrize("logged", ["velocity", "position"])
def test_an_axis_is_recommended_for_an_axis(axis_record, logged):
    u, velocity, position = (signal[:1200] for signal in axis_record)
    y = velocity if logged == "velocity" else position
    y = y + (1e-2 if logged == "velocity" else 1e-5) * RNG.standard_normal(y.size)
    found = identify(u, y, dt=0.005, logged="auto" if logged == "position" else "velocity")
    assert found.train.logged == logged
    assert found.recommended.name == "axis, viscous and Coulomb", found.reason
    assert isinstance(found.model, AxisModel)
    assert found.model.inertia == pytest.approx(0.05, rel=0.02)
    assert found.model.parameters["coulomb"] == pytest.approx(0.3, rel=0.02)
    arx = min(c.score for c in found.models if c.kind == "arx")
    assert found.recommended.score < 0.5 * arx


def test_gravity_is_recommended_for_a_pendulum_and_only_where_the_output_is_an_angle():
    u, theta = 2.0 * slow_drive(800, 1), np.array([0.05, 0.1, 0.2, 0.02, 1.5, 0.4])
    y = axis_motion(theta, axis_log(u, orders=HANGS)._replace(of_position=True)) + 1e-4 * RNG.standard_normal(u.size)
    found = identify(u, y, dt=0.005)
    assert found.recommended.name == "axis with gravity", found.reason
    assert found.model.parameters["gravity_imbalance"] == pytest.approx(np.hypot(1.5, 0.4), rel=0.03)
    for other in ({"logged": "velocity"}, {"units": {"input": "Nm", "output": "m"}}):
        assert "axis with gravity" not in [c.name for c in identify(u[:200], y[:200], dt=0.005, **other).models]


def test_a_spring_beside_a_weight_is_recommended():
    u, theta = slow_drive(1500, 1), np.array([0.05, 0.1, 0.2, 0.02, 0.6, 0.2, 0.6])
    y = axis_motion(theta, axis_log(u, orders=HANGS, powers=1)._replace(of_position=True))
    found = identify(u, y + 1e-4 * RNG.standard_normal(u.size), dt=0.005)
    assert found.recommended.name == "axis with gravity and a spring", found.reason
    for name, value in {"gravity_imbalance": np.hypot(0.6, 0.2), "cable_spring": 0.6}.items():
        assert abs(found.model.parameters[name] - value) < 4.0 * found.model.standard_errors[name]


def test_cogging_is_recommended_and_what_takes_longer_is_not_tried():
    u = 2.0 * slow_drive(1500, 1)
    log = axis_log(u, orders=np.array([8.0]))._replace(of_position=True)
    y = axis_motion(np.array([0.05, 0.1, 0.2, 0.02, 0.3, 0.2]), log) + 1e-4 * RNG.standard_normal(u.size)
    found = identify(u, y, dt=0.005)
    assert found.recommended.name == "axis with cogging", found.reason
    assert found.model.parameters["cogging"] == pytest.approx(np.hypot(0.3, 0.2), rel=0.01)
    assert found.model.parameters["cogging__order"] == pytest.approx(8.0, abs=1e-3)
    skipped = [c.name for c in found.models if c.failure.startswith("skipped")]
    assert {"axis with gravity and cogging", "Wiener-Hammerstein"} < set(skipped)


def test_a_linear_system_is_no_chain():
    u = RNG.standard_normal(290)
    y = lfilter([0.0, 0.5, 0.2], [1.0, -1.2, 0.5], u) + 0.02 * RNG.standard_normal(290)
    found = identify(u, y)
    assert found.recommended.kind in ("arx", "output_error"), found.reason
    assert found.recommended.test["nmse"] < 0.01


def test_the_error_over_the_held_out_end_is_of_a_model_that_has_not_seen_it():
    u = np.random.default_rng(5).standard_normal(290)
    y = lfilter([0.0, 0.5, 0.2], [1.0, -1.2, 0.5], u)
    y[203:] *= 1.5  # a model of all samples is closer to both than one of the first 70 %
    found = identify(u, y, logged="output")
    chosen, record = found.recommended, view(u, y, 1.0, "output")
    before = {"arx": fit_arx, "output_error": fit_output_error}[chosen.kind](
        record.part(0, 203), chosen.structure["order"]
    )
    assert chosen.test == _indices(before, record.part(203, 290), 30)
    assert chosen.test != _indices(found.model, record.part(203, 290), 30)


def test_an_output_that_does_not_follow_is_told():
    u, y = RNG.standard_normal((2, 250))
    assert "hardly better" in identify(u, y).reason


def test_a_steady_rotation_follows_its_drive():
    """What constant velocity predicts as well says nothing against the structures."""
    u = 1.0 + 0.02 * np.sin(np.arange(290) / 9.0)
    y = axis_motion(TRUTH, axis_log(u)._replace(of_position=True, start=np.array([[6.7, 0.0]])))
    found = identify(u, y + 5e-3 * np.random.default_rng(0).standard_normal(290), dt=0.005, logged="position")
    assert found.recommended.test["nmse"] < 1e-3
    assert "does not follow" not in found.reason
    assert "log changes of speed" in found.reason


def test_a_steady_rotation_is_an_axis_of_which_the_friction_is_known():
    """A controller keeps 10 rad/s to a count, so the drive is friction and noise: no inertia is seen."""
    rng = np.random.default_rng(2)
    q = 10.0 * 0.002 * np.arange(1500)
    u = 0.8 + 0.01 * rng.standard_normal(q.size)
    found = identify(u, np.round(q / 1.5e-3) * 1.5e-3, dt=0.002, units={"input": "Nm", "output": "rad"})
    assert found.recommended.name == "axis, viscous and Coulomb", found.reason
    assert "friction and offset take 0." in found.reason
    p = found.model.parameters
    assert p["viscous"] * 10.0 + p["coulomb"] + p["input_offset"] == pytest.approx(0.8, rel=0.01)
    assert found.model.standard_errors["coulomb"] > 0.2
    assert found.model.standard_errors["inertia"] > 0.3 * p["inertia"]


def test_an_axis_whose_weight_goes_over_the_top_may_lose_its_long_run():
    def tried(name, kind, score, nmse, unstable=False):
        model = LinearModel([0.0, 1.0], [1.0])
        return Compared(name, kind, {}, "-", model, score=score, test={"nmse": nmse}, unstable=unstable)

    trivial, axis, chain = (
        Compared("t", "trivial", {}, "-", score=1.0),
        ("axis", "axis"),
        ("chain", "wiener-hammerstein"),
    )
    chosen, reason = recommend([tried(*axis, 0.3, 50.0, True), tried(*chain, 0.7, 0.1)], trivial)
    assert (chosen.name, "its long run is lost" in reason) == ("axis", True)
    chosen, _ = recommend([tried(*axis, 0.3, 50.0), tried(*chain, 0.7, 0.1)], trivial)
    assert chosen.name == "chain"  # the run of the axis is lost from wherever it begins
    chosen, _ = recommend([tried(*axis, 0.4, 50.0, True), tried(*chain, 0.7, 0.1)], trivial)
    assert chosen.name == "chain"  # what holds its run, unless it leaves twice as much over windows


@pytest.mark.parametrize(("weight", "unstable"), [(-8.0, True), (8.0, False)])
def test_a_run_from_the_top_ends_elsewhere_if_it_begins_later_and_one_from_below_does_not(weight, unstable):
    """A controller balances a weight at its top, where the run of the true axis falls to one side or the other."""
    parts = {"controller": PIDController(60.0, 0.0, 12.0), "sample_rate": 200.0}
    axis = ServoAxis(0.5, [Viscous(0.5), Coulomb(0.2)], [CableSpring(weight)], **parts)
    time = np.arange(3000) / 200.0
    reference = 0.4 * np.sin(2.0 * time) + 0.2 * np.sin(5.3 * time)
    r = axis.simulate(reference, random_state=0)
    noise = 0.05 * np.random.default_rng(0).standard_normal(time.size)
    log = view(r.drive + noise, r.position, 1.0 / 200.0, "position")
    model = fit_placed_axis(log, 1)
    assert model.parameters["cable_spring"] == pytest.approx(weight, rel=0.05)
    assert _unstable(model, log) == unstable


@pytest.mark.parametrize(
    ("u", "y", "message"),
    [
        (np.ones(200), RNG.standard_normal(200), "input never changes"),
        (RNG.standard_normal(200), np.full(200, np.nan), "not finite"),
        (RNG.standard_normal(200), RNG.standard_normal(199), "equal numbers"),
        (RNG.standard_normal(20), RNG.standard_normal(20), "at least 100"),
    ],
)
def test_what_cannot_be_identified_is_refused(u, y, message):
    with pytest.raises(ValueError, match=message):
        identify(u, y)


def test_what_is_not_known_of_the_torque_constant_enters_the_intervals(axis_record):
    u, velocity, _ = axis_record
    y = velocity[:2000] + 1e-2 * np.random.default_rng(3).standard_normal(2000)
    plain, scaled = (identify(u[:2000], y, dt=0.005, logged="velocity", drive_error=e).model for e in (0.0, 0.1))
    for name in ("inertia", "viscous", "coulomb"):
        expected = np.hypot(plain.standard_errors[name], 0.1 * plain.parameters[name])
        assert scaled.standard_errors[name] == pytest.approx(expected)


def test_all_segments_of_a_record_with_holes_are_used(axis_record):
    u, _, position = axis_record
    noise = np.random.default_rng(5)
    y = position + 1e-5 * noise.standard_normal(position.size)
    kept = np.ones(u.size, dtype=bool)
    for hole in (slice(700, 760), slice(1500, 1560), slice(1580, 1600), slice(2600, 2660)):
        kept[hole] = False
    groups = np.cumsum(np.diff(np.r_[1, kept.astype(int)]) == 1)
    found = identify(u[kept], y[kept], dt=0.005, groups=groups[kept])
    assert found.train.logged == "position"
    assert found.rows_used == f"{kept.sum() - 20} of {kept.sum()} in 4 segments"  # 20 between two are too few
    assert isinstance(found.model, AxisModel), found.reason
    whole = fit_rigid_axis(view(u, y, 0.005, "position"))
    for name, true in (("inertia", 0.05), ("coulomb", 0.3)):
        assert found.model.parameters[name] == pytest.approx(true, rel=0.02)
        assert found.model.standard_errors[name] < 1.5 * whole.standard_errors[name]  # 95 % of its samples
    assert "of the error" in found.reason


def test_groups_of_another_length_are_refused(axis_record):
    u, velocity, _ = axis_record
    with pytest.raises(ValueError, match="expected one for each"):
        identify(u[:500], velocity[:500], dt=0.005, groups=np.zeros(499))


def test_a_fit_to_all_of_the_record_that_ends_worse_than_the_first_is_not_taken():
    u = RNG.standard_normal(400)
    good, bad = LinearModel([0.0, 0.5], [1.0, -0.5]), LinearModel([0.0, 0.4], [1.0, -0.6])
    log = view(u, good.simulate(u) + 0.01 * RNG.standard_normal(400), 1.0, "output")
    pair = [Compared("", "output_error", {}, "simulation", m) for m in (good, bad)]
    assert _better(*pair, log) is good
    assert _better(*pair[::-1], log) is good
    assert _better(pair[0], Compared("", "output_error", {}, "simulation"), log) is good


def test_a_free_run_that_is_lost_is_recommended_only_where_all_are():
    """Windows no longer than their model holds say nothing of a run of minutes."""
    trivial = Compared("constant velocity", "trivial", {}, "-", score=10.0)

    def tried(*runs):
        named = zip(("A", "B", "C"), (3.0, 1.0, 2.0), runs, strict=True)
        return [Compared(name, "arx", {}, "-", score=score, test=run) for name, score, run in named]

    chosen, reason = recommend(tried({"nmse": 0.5}, {"nmse": 4e4}, {"nmse": 0.9}), trivial)
    assert chosen.name == "C"
    assert "B is better over windows" in reason
    assert "NMSE 4e+04" in reason
    assert recommend(tried({"nmse": 0.5}, {}, {"nmse": 2.0}), trivial)[0].name == "A"
    chosen, reason = recommend(tried({"nmse": 1.5}, {"nmse": 4e4}, {}), trivial)
    assert chosen.name == "B"
    assert "short windows only" in reason
    good = tried({"nmse": 0.5}, {"nmse": 0.2}, {"nmse": 0.3})
    good[1].by_drive = 1.0
    chosen, reason = recommend(good, trivial)
    assert chosen.name == "C"
    assert "B is better over windows, but without its drive it predicts them as well" in reason
    chosen, reason = recommend(tried({"nmse": 0.5}, {"nmse": 0.2}, {"nmse": 4e4}), trivial)
    assert chosen.name == "B"
    assert "free run" not in reason


def test_a_free_run_that_owes_nothing_to_its_drive_is_no_merit():
    """The line through a pendulum's swings is closer to them than their mean, whatever the drive does."""
    trivial = Compared("constant velocity", "trivial", {}, "-", score=1.0)
    runs = (("integrator", 3.0, {"nmse": 0.3}), ("axis", 1.2, {"nmse": 40.0}))
    tried = [Compared(name, "arx", {}, "-", score=score, test=run) for name, score, run in runs]
    assert "for long runs" in recommend(tried, trivial)[1]
    tried[0].run_by_drive = 1.3
    chosen, reason = recommend(tried, trivial)
    assert chosen.name == "axis"
    assert "does not follow this input" in reason


def test_the_inverse_of_a_controller_is_no_axis():
    """A loop that follows its reference well shows its controller: the drive leads the motion against itself."""
    rng, dt = np.random.default_rng(0), 0.002
    inertia, gain, n = 0.02, 0.4, 4000
    reference = 3.0 + lfilter([0.002], [1.0, -0.998], rng.standard_normal(n)) * 20.0
    push = 0.05 * lfilter([0.05], [1.0, -0.95], rng.standard_normal(n))  # what the axis is pushed by beside its drive
    v, u = np.zeros(n), np.zeros(n)
    for k in range(1, n):
        v[k] = v[k - 1] + dt * (u[k - 1] + push[k - 1] - 0.01 * v[k - 1] - 0.02 * np.sign(v[k - 1])) / inertia
        u[k] = gain * (reference[k] - v[k])
    log = view(u, v, dt, "velocity")
    found = {}
    for name, model in (
        ("controller", LinearModel([0.0, -1.0 / gain], [1.0, -0.1])),
        ("axis", LinearModel([0.0, dt / inertia], [1.0, -0.9995])),
    ):
        found[name] = Compared(name, "arx", {}, "prediction", model)
        _score(found[name], log)
    assert found["axis"].along_drive
    assert not found["controller"].along_drive
    found["controller"].score, found["controller"].by_drive, found["controller"].test = 0.1, 0.1, {"nmse": 0.1}
    axis = Compared("axis, viscous and Coulomb", "axis", {}, "-", score=0.5, test={"nmse": 0.5})
    trivial = Compared("constant velocity", "trivial", {}, "-", score=1.0)
    chosen, reason = recommend([found["controller"], axis], trivial)
    assert chosen is axis
    assert "slowly against its drive" in reason
    assert recommend([found["controller"]], trivial)[0] is found["controller"]  # no axis: any system


@pytest.mark.parametrize("resonance", [None, 8.0])
@pytest.mark.parametrize("drive", ["noise", "sweep", "sine"])
def test_an_axis_behind_a_lag_or_a_spring_moves_along_its_drive(drive, resonance):
    """Work is no test: of a sine of 3 Hz that acts 20 ms late, an axis gives it back."""
    dt, n = 0.002, 6000
    t = dt * np.arange(n)
    u = {
        "noise": np.random.default_rng(0).standard_normal(n),
        "sweep": np.sin(2.0 * np.pi * (t + 0.5 * 59.0 / t[-1] * t**2)),
        "sine": np.sin(2.0 * np.pi * 3.0 * t),
    }[drive]
    poles = [np.exp(-dt), np.exp(-dt / 0.02)]
    if resonance:
        poles[1:] = np.exp(2.0 * np.pi * resonance * dt * np.array([-0.03 + 1j, -0.03 - 1j]))
    model = LinearModel([0.0, 0.001], np.poly(poles).real)
    compared = Compared("", "arx", {}, "prediction", model)
    _score(compared, view(u, model.simulate(u) + 1e-6 * np.cos(t), dt, "velocity"))
    assert compared.along_drive


def test_what_travel_is_too_short_to_tell_apart_is_said():
    trivial = Compared("constant velocity", "trivial", {}, "-", score=10.0)
    both = [
        Compared(name, "axis", {"effects": effects}, "-", score=score, test={"nmse": 0.1})
        for name, effects, score in (("spring", ["cable_spring"], 1.0), ("gravity", ["gravity_imbalance"], 1.05))
    ]
    assert "gravity predicts about as well" in recommend(both, trivial)[1]
    both[1].score = 1.2
    assert "about as well" not in recommend(both, trivial)[1]


def test_gravity_over_little_travel_is_not_replaced_by_a_cubic_that_imitates_it():
    t = 0.01 * np.arange(500)
    waves = ((0.2, 3.0), (0.15, 7.1))
    q, v, a = (sum(size * w**k * np.sin(w * t + k * np.pi / 2) for size, w in waves) for k in range(3))
    u = 0.08 * a + 0.2 * v + 0.1 * np.sign(v) + 0.8 * np.sin(q + 0.3)
    y = q + 1e-5 * np.random.default_rng(0).standard_normal(500)
    found = identify(u, y, dt=0.01, logged="position", units={"input": "Nm", "output": "rad"})
    assert found.recommended.name == "axis with gravity", found.reason
    assert "gravity is the best" in next(c.failure for c in found.models if "over position" in c.name)


@pytest.mark.parametrize(("travel", "told"), [(0.5, True), (0.01, False)])
@pytest.mark.parametrize(
    ("force", "name"), [(lambda q: 1.5 * q, "axis on a spring"), (lambda q: 1.5 * np.sin(q + 0.4), "axis with gravity")]
)
def test_a_spring_is_no_weight_and_where_the_travel_is_too_short_it_is_said(force, name, travel, told):
    t = 0.01 * np.arange(280)
    waves = ((0.6, 3.0), (0.4, 7.1))
    q, v, a = (travel * sum(s * w**k * np.sin(w * t + k * np.pi / 2) for s, w in waves) for k in range(3))
    u = 0.08 * a + 0.2 * v + 0.1 * np.sign(v) + force(q)
    y = q + 2e-5 * np.random.default_rng(0).standard_normal(t.size)
    found = identify(u, y, dt=0.01, logged="position", units={"input": "Nm", "output": "rad"})
    assert ("does not tell them apart" in found.reason) == (not told), found.reason
    assert found.recommended.name == name or not told


@pytest.mark.parametrize(
    ("weight", "spring", "cubic", "force"),
    [(1.0, 3.0, True, True), (1.0, 1.01, False, True), (1.01, 1.0, False, False), (1.0, np.inf, True, True)],
)
def test_a_cubic_is_not_tried_where_a_weight_is_seen(weight, spring, cubic, force):
    """In unknown units a wave may be a line, and a hardening spring is then tried all the same."""
    names = {"axis, viscous and Coulomb": 9.0, "axis with gravity": weight, "axis on a spring": spring}
    tried = [Compared(name, "axis", {}, "-", score=score) for name, score in names.items()]
    assert _of_weight(tried, sure=True) == cubic
    assert _of_weight(tried, sure=False) == force


def test_of_one_kind_the_simpler_is_kept_where_windows_differ_by_chance():
    rng = np.random.default_rng(3)
    trivial = Compared("constant velocity", "trivial", {}, "-", score=10.0)

    def pair(kind, gain):
        squares = rng.chisquare(2.0, 24)
        simple = Compared("simple", kind, {}, "-", score=1.1, test={"nmse": 0.1}, squares={50: squares})
        better = squares * rng.exponential(1.0, 24) ** 2 if gain == "here and there" else squares / 1.1**2
        best = Compared("best", "axis", {}, "-", score=1.0, test={"nmse": 0.1}, squares={50: better})
        return recommend([simple, best], trivial)

    chosen, reason = pair("axis", "here and there")
    assert chosen.name == "simple"
    assert "best is no better than the choice of windows makes it by chance" in reason
    assert pair("axis", "everywhere")[0].name == "best"
    assert pair("arx", "here and there")[0].name == "best"


def test_a_slow_linear_model_is_not_judged_by_the_state_in_which_a_log_begins():
    """A tank that is not empty when its log begins."""
    u = np.random.default_rng(1).normal(size=600)
    model = LinearModel([0.0, 0.02], [1.0, -0.98])
    log = view(u, model.simulate(u) + 5.0 * 0.98 ** np.arange(600), 1.0, "output")
    assert _indices(model, log, 0)["nmse"] < 1e-9


def test_a_chain_is_judged_from_the_motion_that_a_held_out_part_begins_in():
    """Coupled belts in motion where the record is cut: a run from rest told 0.34 V of a model that is off by 0.03."""
    u = np.random.default_rng(1).normal(size=600)
    model = ChainModel((0.0, 0.02), (1.0, -0.98), FrictionLaw([Power(-1.0, 1.0), Hinge(2.0, 0.0)]), (1.0,), (1.0,))
    found = identify(u, model.simulate(u), logged="output")
    rectified = next(c for c in found.models if c.name == "output error, order 2, without its sign")
    assert rectified.test["nmse"] < 1e-6, rectified


def test_a_run_beyond_what_can_be_squared_is_lost_without_a_warning():
    """Warnings are errors here; the command would print NumPy's own."""
    u = np.ones(700)
    log = view(u + 0.1 * np.sin(np.arange(700.0)), np.sin(0.05 * np.arange(700)), 1.0, "output")
    lost = Compared("ARX, order 1", "arx", {}, "prediction", LinearModel([0.0, 1.0], [1.0, -2.0]))
    _score(lost, log)
    assert lost.score == np.inf
    assert max(x.max() for x in lost.squares.values()) == np.inf


def test_a_coarse_encoder_whose_noise_is_not_seen_is_at_the_floor_too(axis_record):
    """Its steps are rarer than samples, so most third differences are zero."""
    u, _, position = axis_record
    step = np.ptp(position) / 100.0
    whole = view(u, step * np.round(position / step), 0.005, "position")
    fitting, held_out = whole.part(0, 2800), whole.part(2800, 4000)
    axis = Compared("axis, viscous and Coulomb", "axis", {}, "simulation", fit_rigid_axis(fitting))
    _score(axis, held_out)
    axis.test = _indices(axis.model, held_out, 60)
    assert axis.score > 1.3
    assert _at_floor(axis, fitting)


@pytest.mark.parametrize(("least", "skipped"), [(0.2, True), (0.3, False)])
def test_no_load_is_sought_behind_a_spring_where_a_weight_leaves_far_less(least, skipped):
    """The model with a load has no weight; that a load leaves less than the axis with a weight is no reason either."""
    rigid, weight, load = (Compared(name, "axis", s, "") for name, s in (
        ("axis, viscous and Coulomb", {}), ("axis with gravity", {"effects": ["gravity_imbalance"]}),
        ("axis with a load behind a spring", {"effects": ["flexible_coupling"]}),
    ))  # fmt: skip
    rigid.score, weight.score, load.score = 1.0, least, 0.1
    assert _of_position([rigid, weight, load]) == skipped


@pytest.mark.parametrize(("least", "skipped"), [(0.2, True), (0.3, False)])
def test_no_other_force_is_sought_where_cogging_leaves_far_less(least, skipped):
    names = ("axis, viscous and Coulomb", "axis with gravity", "axis with cogging")
    rigid, weight, cogging = (Compared(name, "axis", {}, "") for name in names)
    rigid.score, weight.score, cogging.score = 2.0, 1.0, least
    assert _of_waves_or_stops([rigid, weight, cogging]) == skipped


def test_only_a_weight_that_cannot_be_told_from_other_forces_is_called_as_good():
    spring = Compared("axis on a spring", "axis", {"effects": ["cable_spring"]}, "", score=1.0, by_drive=0.1)
    weight = Compared("axis with gravity", "axis", {"effects": ["gravity_imbalance"]}, "", failure="Its inertia is 0.")
    trivial = Compared("constant velocity", "trivial", {}, "-", score=10.0)
    assert "about as well" not in recommend([spring, weight], trivial)[1]
    weight.untold = True
    assert "gravity predicts about as well" in recommend([spring, weight], trivial)[1]


@pytest.mark.parametrize("missing", [0.0, 0.2])
def test_an_axis_that_leaves_white_noise_of_a_velocity_needs_no_chain(missing):
    """The floor of noise that is as fast as the velocity is not known, and no error over windows is near it."""
    rng = np.random.default_rng(9331)
    u = 0.5 + 0.02 * np.sin(0.04 * np.arange(4000)) + 0.01 * np.sin(0.11 * np.arange(4000))
    log = axis_log(u)._replace(start=np.array([[1.8, 0.0]]))
    position = axis_motion(TRUTH, log._replace(of_position=True))
    y = axis_motion(TRUTH, log._replace(u=log.u + missing * np.sin(6.0 * position)[:, None]))
    whole = view(u, y + 0.05 * rng.standard_normal(y.size), 0.005, "velocity")
    fitting, held_out = whole.part(0, 2800), whole.part(2800, 4000)
    axis = Compared("axis, viscous and Coulomb", "axis", {}, "simulation", fit_rigid_axis(fitting))
    _score(axis, held_out)
    axis.test = _indices(axis.model, held_out, 60)
    assert axis.score > 1.3
    assert _at_floor(axis, held_out) == (not missing)


@pytest.mark.parametrize(
    ("axis", "linear", "needless"),
    [(0.1, 1.0, True), (0.3, 1.0, False), (0.1, 0.3, False), (None, 1.0, False), (0.1, np.inf, True)],
)
def test_a_chain_is_not_fitted_where_an_axis_is_far_better_than_a_linear_model(axis, linear, needless):
    """A chain is a linear model with one curve in it; it took half of the time, and was never as good."""
    tried = [Compared("ARX, order 2", "arx", {}, "prediction", score=linear)]
    tried += [] if axis is None else [Compared("axis, viscous and Coulomb", "axis", {}, "simulation", score=axis)]
    tried.append(Compared("without its sign", "wiener-hammerstein", {}, "simulation", score=0.01))
    assert _no_chain(tried) == needless


def test_the_log_that_holds_no_motion_is_named_before_anything_is_fitted():
    rng = np.random.default_rng(0)
    u = np.cumsum(rng.standard_normal(600)) / 10
    y = np.r_[np.cumsum(np.cumsum(u[:300])) * 1e-4, 1e-4 * rng.standard_normal(300)]
    units, fits = {"input": "Nm", "output": "rad"}, []
    with pytest.raises(LogError, match=r"^tuesday: The axis hardly moves"):
        identify(u, y, dt=0.01, units=units, records=np.repeat(["monday", "tuesday"], 300), progress=fits.append)
    with pytest.raises(LogError, match=r"^The axis hardly moves"):
        identify(u[:300], y[:300], dt=0.01, units=units, test=(u[300:], y[300:]), progress=fits.append)
    assert not fits
