"""The logs and rules by which benchmarks judge the gap workflow: physics of the makers, and what counts as right."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from benchmarks import calibration, house, names
from benchmarks import causes as judge
from benchmarks.blind_logs import causes, filtered_chain


def motion(log: causes.Log) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(drive, position, acceleration), smoothed over nine samples."""
    t, u, q = (log.frame[c].to_numpy() for c in ("time_s", "torque_nm", "position_rad"))
    q = np.convolve(q, np.ones(9) / 9, mode="same")
    return u[30:-30], q[30:-30], np.gradient(np.gradient(q, t), t)[30:-30]


def rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))


def test_a_seed_draws_the_same_log_again_and_another_seed_another() -> None:
    first, again, other = (causes.make("wrist", seed).frame for seed in (0, 0, 1))
    assert first.equals(again)
    assert not first.equals(other)


def test_inertia_and_gravity_of_a_free_swing_nearly_cancel() -> None:
    _, q, a = motion(causes.make("free_swing", 0))
    gravity = 19.6 * np.sin(q)
    assert np.ptp(q) > 2.0
    assert rms(a + gravity) < 0.2 * rms(gravity)


def test_the_wrist_meets_its_limit_in_a_few_samples_only() -> None:
    u = causes.make("wrist", 0).frame["torque_nm"].to_numpy()
    near = np.abs(u) > 0.97 * np.abs(u).max()
    assert 0 < np.mean(near) < 0.03


@pytest.mark.parametrize("seconds", [-0.016, 0.038])
def test_an_aged_drive_acts_so_much_later(seconds: float) -> None:
    t = np.arange(0.0, 4.0, 0.002)
    log = causes.Log(causes.make("wrist", 0).frame.iloc[: t.size].assign(time_s=t, torque_nm=np.sin(3 * t)), {})
    frame = causes.aged(log, seconds).frame
    start = max(0.0, -seconds)  # what was before the log is cut off, and time begins at zero again
    wanted = np.sin(3 * (frame["time_s"] + np.ceil(start / 0.002 - 1e-9) * 0.002 + seconds))
    np.testing.assert_allclose(frame["torque_nm"], wanted, atol=2e-5)


def test_travels_are_as_small_as_they_say() -> None:
    q = causes.make("small_travel_spring", 0).frame["position_rad"]
    assert 0.5 * 0.004 < np.ptp(q) < 1.5 * 0.004


def test_a_stop_holds_the_axis_while_the_drive_is_at_its_limit() -> None:
    pytest.importorskip("mujoco")
    frame = causes.make("mujoco_stop", 0).frame
    u, q = frame["torque_nm"].to_numpy(), frame["position_rad"].to_numpy()
    assert np.abs(frame["reference_rad"]).max() > 1.4
    assert np.abs(q).max() < 1.3
    assert np.abs(q[np.abs(u) >= 4.0]).min() > 0.9


def test_a_chain_is_delayed_by_as_many_samples_as_it_says() -> None:
    u = np.random.default_rng(0).normal(size=512)
    np.testing.assert_allclose(filtered_chain.delayed(u, 3.0)[3:], u[:-3], atol=1e-9)


@pytest.mark.parametrize("effect", filtered_chain.PORTS)
def test_ports_of_a_chain_change_the_record_and_have_a_name_of_the_catalogue(effect: str) -> None:
    from whsklearn.effects import effect_names

    case, plain = filtered_chain.record(effect, 1, n=300), filtered_chain.record("", 1, n=300)
    assert case.truth in effect_names()
    assert rms(case.frame["y"] - plain.frame["y"]) > 0.05 * rms(plain.frame["y"])


def judged(monkeypatch: pytest.MonkeyPatch, case: str, verdict: str, *found: str) -> dict[str, object]:
    """The row of a case of which a finder says this."""
    effects = [SimpleNamespace(name=n, aliases=[]) for n in found]
    diagnosis = SimpleNamespace(verdict=verdict, effects=effects, closure=0.9)
    finder = SimpleNamespace(fit=lambda *_, **__: SimpleNamespace(diagnosis_=diagnosis))
    monkeypatch.setattr(judge, "GapFinder", lambda *_, **__: finder)
    return judge.diagnose(case, 0)


@pytest.mark.parametrize(
    ("case", "verdict", "found", "right", "wrong"),
    [
        ("wrist", "named", ["gravity_imbalance"], True, False),
        ("wrist", "partial", ["gravity_imbalance"], True, False),
        ("wrist", "unknown", [], False, False),
        ("wrist", "named", ["gravity_imbalance", "disturbance_tone"], False, True),
        ("wrist", "partial", ["saturation"], False, False),
        ("free_swing_early", "named", ["gravity_imbalance", "input_delay"], True, False),
        ("free_swing_early", "named", ["input_delay", "gravity_imbalance"], False, False),
        ("small_travel", "no_gap", [], True, False),
        ("small_travel", "named", ["cogging"], False, True),
        ("square_beat", "unknown", [], True, False),
        ("square_beat", "partial", ["cogging"], False, False),
    ],
)
def test_what_counts_as_right(
    monkeypatch: pytest.MonkeyPatch, case: str, verdict: str, found: list[str], right: bool, wrong: bool
) -> None:
    row = judged(monkeypatch, case, verdict, *found)
    assert (row["right"], row["wrong"]) == (right, wrong)


