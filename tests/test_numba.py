"""A change in a file that a kernel inlines is seen by the next process, without cleaning anything by hand."""

from __future__ import annotations

import ctypes
import gc
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from numba.core import event
from numba.core.runtime import _nrt_python, rtsys
from numba.extending import intrinsic

import whsklearn
from whsklearn import RMILSRegressor, WienerHammersteinLags, _numba
from whsklearn._numba import fingerprint, imported, part
from whsklearn.systems.stability import is_stable

PACKAGE = Path(whsklearn.__file__).parent
SCRIPT = """
import numpy as np
from whsklearn.effects.codes import VISCOUS
from whsklearn.effects import rows
value = rows.law_values(np.array([VISCOUS]), np.zeros((1, 3)), np.zeros(1), np.ones(1), np.inf)[0, 0]
print(value, sum(rows._law_values.stats.cache_hits.values()))
"""


def run(folder, home):
    """What the kernel gives in a process of its own, and whether it came from the user's cache."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("NUMBA_", "PYTHONPATH"))}
    environment["XDG_CACHE_HOME"] = str(home)
    out = subprocess.run(
        [sys.executable, "-c", SCRIPT], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    value, hits = out.stdout.split()
    return float(value), int(hits)


def copied(to):
    shutil.copytree(PACKAGE, to / "whsklearn", ignore=shutil.ignore_patterns("__pycache__"))
    return to


@pytest.mark.slow
def test_an_edited_equation_is_run_and_an_unchanged_one_comes_from_the_cache(tmp_path):
    here, home = copied(tmp_path / "here"), tmp_path / "home"
    assert run(here, home) == (1.0, 0)
    assert run(here, home) == (1.0, 1)
    assert run(copied(tmp_path / "another environment"), home) == (1.0, 1)
    equations = here / "whsklearn" / "effects" / "equations.py"
    before, after = "return dx, 0.0, 1.0", "return 3.0 * dx, 0.0, 3.0"
    assert equations.read_text().count(before) == 1
    equations.write_text(equations.read_text().replace(before, after))
    assert run(here, home) == (3.0, 0)


def test_kernels_that_nobody_declared_for_long_make_room(tmp_path, monkeypatch):
    monkeypatch.setattr(_numba._settings, "CACHE_DIR", str(tmp_path))
    (base,) = list(_numba._bases())[:1]
    for name in ("old", "young"):
        (base / name).mkdir(parents=True)
    os.utime(base / "old", (0, 0))
    _numba.njit(_quartered)(8.0)
    assert (base / "young").is_dir()
    assert not (base / "old").exists()
    assert len(list(base.iterdir())) == 2


def test_imports_are_found_however_they_are_written():
    lines = ("from whsklearn.effects import codes, Effect", "from whsklearn.effects.rows import (", "    term,  # a",
             "    tanh as t,", ")", "import numpy", "import whsklearn.effects.law", "")  # fmt: skip
    names = [f.name for f in imported("\n".join(lines))]
    assert names == ["codes.py", "rows.py", "law.py"]


def test_a_kernel_depends_on_what_it_inlines_two_files_down():
    assert "equations.py" in {f.name for f in imported((PACKAGE / "effects" / "rows.py").read_text())}
    assert fingerprint(PACKAGE / "effects" / "rows.py") != fingerprint(PACKAGE / "systems" / "stability.py")


def test_the_users_own_setting_is_left_as_it_was():
    assert "kernels-numba" not in str(numba.config.CACHE_DIR)
    assert not getattr(numba.config, "CACHE_LOCATOR_CLASSES", "")


@pytest.mark.slow
def test_a_first_run_says_once_that_it_compiles_and_no_model_is_charged_for_it(tmp_path):
    """In a process of its own, with nothing in the cache."""
    code = (
        "import numpy as np, time, whsklearn as w\n"
        "from whsklearn._numba import compiling_seconds\n"
        "rng = np.random.default_rng(0); u = rng.normal(size=(200, 1))\n"
        "began = time.process_time()\n"
        "w.RLSRegressor(w.WienerHammersteinLags(), n_starts=1, memory=0).fit(u, 0.5 * u[:, 0] + 0.1)\n"
        "print(compiling_seconds(), time.process_time() - began)"
    )
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONWARNINGS": "ignore"}
    run = [sys.executable, "-c", code]
    first, second = (subprocess.run(run, env=environment, capture_output=True, text=True, check=True) for _ in range(2))
    assert first.stderr.count("compiling once") == 1
    assert "compiling" not in second.stderr
    (compiled, whole), (later, _) = (tuple(map(float, r.stdout.split())) for r in (first, second))
    assert 1.0 < compiled < whole
    assert later == 0.0


def test_an_odd_kernel_of_a_tenth_of_a_second_is_not_worth_a_word(caplog):
    def compiled(seconds):
        listener = _numba._Compiling()
        listener.on_start(None)
        listener._began -= seconds
        listener.on_end(SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=fingerprint)}))
        return listener.seconds, len(caplog.records)

    seconds, told = compiled(0.1)
    assert (round(seconds, 1), told) == (0.1, 0)
    assert compiled(10.0)[1] == 1


@part
def _halved(x):
    """A part of a kernel, which allocates."""
    room = np.zeros(2)
    room[1] = 0.5 * x
    return room


def _quartered(x):
    return _halved(_halved(x)[1])[1]


def test_a_part_is_compiled_within_its_kernel_alone_and_answers_python_too(tmp_path, monkeypatch):
    monkeypatch.setattr(_numba._settings, "CACHE_DIR", str(tmp_path))
    assert _numba.njit(_quartered)(8.0) == 2.0
    assert len(_halved._linked.overloads) == 1
    assert "_alone" not in vars(_halved)  # no machine code was made of it so far
    assert _halved(8.0)[1] == 4.0
    assert pickle.loads(pickle.dumps(is_stable)) is is_stable


def test_kernels_are_kept_once_one_has_been_called(tmp_path, monkeypatch):
    monkeypatch.setattr(_numba._settings, "CACHE_DIR", str(tmp_path))
    kernel = _numba.njit(_quartered)
    assert not _numba.is_kept(Path(__file__))
    kernel(8.0)
    assert _numba.is_kept(Path(__file__))
    monkeypatch.setattr(_numba, "_folder", lambda _: None)
    assert _numba.is_kept(Path(__file__)), "where nothing can be kept, nothing is compiled ahead"


@part
def _larger(x):
    return max(x[0], x[1])


def _twice_the_larger(x):
    return _larger(x) + max(x[0], x[1])


def test_an_operation_is_compiled_once_for_kernels_and_parts_alike(tmp_path, monkeypatch):
    """Numba keeps its implementation by the flags of who asks; what Python calls and what kernels call differ there."""
    monkeypatch.setattr(_numba._settings, "CACHE_DIR", str(tmp_path))
    made = []

    class Watch(event.Listener):
        def on_start(self, e):
            made.append(e.data["dispatcher"].py_func.__module__)

        def on_end(self, _):
            pass

    with event.install_listener("numba:compile", Watch()):
        assert _numba.njit(_twice_the_larger, error_model="numpy")(np.array([1, 3], dtype=np.float32)) == 6.0
    assert made.count(__name__) == 2
    assert len(made) == 3, made


@part
def _scaled(x, i):
    return x * (i + 1)


def _scaled_twice(x, i):
    return _scaled(x, 0) + _scaled(x, i)


def test_a_part_is_compiled_once_for_a_literal_and_a_variable(tmp_path, monkeypatch):
    monkeypatch.setattr(_numba._settings, "CACHE_DIR", str(tmp_path))
    assert _numba.njit(_scaled_twice)(2.0, 3) == 10.0
    assert len(_scaled._linked.overloads) == 1


def test_loops_of_a_short_kernel_are_left_as_written(tmp_path, monkeypatch):
    monkeypatch.setattr(_numba._settings, "CACHE_DIR", str(tmp_path))

    @_numba.njit(error_model="numpy")
    def long(x):
        for i in range(x.size):
            x[i] *= 3.0

    @_numba.njit(error_model="numpy", short=True)
    def short(x):
        for i in range(x.size):
            x[i] *= 3.0

    x, y = np.linspace(0.0, 1.0, 77), np.linspace(0.0, 1.0, 77)
    long(x)
    short(y)
    assert x.tobytes() == y.tobytes()
    several = [" x double>" in code for kernel in (long, short) for code in kernel.inspect_llvm().values()]
    assert several == [True, False]


@intrinsic
def _owner(_context, array):
    """Address of what counts an array's references."""

    def made(context, builder, _signature, arguments):
        struct = context.make_array(array)(context, builder, value=arguments[0])
        return builder.ptrtoint(struct.meminfo, context.get_value_type(numba.types.intp))

    return numba.types.intp(array), made


