"""The command line of the gap workflow: contract of the files, the sentence, clear errors."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner

from pipelines.close_gap import main
from tests.blind.servo import make_case


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    case = make_case("named", 12, effects=("gravity_imbalance",), size=0.08, seconds=12.0, rate=500.0)
    path = tmp_path_factory.mktemp("log") / "axis.csv"
    case.frame.to_csv(path, index=False)
    return path


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments])


def test_names_the_hidden_effect_and_writes_both_files(log, tmp_path):
    result = run(
        log, "--model", "servo", "--time", "time_s", "--reference", "reference_rad", "--drive", "torque_nm",
        "--position", "position_rad", "--report", tmp_path / "report", "--no-track",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    data = json.loads((tmp_path / "report" / "gap.json").read_text(encoding="utf-8"))
    assert (data["verdict"], data["effects"][0]["name"]) == ("named", "gravity_imbalance")
    assert "gravity imbalance" in result.output
    assert (tmp_path / "report" / "gap.html").stat().st_size > 10_000


def test_short_log_is_a_data_problem(log, tmp_path):
    short = tmp_path / "short.csv"
    short.write_text("\n".join(log.read_text().splitlines()[:100]), encoding="utf-8")
    result = run(short, "--report", tmp_path, "--no-track")
    assert result.exit_code == 0, result.output
    assert json.loads((tmp_path / "gap.json").read_text(encoding="utf-8"))["verdict"] == "data_problem"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--drive", "volts"], "no column 'volts'"),
        (["--law", "sticky"], "'sticky'"),
        (["--law", "cogging"], "cannot stand in the base law"),
    ],
)
def test_errors_are_one_sentence(log, tmp_path, arguments, message):
    result = run(log, *arguments, "--report", tmp_path / "r", "--no-track")
    assert result.exit_code == 1
    assert message in result.output
    assert "Traceback" not in result.output


def test_empty_file_is_told(tmp_path):
    path = tmp_path / "empty.csv"
    path.write_text("", encoding="utf-8")
    assert run(path, "--no-track", "--report", tmp_path / "r").exit_code == 1