def test_a_share_of_the_suites_is_spread_over_all_and_moves_with_the_seed() -> None:
    every = names.plan(list(names.SUITES), 41_000, 1, 1.0)
    some, others = (names.plan(list(names.SUITES), seed, 1, 0.2) for seed in (41_000, 41_001))
    assert len(every) / 6 < len(some) < len(every) / 4
    assert {t.suite for t in some} == {t.suite for t in every}
    assert {(t.suite, t.case) for t in some} != {(t.suite, t.case) for t in others}


def test_a_crash_is_a_row() -> None:
    def crash(_: names.Task) -> dict[str, object]:
        raise IndexError("no orders")

    row = names.judged(names.Task("servo", "cogging 0.05", 3, crash))
    assert (row["verdict"], row["error"], row["right"]) == ("crash", "IndexError: no orders", False)
    assert "1" in names.table([row]).splitlines()[-1]


def empty(kind: str = "chain", names: str = "", p_of_names: str = "", smallest_p: object = "") -> dict[str, object]:
    """A row of the calibration."""
    return {"kind": kind, "seed": 0, "verdict": "no_gap", "names": names, "p_of_names": p_of_names, "error": "",
            "smallest_p": smallest_p, "alpha": "", "seconds": 1.0}  # fmt: skip


@pytest.mark.parametrize(
    ("names", "p", "at_5", "at_1"),
    [("", "", False, False), ("cogging", "", True, True), ("cogging", "0.03", True, False),
     ("cogging", "0.002", True, True), ("cogging+stribeck", "0.04+0.001", True, True)],
)  # fmt: skip
def test_a_name_is_false_at_the_levels_that_its_p_value_reaches(names: str, p: str, at_5: bool, at_1: bool) -> None:
    row = empty(names=names, p_of_names=p)
    assert (calibration.false_name(row, 0.05), calibration.false_name(row, 0.01)) == (at_5, at_1)


def test_exact_bounds_of_none_in_many_are_the_rule_of_three_and_a_bit() -> None:
    low, high = calibration.exact(0, 300)
    assert low == 0.0
    assert high == pytest.approx(1.0 - 0.025 ** (1 / 300))  # Clopper and Pearson at k = 0


def test_a_remainder_has_noise_and_a_foreign_effect_that_are_below_the_tolerance_together() -> None:
    from benchmarks.blind_logs import servo

    size = calibration.REMAINDER[1]
    assert 2 * size**2 < 0.004**2
    case = servo.make_case("coloured", 3, effects=("bend",), size=size, noise=0.0, seconds=5.0, rate=500.0)
    assert {"x_bend", "x_bend_at", "x_bend_width", "noise_seconds"} == set(case.parameters)
    n, y, u = case.parameters, case.frame["position_rad"], case.frame["torque_nm"]
    bend = n["x_bend"] * np.tanh((y - n["x_bend_at"]) / n["x_bend_width"])
    assert 0.5 * size < rms(bend) / rms(u) < 2.0 * size


def test_the_figure_needs_p_values_and_is_written_with_them(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    path = tmp_path / "qq.png"
    with pytest.raises(ValueError, match="No record has a p-value"):
        calibration.draw([empty()], [0.05], str(path))
    p = np.random.default_rng(0).uniform(size=40)
    calibration.draw([empty(kind, smallest_p=x) for kind, x in zip("ab" * 20, p, strict=True)], [0.05], str(path))
    assert path.stat().st_size > 10_000


def test_numbers_with_a_name_are_counted_once_a_name(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text(
        "A = 3\nB, C = 0.1, 'no'\nD = {'x': (1, 2)}\nE = None\nF: float = -2 * A\nG = make(4)\nH = True\n"
        "class K:\n    low = 0.5\n    high: float\n    nothing: float = 0.0\n"
        "def f(x, tol=1e-3, n=1, *, beta=0.3):\n    y = 5\n    return y\n",
        encoding="utf-8",
    )
    assert house.named_numbers(tmp_path) == (5, 1, 1, 2)


@pytest.mark.parametrize(("n", "joint"), [(3, 1), (3, 2), (6, 4), (6, 5)])
def test_a_stop_of_a_drawn_arm_is_as_stiff_as_is_said(n: int, joint: int) -> None:
    mujoco = pytest.importorskip("mujoco")
    from benchmarks import blind_arms

    rng = np.random.default_rng(0)
    root = blind_arms.drawn(rng, n)
    mass, torque, reach, beyond = blind_arms.made(root)[2], 7.0, 0.6, np.array([0.1, 0.2])
    scale = {"torque": np.full(n, torque), "reach": np.full(n, reach), "speed": np.ones(n), "inertia": np.diag(mass),
             "gives": np.diag(np.linalg.inv(mass)), "path": blind_arms.reference(rng, n)}  # fmt: skip
    blind_arms.hide(root, "limit", joint, rng, scale)
    model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))
    data, pushed = mujoco.MjData(model), []
    for x in beyond:
        data.qpos[joint] = model.jnt_range[joint, 1] + x
        mujoco.mj_forward(model, data)
        pushed.append(float(data.efc_force[data.efc_type == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT].item()))
    # the inertias change a little with the position
    assert np.diff(pushed) / np.diff(beyond) == pytest.approx(20.0 * torque / reach, rel=0.1)