@_numba.njit(cache=False, error_model="numpy", counted=False)
def _ends(x):
    return x[:1], x[1:]


def _sum_of_ends(x):
    first, rest = _ends(x)
    return first[0] + rest[0]


def test_what_counts_no_references_may_not_return_an_array(tmp_path, monkeypatch):
    """Its caller would give back a reference that nobody took."""
    monkeypatch.setattr(_numba._settings, "CACHE_DIR", str(tmp_path))
    with pytest.raises(Exception, match="_ends counts no references, but returns an array"):
        _numba.njit(error_model="numpy")(_sum_of_ends)(np.arange(3.0))
    assert _numba.njit(error_model="numpy")(_sum_of_views)(np.arange(3.0)) == 1.0


@_numba.view
def _views(x):
    return x[:1], x[1:]


def _sum_of_views(x):
    first, rest = _views(x)
    return first[0] + rest[0]


@pytest.mark.parametrize("orders", [(2, 2, 2, 2), (1, 3, 2, 1)])
def test_a_stream_gives_back_all_memory_that_its_kernels_take(orders):
    X = np.random.default_rng(0).normal(size=(400, 1))
    model = RMILSRegressor(WienerHammersteinLags(*orders), random_state=0).partial_fit(X, X[:, 0])
    _nrt_python.memsys_enable_stats()
    try:
        before = rtsys.get_allocation_stats()
        for row in X:
            model.partial_fit(row[None].copy(), row.copy())
        after = rtsys.get_allocation_stats()
    finally:
        _nrt_python.memsys_disable_stats()
    assert after.alloc > before.alloc
    assert after.alloc - before.alloc == after.free - before.free


