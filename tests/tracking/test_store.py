"""The store of runs: its address, its place, and servers that do not answer."""

from __future__ import annotations

import json
import socket
import sys
import threading
import time
from types import SimpleNamespace

import pytest

from whsklearn import tracking
from whsklearn.tracking import TrackingError, open_tracker, store
from whsklearn.tracking.store import VIEW, view_of


def test_default_store_keeps_all_beneath_mlruns(migrated_database, tmp_path, monkeypatch):
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    monkeypatch.setattr(
        store, "initialise", lambda path: path.exists() or path.write_bytes(migrated_database.read_bytes())
    )
    (tmp_path / "mlruns").mkdir()
    tracker = open_tracker("here", root=tmp_path)
    with tracker.run("one") as run:
        run.log_text("hello", "note.txt")
    assert len(list((tmp_path / "mlruns" / "artifacts").rglob("note.txt"))) == 1
    assert tracking.experiments(tmp_path) == [("here", tracker.experiment_id)]


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


def test_a_folder_that_takes_no_store_names_the_way_out(monkeypatch, tmp_path):
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    (tmp_path / "mlruns").write_text("a file, where the folder of the store would be")
    with pytest.raises(TrackingError, match=r"MLFLOW_TRACKING_URI to keep it elsewhere, or .* --no-track"):
        open_tracker("x", root=tmp_path)


def test_a_file_that_sqlite_cannot_open_is_told_at_once(monkeypatch, tmp_path):
    """MLflow itself would try for minutes; the second name leaves no room for that of the file in the making."""
    (tmp_path / "folder.db").mkdir()
    for name in ("folder.db", "m" * 253):
        monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{tmp_path / name}")
        monkeypatch.setattr(store, "import_mlflow", lambda: SimpleNamespace(MlflowClient=pytest.fail))
        with pytest.raises(TrackingError, match=r"cannot be opened \(unable to open database file\)"):
            open_tracker("x")
    assert [f.name for f in tmp_path.iterdir()] == ["folder.db"]


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


def test_patience_ends_with_a_server_that_does_not_answer(monkeypatch):
    monkeypatch.setattr(store, "PATIENCE_SECONDS", 0.3)
    monkeypatch.setattr(store, "FAIR_SECONDS", 0.0)
    patience = store.Patience("http://127.0.0.1:1")
    held = threading.Event()
    assert patience.wait(lambda: "an answer") == "an answer"
    with pytest.raises(ZeroDivisionError):
        patience.wait(lambda: 1 / 0)
    with pytest.raises(TimeoutError, match="no answer within"):
        patience.wait(held.wait)
    calls = []
    with pytest.raises(TimeoutError):  # and nothing is tried again
        patience.wait(lambda: calls.append(1))
    held.set()
    assert calls == []


def test_a_server_that_is_always_slow_uses_up_patience_and_one_that_is_slow_now_and_then_does_not(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(store, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.delenv("MLFLOW_HTTP_REQUEST_TIMEOUT", raising=False)

    def late():
        now[0] += 1.0  # half a second more than is fair

    often, seldom = store.Patience("http://a"), store.Patience("http://a")
    for _ in range(12):
        often.wait(late)
    assert often.left == pytest.approx(0.0)
    for _ in range(100):
        now[0] += 60.0
        seldom.wait(late)
    assert seldom.left == pytest.approx(store.PATIENCE_SECONDS - 0.5)


def test_a_store_in_a_file_is_waited_for_as_long_as_it_takes(monkeypatch):
    monkeypatch.setattr(store, "PATIENCE_SECONDS", 0.0)
    monkeypatch.setattr(store, "FAIR_SECONDS", 0.0)
    assert store.Patience("sqlite:///a.db").wait(lambda: time.sleep(0.05) or "written") == "written"


def test_a_server_that_fell_silent_during_the_work_has_used_up_the_patience_at_its_end(monkeypatch):
    monkeypatch.setattr(store, "LISTEN_SECONDS", 0.01)
    monkeypatch.setattr(store, "PATIENCE_SECONDS", 0.05)
    monkeypatch.setattr(store, "FAIR_SECONDS", 0.0)
    down, held = threading.Event(), threading.Event()

    def probe(uri):
        if down.is_set():
            raise store.TrackingError("down")

    monkeypatch.setattr(store, "probe", probe)
    patience = store.Patience("http://127.0.0.1:1")
    patience.left = patience.most = 60.0  # nothing but silence ends it
    assert patience.opened(lambda: "open") == "open"
    down.set()
    while patience.silent < 0.05:
        time.sleep(0.01)
    patience.most = 0.05
    with pytest.raises(TimeoutError, match="no answer"):
        patience.wait(held.wait)
    held.set()


def test_a_server_that_is_well_again_is_waited_for(monkeypatch):
    monkeypatch.setattr(store, "LISTEN_SECONDS", 0.01)
    well = threading.Event()

    def probe(uri):
        if not well.is_set():
            raise store.TrackingError("down")

    monkeypatch.setattr(store, "probe", probe)
    patience = store.Patience("http://127.0.0.1:1")
    patience.listen()
    while not patience.silent:
        time.sleep(0.01)
    well.set()
    while patience.silent:
        time.sleep(0.01)
    assert patience.wait(lambda: "written") == "written"


def test_a_call_may_take_what_the_first_ones_took(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(store, "time", SimpleNamespace(monotonic=lambda: now[0], sleep=time.sleep))
    monkeypatch.setattr(store.Patience, "listen", lambda self: None)

    def late():
        now[0] += 2.0

    patience = store.Patience("http://a")
    patience.opened(late)
    for _ in range(100):
        patience.wait(late)
    assert patience.left == store.PATIENCE_SECONDS


def test_patience_is_mlflows_own_timeout_where_one_is_set(monkeypatch):
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_TIMEOUT", "30")
    assert store.Patience("https://far.example").most == 30.0


@pytest.mark.parametrize("experiment", ["close_gap", "compare", "tune", "identify", "fleet", "stream", "another"])
def test_columns_are_spelled_as_mlflow_reads_them(experiment):
    view = view_of(experiment)
    for column in (view["orderByKey"], *view["selectedColumns"]):
        kind, _, name = column.partition(".")
        assert kind in ("tags", "metrics", "params", "attributes")
        assert name.strip("`") == (name if kind == "attributes" else name[1:-1]) != ""


def test_every_experiment_has_its_columns_among_the_saved_views_of_mlflow(tracker):
    """Named views are in MLflow's menu from 3.15 on; what earlier versions read of the tag stands beside."""
    tags = tracker.client.get_experiment(tracker.experiment_id).tags
    view = json.loads(tags[f"mlflow.sharedViewState.{VIEW}"])
    assert isinstance(view["name"], str)
    assert isinstance(view["createdAt"], int)
    state = json.loads(view["state"])
    assert state == {k: view[k] for k in state} == view_of(tracker.experiment)
