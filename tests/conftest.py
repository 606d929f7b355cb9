"""Fixtures that more than one test module uses."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings
from threadpoolctl import threadpool_limits

# The first example compiles for seconds, so a time for each would fail by chance; pytest-timeout ends what hangs.
settings.register_profile("whsklearn", deadline=None)
settings.load_profile("whsklearn")

os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")  # mlflow reads it at import
os.environ.setdefault("MPLBACKEND", "Agg")

ROOT = Path(__file__).resolve().parents[1]

# Dozens of tests start a process, and uv installs no bytecode.  Where the environment forbids writing any, each process
# compiled MLflow and Numba anew: 1.2 of the 2.7 s of CPU of `import whsklearn.cli, mlflow`, 16 of 44 s of one test.
# There it has a place of its own; elsewhere what an earlier command compiled is used, which is 28 s of CPU a worker.
if os.environ.pop("PYTHONDONTWRITEBYTECODE", None):
    os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix = str(ROOT / ".pytest_cache" / "bytecode")
    sys.dont_write_bytecode = False


@pytest.fixture(scope="session", autouse=True)
def one_thread_a_worker() -> Iterator[None]:
    """As many workers as cores: further threads of BLAS would only wait for each other."""
    import scipy.linalg  # noqa: F401  (it has a BLAS of its own)

    with threadpool_limits(1, user_api="blas"):
        yield


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of measured records, or a skip that says how to name one."""
    folder = Path(os.environ.get("WHSKLEARN_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip("no measured records here; set WHSKLEARN_DATA to a folder that holds emps/ and kr300/")
    return folder


@pytest.fixture(scope="session")
def migrated_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty MLflow database; migrating one takes seconds, copying it none."""
    pytest.importorskip("mlflow", reason="needs the extra mlflow")
    from whsklearn.tracking import store

    database = tmp_path_factory.mktemp("mlflow") / "mlflow.db"
    with store.quiet():
        store.initialise(database)
    return database


@pytest.fixture
def mlflow_root(migrated_database: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with an empty ``mlruns/`` store of its own, which every pipeline run in the test writes to."""
    (tmp_path / "mlruns").mkdir()
    database = shutil.copy(migrated_database, tmp_path / "mlruns" / "mlflow.db")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{database}")
    monkeypatch.delenv("MLFLOW_EXPERIMENT_ID", raising=False)
    import mlflow

    mlflow.set_tracking_uri(None)
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{database}")
    yield tmp_path

    while mlflow.active_run():
        mlflow.end_run()
    mlflow.set_tracking_uri(None)


@pytest.fixture
def library_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    """The catalogue without the effects that other tests have defined: a twin of cogging makes its name doubtful."""
    from whsklearn.effects import base as registry

    own = {k: v for k, v in registry._REGISTRY.items() if v.__module__.startswith("whsklearn.")}
    monkeypatch.setattr(registry, "_REGISTRY", own)