def test_a_borrowed_array_is_the_array_and_nobody_counts_its_references(tmp_path, monkeypatch):
    monkeypatch.setattr(_numba._settings, "CACHE_DIR", str(tmp_path))

    @_numba.njit(error_model="numpy")
    def doubled(x):
        view = _numba.borrowed(x)
        for i in range(view.size):
            view[i] *= 2.0
        return _owner(x), _owner(view)

    x = np.arange(12.0).reshape(3, 4)
    references = sys.getrefcount(x)
    owned, borrowed = doubled(x[:, 1])
    assert x[:, 1].tolist() == [2.0, 10.0, 18.0]  # strides and memory are the array's own
    assert x[:, 0].tolist() == [0.0, 4.0, 8.0]
    assert owned != 0
    assert borrowed == 0
    assert sys.getrefcount(x) == references


def test_a_piece_is_a_view_of_the_elements_asked_for():
    array = np.arange(24.0)
    for shape in ((6,), (2, 3), (0, 3)):
        expected = _numba._piece(array, 5, shape)
        kernel = numba.njit(lambda array, shape: _numba.piece(array, 5, shape))
        for whole in (array, array.reshape(4, 6)):
            found = kernel(whole, shape)
            assert np.shares_memory(found, array) or not expected.size
            np.testing.assert_array_equal(found, expected)
        del whole
    made = numba.njit(lambda n: _numba.piece(np.arange(n), 1, (3,)))(10_000)  # its owner lives on
    np.testing.assert_array_equal(made, [1, 2, 3])


