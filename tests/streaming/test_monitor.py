"""What a stream does with its rows: bad ones, refused ones, a change of friction."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.streaming.recorded_stream import QUICK, axis, carried, records, stream, write
from whsklearn import RigidBodyLags, RLSRegressor, RMILSRegressor, WienerHammersteinLags, WienerHammersteinSystem
from whsklearn.change import ChangeAlarm
from whsklearn.datasets import default_arm, make_arm_log
from whsklearn.effects import Coulomb, FrictionLaw, Viscous
from whsklearn.streaming import Options, Refused, StreamMonitor
from whsklearn.streaming.monitor import BLOCK, Innovations
from whsklearn.streaming.rows import CsvParser

RNG = np.random.default_rng(0)
X = RNG.normal(size=(3 * BLOCK, 2))
Y = X @ [1.0, -2.0] + 0.1 * RNG.normal(size=3 * BLOCK)


def taken(pieces, kept=None):
    """Innovations of the three blocks, learnt in these pieces; ``kept`` stops and goes on within the second."""
    model, out = RLSRegressor(), []
    watch = Innovations(model)
    for at in range(0, 3 * BLOCK, pieces):
        part = slice(at, at + pieces)
        model.partial_fit(X[part], Y[part])
        watch.learnt(np.column_stack([X[part], Y[part]]), np.zeros(pieces, dtype=np.int64))
        if (at + pieces) % BLOCK == 0:
            out.append(watch.of_block()[1])
        elif kept and at > BLOCK:
            state, learnt = watch.get_state(), model.get_state()
            model = RLSRegressor().set_state(learnt)
            watch = Innovations(model)
            watch.set_state(state)
    return out


def test_a_block_is_predicted_by_what_was_known_at_its_beginning():
    first, second, third = taken(BLOCK)
    assert np.isnan(first).all()
    for begin, e in ((BLOCK, second), (2 * BLOCK, third)):
        theta = RLSRegressor().partial_fit(X[:begin], Y[:begin]).theta_
        part = slice(begin, begin + BLOCK)
        np.testing.assert_allclose(e[:, 0], Y[part] - X[part] @ theta, atol=1e-9)


def test_pieces_and_stops_change_no_innovation():
    whole = taken(BLOCK)
    for other in (taken(20), taken(20, kept=True)):
        np.testing.assert_allclose(np.concatenate(other)[BLOCK:], np.concatenate(whole)[BLOCK:], atol=1e-12)


BAD = {3: "0.02,1.0\n", 5: "0.04,x,1.0\n", 8: "0.05,1,1\n", 9: "0.08,nan,1\n", 11: "0.10,1,1e999\n", 12: "\n"}


@pytest.mark.parametrize("hole", ["hold", "restart"])
def test_bad_rows_are_reported_with_their_lines_and_passed_over(tmp_path, rows, hole):
    spoilt = [BAD.get(i + 2, row) for i, row in enumerate(rows[:700])]
    log = write(tmp_path / "log.csv", spoilt)
    done = stream(log, "--out", tmp_path / "out.jsonl", "--hole", hole, *QUICK)
    assert done.exit_code == 0, done.output
    bad = records(tmp_path / "out.jsonl", "bad_row")
    assert [r["line"] for r in bad] == [3, 5, 8, 9, 11]
    assert bad[0]["reason"] == "2 fields, expected 3"
    assert "u is 'x'" in bad[1]["reason"]
    assert "does not come after" in bad[2]["reason"]
    for line in (3, 5, 8, 9, 11):
        assert f"line {line}:" in done.stderr
    assert carried(tmp_path / "log.csv.whs")["carried"]["rows"] == {"hold": 699, "restart": 694}[hole]


def test_a_refused_row_ends_the_stream_before_it_and_corrected_it_goes_on(tmp_path, undisturbed, rows):
    spoilt = list(rows)
    spoilt[1000] = "10.00,1.0,oops\n"
    log, args = write(tmp_path / "log.csv", spoilt), ["--bad-rows", "refuse", "--predictions", *QUICK]
    done = stream(log, "--out", tmp_path / "out.jsonl", *args)
    assert done.exit_code == 3
    assert "line 1002: y is 'oops', not a number" in done.stderr
    assert carried(tmp_path / "log.csv.whs")["carried"]["rows"] == 1000
    write(log, rows)
    assert stream(log, "--out", tmp_path / "out.jsonl", *args).exit_code == 0
    assert (tmp_path / "out.jsonl").read_bytes() == (undisturbed / "out.jsonl").read_bytes()


@pytest.mark.parametrize(("every", "row"), [(500, 1500), (1000, 2000), (10_000, None)])
def test_predictions_worse_than_the_mean_of_the_output_are_told_once(tmp_path, every, row):
    """An even characteristic, of which an odd law makes nothing: an NMSE of 1.5, at every estimate.

    A stream that ends before its first estimate says it at the end, and writes no record: continued, it would be
    another than an undisturbed one.
    """
    u = np.random.default_rng(0).normal(size=2500)
    log = tmp_path / "log.csv"
    log.write_text("u,y\n" + "".join(f"{a:.9g},{10 + 3 * abs(a):.9g}\n" for a in u))
    done = stream(log, "--no-track", "--estimator", "rls", "--every", every, "--out", tmp_path / "out.jsonl")
    assert done.exit_code == 0, done.output
    told = records(tmp_path / "out.jsonl", "alarm")
    assert [(r["cause"], r["row"]) for r in told] == ([("worse_than_mean", row)] if row else [])
    assert "NMSE 1." in done.stderr
    assert done.stderr.count("worse than the mean of the output") == 1


def test_predictions_of_a_sound_stream_are_not_called_worse(tmp_path, undisturbed, rows):
    assert not records(undisturbed / "out.jsonl", "alarm")
    done = stream(write(tmp_path / "log.csv", rows), "--no-track", *QUICK, "--every", "100000")  # judged at its end
    assert "worse than the mean" not in done.output + done.stderr


def test_a_rise_of_friction_raises_the_alarm_and_is_named(tmp_path):
    u, y = axis(12_000, 3)
    y[7000:] = axis(12_000, 3, coulomb=0.84)[1][7000:]
    y += 0.05 * np.random.default_rng(4).normal(size=y.size)
    log = tmp_path / "log.csv"
    log.write_text("u,y\n" + "".join(f"{a:.12g},{b:.12g}\n" for a, b in zip(u, y, strict=True)))
    done = stream(log, "--no-track", "--out", tmp_path / "out.jsonl")
    assert done.exit_code == 0, done.output
    (alarm,) = records(tmp_path / "out.jsonl", "alarm")
    assert 7000 < alarm["row"] < 7100
    (change,) = records(tmp_path / "out.jsonl", "change")
    assert change["alarm_row"] == alarm["row"]
    assert len(change["changes"]) == 1
    assert change["changes"][0].startswith("coulomb rose")
    assert f"row {alarm['row']}: alarm change: the errors are not what they were." in done.stderr
    assert f"row {change['row']}: change since row {change['since_row']}: {change['changes'][0]}." in done.stderr
    # the forgetting settles again, so the estimate is no noisier than one of the new regime alone
    assert records(tmp_path / "out.jsonl", "estimate")[-1]["parameters"]["coulomb"] == pytest.approx(0.84, abs=0.03)


def test_after_a_change_nothing_else_is_said_to_have_changed():
    """A pole near a zero: under forgetting, the signs in doubt still belong to its standard error."""
    rng = np.random.default_rng(1)
    u = rng.normal(size=(16_000, 1))
    laws = (FrictionLaw([Viscous(0.5), Coulomb(size)]) for size in (0.8, 0.96))
    blocks = [1, -0.116], [-0.33, 0.092], [1, -0.25], [-1.63, 0.66]
    y = [WienerHammersteinSystem(*blocks, law=law).simulate(u) for law in laws]
    noise = lfilter([1.0], [1.0, *blocks[3]], rng.normal(0, 0.014, size=len(u)))
    told = []
    lags = WienerHammersteinLags(law="viscous,coulomb")
    monitor = StreamMonitor(RMILSRegressor(lags, random_state=0), ChangeAlarm(), Options(), told.append)
    monitor.take(np.column_stack([u, np.r_[y[0][:6000], y[1][6000:]] + noise]))
    assert [r["kind"] for r in told if r["kind"] != "estimate"] == ["alarm", "change"]
    [said] = [r["changes"] for r in told if r["kind"] == "change"]
    assert [c.split()[0] for c in said] == ["coulomb"]
    last = told[-1]
    z = [(last["parameters"][k] - v) / last["standard_errors"][k] for k, v in (("a2", -0.116), ("b2", 0.092))]
    assert np.abs(z).max() < 3.0


@pytest.mark.parametrize("refuse", [False, True])
def test_rows_of_numbers_are_taken_as_lines_of_text_are(refuse):
    u, y = axis(700, 4)
    rows = np.column_stack([0.01 * np.arange(700), u, y])
    rows[333, 1] = np.nan
    seen = {}
    for way in ("take", "feed"):
        model, seen[way] = RLSRegressor(), []
        options = Options(every=100, predictions=True, refuse=refuse, timed=True)
        monitor = StreamMonitor(model, ChangeAlarm(), options, seen[way].append)
        for at in range(0, 700, 70):
            part = rows[at : at + 70]
            try:
                if way == "take":
                    monitor.take(part, at + 1)
                else:
                    lines = [",".join(map(repr, row)).encode() for row in part.tolist()]
                    monitor.feed(lines, CsvParser(b"t,u,y", ["t", "u", "y"]), at + 1)
            except Refused:
                assert refuse
                assert monitor.taken == 333 - at
                break
    told = [repr([{k: v for k, v in r.items() if k != "reason"} for r in seen[way]]) for way in seen]  # NaN too
    assert told[0] == told[1]
    assert any(r["kind"] == "bad_row" for r in seen["take"]) is not refuse


def test_what_is_no_row_of_numbers_as_long_as_the_others_is_a_bad_row():
    rows = np.column_stack([np.arange(300) / 100, X[:300], Y[:300]]).tolist()
    told = []
    monitor = StreamMonitor(RLSRegressor(), ChangeAlarm(), Options(timed=True), told.append)
    monitor.take([*rows[:100], rows[100][:3], None, ["x", 1, 2, 3], [*rows[103], 0.0], *rows[104:]])
    assert [r["reason"] for r in told if r["kind"] == "bad_row"] == [
        "3 values, expected 4",
        "a row of numbers was expected, got 'None'",
        "a row of numbers was expected, got \"['x', 1, 2, 3]\"",
        "5 values, expected 4",
    ]
    monitor.take([rows[0][:2]], 301)
    assert told[-1]["reason"] == "2 values, expected 4"
    assert monitor.model.n_features_in_ == 2
    monitor = StreamMonitor(RLSRegressor(), ChangeAlarm(), Options(timed=True), told.append)
    monitor.take([rows[0][:2]])  # a time and an output alone, before any row told the width
    assert told[-1]["reason"] == "2 values, expected 3"
    monitor.take([rows[0][:2], rows[1]])
    assert told[-1]["reason"] == "2 values, expected 4"


def test_a_first_row_that_the_model_rejects_is_a_bad_row():
    class Picky(RLSRegressor):
        def partial_fit(self, X, y, groups=None, sample_weight=None):
            if (X > 9.0).any():
                raise ValueError("too large")
            return super().partial_fit(X, y, groups, sample_weight)

    told = []
    monitor = StreamMonitor(Picky(), ChangeAlarm(), Options(every=100), told.append)
    monitor.take([[10.0, 1.0]])
    assert [r["kind"] for r in told] == ["bad_row"]


@pytest.mark.parametrize("restart", [False, True])
def test_what_stands_between_rows_whose_stamps_follow_each_other_replaces_no_sample(restart):
    rows = np.column_stack([np.arange(300) / 100, X[:300], Y[:300]]).tolist()
    learnt = []
    for given, missing in ((rows, 0), ([*rows[:90], None, *rows[90:200], None, *rows[200:]], 0),
                           ([*rows[:90], None, *rows[91:]], 1)):  # fmt: skip
        monitor = StreamMonitor(
            RLSRegressor(), ChangeAlarm(), Options(timed=True, restart_after_hole=restart), lambda record: None
        )
        monitor.take(given)
        assert monitor.carried.rows == 300 - (missing if restart else 0)
        assert monitor.carried.experiment == (missing if restart else 0)
        learnt.append(monitor.model.theta_)
    np.testing.assert_array_equal(learnt[0], learnt[1])


def test_a_change_at_one_joint_of_an_arm_is_an_alarm_there():
    arm = default_arm()
    parts = [make_arm_log(arm, changed, duration=16.0, sample_rate=250.0, random_state=k, return_arrays=True)
             for k, changed in enumerate(({}, {"pitch": [Coulomb(0.3)]}))]  # fmt: skip
    rows = [np.column_stack([np.arange(len(q)) / 250.0 + 20.0 * k, q, u])[200:] for k, (q, u) in enumerate(parts)]
    lags = RigidBodyLags.of_arm(arm, 250.0, causal=True)
    told = []
    options = Options(every=1000, timed=True, max_step=0.01, outputs=arm.joints, predictions=True)
    alarm = ChangeAlarm(interval=1e5, n_reference=400, n_settle=100)
    monitor = StreamMonitor(RLSRegressor(lags, P0=1.0), alarm, options, told.append)
    monitor.take(np.concatenate(rows))
    raised = [r for r in told if r["kind"] == "alarm"]
    assert [(r["cause"], r.get("joint")) for r in raised] == [("pause", None), ("change", "pitch")], raised
    assert 3800 < raised[1]["row"] < 4000
    last = [r for r in told if r["kind"] == "estimate"][-1]
    assert last["parameters"]["pitch.coulomb"] == pytest.approx(0.5, abs=0.04)
    assert last["parameters"]["yaw.coulomb"] == pytest.approx(0.3, abs=0.03)
    errors = [r["y"]["pitch"] - r["y_hat"]["pitch"] for r in told if r["kind"] == "prediction" and r["row"] > 7000]
    assert np.nanstd(errors) < 0.2 * np.std(rows[1][:, 4])  # encoder noise of the acceleration
