"""The store of runs: its address, its place, and servers that do not answer."""

from __future__ import annotations

import socket
import sys
import time

import pytest

from whsklearn import tracking
from whsklearn.tracking import TrackingError, open_tracker, store


def test_default_store_keeps_all_beneath_mlruns(migrated_database, tmp_path, monkeypatch):
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    monkeypatch.setattr(store, "initialise", lambda path: path.write_bytes(migrated_database.read_bytes()))
    (tmp_path / "mlruns").mkdir()
    tracker = open_tracker("here", root=tmp_path)
    with tracker.run("one") as run:
        run.log_text("hello", "note.txt")
    assert len(list((tmp_path / "mlruns" / "artifacts").rglob("note.txt"))) == 1
    assert tracking.latest_experiment(tmp_path) == tracker.experiment_id


def test_server_that_is_down_is_told_at_once(monkeypatch):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"http://me:secret@127.0.0.1:{port}")
    start = time.monotonic()
    with pytest.raises(TrackingError, match=r"does not answer .* --no-track") as caught:
        open_tracker("x")
    assert time.monotonic() - start < 30  # MLflow's own retries take minutes
    assert "secret" not in str(caught.value)
    assert "\n" not in str(caught.value)


def test_refused_store_is_told_in_one_sentence(monkeypatch, tmp_path):
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{tmp_path / 'broken.db'}")
    (tmp_path / "broken.db").write_text("this is no database, whatever its name says" * 50)
    with pytest.raises(TrackingError, match="cannot be opened") as caught:
        open_tracker("x")
    assert "\n" not in str(caught.value)


def test_missing_mlflow_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "mlflow", None)
    with pytest.raises(ImportError, match=r"whsklearn\[mlflow\]"):
        open_tracker("x")


@pytest.mark.parametrize(
    ("said", "calls"),
    [
        ("(sqlite3.IntegrityError) UNIQUE constraint failed: datasets.name", 2),
        ('duplicate key value violates unique constraint "datasets_pk"', 2),
        ("(1062, \"Duplicate entry 'a' for key 'PRIMARY'\")", 2),
        ("database is locked", 1),
    ],
)
def test_what_another_process_wrote_meanwhile_is_found_at_a_second_try(said, calls):
    """And nothing else is tried again: a locked database makes every try wait."""

    class Client:
        tracking_uri = "sqlite:///a.db"
        called = 0

        def log_inputs(self):
            self.called += 1
            if self.called == 1:
                raise ValueError(said)
            return "there"

    client = Client()
    if calls == 2:
        assert store.InSentences(client).log_inputs() == "there"
    else:
        with pytest.raises(store.TrackingError, match="locked"):
            store.InSentences(client).log_inputs()
    assert client.called == calls