def test_where_numba_is_another_parts_are_compiled_in_its_own_way(monkeypatch):
    monkeypatch.setattr(_numba, "LINKED", None)
    half = part(_halved.py_func)
    assert not isinstance(half, _numba.KernelPart)
    assert half(8.0)[1] == 4.0


def test_the_collection_of_garbage_is_as_it_was_after_a_kernel_is_compiled(tmp_path, monkeypatch):
    monkeypatch.setattr(_numba._settings, "CACHE_DIR", str(tmp_path))
    before = gc.get_threshold()
    seen = []

    class Watch(event.Listener):
        def on_start(self, _):
            seen.append(gc.get_threshold())

        def on_end(self, _):
            pass

    with event.install_listener("numba:compile", Watch()):
        part(lambda x: x + 1)(1)
    assert gc.get_threshold() == before
    assert before not in seen
    assert seen


def without_rights():
    """In a child: permissions hold for root too, as for the user of a container."""
    if os.getuid() == 0:
        libc = ctypes.CDLL(None)
        for right in (1, 2):  # CAP_DAC_OVERRIDE and CAP_DAC_READ_SEARCH leave the bounding set
            libc.prctl(24, right, 0, 0, 0)


@pytest.fixture
def read_only_package(tmp_path):
    """A copy of the package where nothing can be written, nor in the home."""
    for name in ("site", "home", "temporary"):
        (tmp_path / name).mkdir()
    shutil.copytree(PACKAGE, tmp_path / "site" / "whsklearn", ignore=shutil.ignore_patterns("__pycache__"))
    folders = [tmp_path / "home", tmp_path / "site", *(d for d in (tmp_path / "site").rglob("*") if d.is_dir())]
    for folder in folders:
        folder.chmod(0o555)
    yield tmp_path
    for folder in folders:
        folder.chmod(0o755)


def run_read_only(at, **more):
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("NUMBA_", "PYTHONPATH", "XDG_"))}
    environment |= {"HOME": str(at / "home"), "TMPDIR": str(at / "temporary")} | more
    probe = subprocess.run(
        [sys.executable, "-c", f"open({str(at / 'home' / 'x')!r}, 'w')"], preexec_fn=without_rights, capture_output=True
    )
    if probe.returncode == 0:
        pytest.skip("permissions do not hold for this user, and it may not give up its rights")
    return subprocess.run(
        [sys.executable, "-c", SCRIPT], cwd=at / "site", env=environment, preexec_fn=without_rights,
        capture_output=True, text=True,
    )  # fmt: skip


@pytest.mark.slow
def test_where_package_and_home_are_read_only_the_temporary_folder_keeps_the_kernels(read_only_package):
    first = run_read_only(read_only_package)
    assert first.returncode == 0, first.stderr
    assert first.stdout.split() == ["1.0", "0"]
    (own,) = (read_only_package / "temporary").iterdir()
    assert own.stat().st_mode & 0o777 == 0o700  # what is in a cache is run
    assert run_read_only(read_only_package).stdout.split() == ["1.0", "1"]


def test_where_nothing_can_be_written_kernels_are_compiled_and_not_kept(read_only_package, tmp_path):
    elsewhere = str(tmp_path / "home")
    own = tmp_path / "temporary" / f"whsklearn-{os.getuid()}"
    own.mkdir()
    own.chmod(0o777)  # anybody could have put code there
    done = run_read_only(read_only_package, NUMBA_CACHE_DIR=elsewhere)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["1.0", "0"]
    assert list(own.iterdir()) == []
