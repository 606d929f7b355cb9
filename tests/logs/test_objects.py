"""JSON in its three shapes gives the same columns."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.logs.rig import TABLE, same
from whsklearn.logs import LogError, load_log
from whsklearn.logs.objects import open_json

ROWS = [dict(zip(TABLE, row, strict=True)) for row in zip(*(v.tolist() for v in TABLE.values()), strict=True)]
NESTED = [{"t": r["time_s"], "joint": {"effort": r["torque_nm"], "state": [0.0, r["position_rad"]]}} for r in ROWS]


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("\n".join(map(json.dumps, ROWS)), ("time_s", "torque_nm", "position_rad")),
        (json.dumps(ROWS), ("time_s", "torque_nm", "position_rad")),
        (json.dumps({"run": {k: v.tolist() for k, v in TABLE.items()}}), tuple(f"run.{k}" for k in TABLE)),
        (json.dumps({k: dict(enumerate(v.tolist(), 7)) for k, v in TABLE.items()}), tuple(TABLE)),  # pandas' to_json()
        (json.dumps({"data": [list(r.values()) for r in ROWS]}), ("data.0", "data.1", "data.2")),
        (
            json.dumps({"columns": list(TABLE), "index": [], "data": [list(r.values()) for r in ROWS]}),
            ("time_s", "torque_nm", "position_rad"),
        ),
        ("\ufeff" + json.dumps(NESTED), ("t", "joint.effort", "joint.state.1")),
    ],
    ids=["lines", "records", "vectors", "by row", "matrix", "as pandas splits it", "nested"],
)
def test_every_shape_gives_the_same_log(tmp_path, text, names):
    (tmp_path / "axis.json").write_text(text, encoding="utf-8")
    same(load_log(tmp_path / "axis.json", **dict(zip(("time", "drive", "position"), names, strict=True))))


def test_null_is_a_missing_number_and_a_cut_last_line_is_left_out(tmp_path):
    lines = [json.dumps({"a": i, "b": None if i == 2 else 0.5 * i}) for i in range(5)]
    (tmp_path / "log.json").write_text("\n".join([*lines, '{"a": 5, "b']))
    source = open_json(tmp_path / "log.json")
    column = source.fetch(["b"])["b"].values
    np.testing.assert_array_equal(column, [0.0, 0.5, np.nan, 1.5, 2.0])
    assert source.notes == ["The last line is incomplete and was left out."]


def test_a_broken_line_and_a_file_without_vectors_are_one_sentence(tmp_path):
    (tmp_path / "log.json").write_text('{"a": 1}\n{"a": oops}\n{"a": 3}\n{"a": 4}')
    with pytest.raises(LogError, match=r"line 2 is '\{\"a\": oops\}'"):
        open_json(tmp_path / "log.json")
    (tmp_path / "log.json").write_text('{"rate": 100, "vectors": [1, 2]}')
    with pytest.raises(LogError, match="has no vectors of at least 3 numbers"):
        open_json(tmp_path / "log.json")


@pytest.mark.parametrize("depth", [900, 100_000])
def test_what_is_nested_without_end_is_no_log(tmp_path, depth):
    """The one within what Python's parser takes, the other beyond it."""
    (tmp_path / "log.json").write_text('{"a":' * depth + "1" + "}" * depth)
    with pytest.raises(LogError, match=r"nested too deeply|no vectors"):
        load_log(tmp_path / "log.json", drive="a", position="b")


@pytest.mark.parametrize("nested", [False, True])
def test_units_beside_the_vectors_are_theirs(tmp_path, nested):
    vectors = {"time": [0.0, 2.0, 4.0, 6.0], "torque": [1.0, 2.0, 1.0, 2.0], "position": [0.0, 1.0, 2.0, 4.0]}
    units = {"time": "ms", "torque": "mNm", "position": "deg", "note": 3}
    content = {"units": units, "data": vectors} if nested else {"units": units, **vectors}
    (tmp_path / "a.json").write_text(json.dumps(content), encoding="utf-8")
    log = load_log(tmp_path / "a.json")
    assert log.units == {"time": "s", "drive": "mNm", "position": "deg"}
    assert log.sample_rate == pytest.approx(500.0)
