"""Numba's ``njit`` with a cache that also sees a change in the files that a kernel calls.

Numba keys its cache on the file of the function itself; what that function inlines from other files may
change without it, and yesterday's physics is run.  Here every module's kernels are cached in a folder named
by a fingerprint of that file and of all files of the package that it imports, directly or not, so a change
anywhere below gives another folder.  Nothing else names it: a rebuilt environment, an upgrade that leaves these
files as they are and a second checkout find what the first compiled, in the user's cache folder.  Only documented
means are used: the settings behind ``NUMBA_CACHE_DIR`` and ``NUMBA_CACHE_LOCATOR_CLASSES`` are set while a kernel is
declared and put back after.  A Numba that does not know the second one yet asks for the path of the file too, so
there a new environment compiles again.

How functions are compiled is Numba's own pipeline, less what is for nothing here.  A compiler of one's own is an
option of ``numba.njit`` (``pipeline_class``, "Customizing the Compiler" in Numba's manual), and there are three:

`KERNEL`, for what Python calls.  Numba looks up the implementation of every operator under the flags of the function
that it stands in, and compares these setting by setting, hundreds of thousands of times in a first fit; functions
whose flags differ in what no operator asks for are compiled again.  Here equal flags are one object.  And loops
are not unrolled: a kernel takes a fifth less time to compile, and none runs slower, some a tenth faster.

`SHORT`, for kernels whose inner loops run over a handful of parameters, not over samples: nor are they made to take
several turns at once, which is another fifth.

`LINKED`, for functions that only kernels call.  Numba optimises every function to the end, makes machine code of it and
hands the optimised code to its callers, where it is optimised again; of such a function the first two are for nothing.
Here it is tidied and linked into its callers, and no further; what it becomes, it becomes in the kernel.

How flags are kept and what a code library does at its end is Numba's own affair, so where it is not what is expected
here all three are None and functions are compiled in Numba's way, which gives the same numbers and takes longer.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import hashlib
import logging
import math
import os
import re
import shutil
import stat
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numba
import numpy
from numba.core import event
from numba.extending import intrinsic, overload

KERNEL: Any = None  # for the option ``pipeline_class``, where None is Numba's own
SHORT: Any = None
LINKED: Any = None

try:
    import llvmlite.binding as llvm
    from llvmlite.binding import newpassmanagers
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler import Compiler, DefaultPassBuilder, Flags
    from numba.core.compiler_machinery import LoweringPass, register_pass
    from numba.core.typed_passes import IRLegalization
except ImportError:
    _KNOWN = False
else:
    _EXPECTED = "_optimize_functions", "_optimize_final_module", "_finalize_final_module", "_finalize_dynamic_globals"
    _KNOWN = (
        all(hasattr(JITCodeLibrary, name) for name in _EXPECTED)
        and all(hasattr(Flags, name) for name in ("copy", "values", "discard"))
        and hasattr(newpassmanagers.ModulePassManager, "add_sroa_pass")  # passes one by one, from llvmlite 0.45 on
    )

if _KNOWN:

    class _Shared(Flags):
        """Flags that never change, as Numba looks implementations up under them."""

        __slots__ = "_hash", "_known"

        def __init__(self, flags: Any) -> None:
            super().__init__(flags)
            for name in ("no_cpython_wrapper", "no_cfunc_wrapper"):  # how Python calls the function, not what is in it
                self.discard(name)
            self._known = super().values()
            self._hash = super().__hash__()

        def values(self) -> dict[str, Any]:
            return self._known

        def __hash__(self) -> int:
            return self._hash

        def __eq__(self, other: object) -> bool:
            return self is other or super().__eq__(other)

    class _Flags(Flags):
        """Flags whose copy, which stands for them while a function is compiled, is one object for all equal ones."""

        __slots__ = ()
        _shared: ClassVar[dict[_Shared, _Shared]] = {}

        def copy(self) -> _Shared:
            made = _Shared(self)
            return self._shared.setdefault(made, made)

    class _Library(JITCodeLibrary):
        """Code whose loops are not unrolled."""

        several_at_once = True  # turns of a loop

        def _optimize_final_module(self) -> None:
            # Numba's two rounds: one that inlines, so that counting of references cancels, and one with everything
            for level in (0, 3):
                options = llvm.PipelineTuningOptions(level)
                options.slp_vectorization = options.loop_unrolling = False
                options.loop_vectorization = level == 3 and self.several_at_once
                builder = llvm.create_pass_builder(self._codegen._tm, options)
                manager = builder.getModulePassManager()
                if level == 0:
                    manager.add_loop_rotate_pass()
                    manager.add_instruction_combine_pass()
                    manager.add_jump_threading_pass()
                manager.add_refprune_pass()
                manager.run(self._final_module, builder)

    class _ShortLibrary(_Library):
        """Code whose loops are left as they are written."""

        several_at_once = False

    @register_pass(mutates_CFG=False, analysis_only=False)
    class _Make(LoweringPass):
        """What follows fills a library of the pipeline's kind: Numba lowers into the one that is there."""

        _name = "library"

        def __init__(self) -> None:
            LoweringPass.__init__(self)

        def run_pass(self, state: Any) -> bool:
            """As Numba makes its own where there is none."""
            returned = state.targetctx.data_model_manager[state.return_type]
            if not state.flags.nrt and returned.contains_nrt_meminfo():  # a caller that counts would free it twice
                raise TypeError(f"{state.func_id.func_name} counts no references, but returns an array; see `view`.")
            state.library = state.pipeline.library(state.targetctx.codegen(), state.func_id.func_qualname)
            if state.pipeline.kept:
                state.library.enable_object_caching()
            return True

    class _Kernel(Compiler):
        """Numba's own pipeline, with these flags and another library."""

        library: Any = _Library
        kept = True  # in an entry of the cache

        def __init__(self, *given: Any) -> None:
            *before, flags, types_of_locals = given
            super().__init__(*before, _Flags(flags), types_of_locals)  # type: ignore[call-arg]  # mypy sees no base

        def define_pipelines(self) -> list[Any]:
            """One."""
            manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
            manager.add_pass_after(_Make, IRLegalization)
            manager.finalize()
            return [manager]

    class _NoEnvironment:
        """A code generator that has no place for a function's environment, which only calls from Python ask for."""

        def __init__(self, codegen: Any) -> None:
            self._codegen = codegen

        def __getattr__(self, name: str) -> Any:
            return getattr(self._codegen, name)

        def set_env(self, name: str, environment: Any) -> None:
            """Nothing is there to be set."""

    class _LinkedLibrary(JITCodeLibrary):
        """Code that is tidied and linked into its callers; it has no address."""

        @property
        def codegen(self) -> Any:
            """Numba asks it for the environment's place."""
            return _NoEnvironment(self._codegen)

        def _optimize_functions(self, module: Any) -> None:
            module.data_layout = self._codegen._data_layout

        def _optimize_final_module(self) -> None:
            # Locals out of memory and counting of references that cancels: what is left is half as much to link and to
            # optimise in each caller.  With more passes here the kernels come out up to a fifth slower, since what they
            # are written into knows more.
            manager = llvm.create_new_module_pass_manager()
            manager.add_sroa_pass()
            manager.add_refprune_pass()
            manager.run(self._final_module, llvm.create_pass_builder(self._codegen._tm, llvm.PipelineTuningOptions()))

        def _finalize_final_module(self) -> None:
            # Numba's own would give the module to the engine, which makes machine code of it
            self._finalize_dynamic_globals()
            self._finalized = True

        def get_pointer_to_function(self, _: str) -> int:
            """None."""
            self._ensure_finalized()
            return 0

    class _Short(_Kernel):
        library = _ShortLibrary

    class _Linked(_Kernel):
        library, kept = _LinkedLibrary, False

    KERNEL, SHORT, LINKED = _Kernel, _Short, _Linked

# Of Python's garbage collection while a kernel is compiled, which makes millions of small objects that nobody drops
# before its end: looking through them again and again was a tenth of the time.
THRESHOLDS = 50_000, 50, 50
STALE_SECONDS = 90 * 86_400.0  # a source that no process has declared for so long was edited or upgraded since
_settings: Any = numba.config  # its attributes are made at run time
_declare: Any = numba.njit
_ROOT = Path(__file__).resolve().parent
_IMPORT = re.compile(r"^\s*from\s+(whsklearn[\w.]*)\s+import\s+(\([^)]*\)|[^\n]*)|^\s*import\s+(whsklearn[\w.]*)", re.M)


class _Compiling(event.Listener):
    """CPU seconds that this process has spent compiling kernels of the package; the first of them is announced."""

    WORTH_A_WORD = 1.0  # seconds: an odd law costs a tenth, a first run ten

    def __init__(self) -> None:
        self.seconds, self.told = 0.0, False
        self.kept = True  # for the next process
        self._depth, self._began = 0, 0.0

    def on_start(self, _: Any) -> None:
        """A function begins; those that it calls are compiled inside."""
        if not self._depth:
            self._threshold = gc.get_threshold()
            gc.set_threshold(*THRESHOLDS)
            self._began = time.process_time()
        self._depth += 1

    def on_end(self, e: Any) -> None:
        """It ends."""
        self._depth -= 1
        if not self._depth:
            gc.set_threshold(*self._threshold)
        # a function of a user's own may stand in no module
        if self._depth or not (e.data["dispatcher"].py_func.__module__ or "").startswith("whsklearn."):
            return
        self.seconds += time.process_time() - self._began
        if self.seconds > self.WORTH_A_WORD and not self.told:
            self.told = True
            logging.getLogger("whsklearn").warning(
                "compiling once on this machine, some 5 to 30 s; later runs load it"
                if self.kept
                else "compiling, some 5 to 30 s in every process, as no folder can be written to that would keep it; "
                "set NUMBA_CACHE_DIR to one"
            )


_compiling = _Compiling()
event.register("numba:compile", _compiling)


def compiling_seconds() -> float:
    """CPU seconds that went into compiling kernels, in this process so far: they are nobody's fit."""
    return _compiling.seconds


class KernelPart:
    """A function that kernels call; called from Python it is a kernel of its own, which is made when that happens."""

    def __init__(self, function: Callable[..., Any], **options: Any):
        functools.update_wrapper(self, function)
        self.py_func = function
        self._options = options
        self._linked = _declare(pipeline_class=LINKED, no_cpython_wrapper=True, no_cfunc_wrapper=True, **options)(
            function
        )
        # The literal 0 has a type of its own, for which all that a caller hands it on to would be compiled once more
        template, plain = self._linked.get_call_template, numba.types.unliteral
        self._linked.get_call_template = lambda args, kws: template(
            tuple(map(plain, args)), {name: plain(kind) for name, kind in kws.items()}
        )

    @property
    def _numba_type_(self) -> Any:
        """By which Numba knows what a kernel calls (as it knows its own functions)."""
        return numba.types.Dispatcher(self._linked)

    @functools.cached_property
    def _alone(self) -> Any:
        return njit(**self._options)(self.py_func)

    def __call__(self, *args: Any) -> Any:
        return self._alone(*args)

    def __reduce__(self) -> str:
        return self.py_func.__qualname__


def njit(*signature: Any, cache: bool = True, short: bool = False, counted: bool | None = None, **options: Any) -> Any:
    """`numba.njit` with the cache on and keyed on all that is inlined; used in the same ways.

    ``*signature``: the function itself where the decorator has no brackets.
    ``cache``: False for functions that kernels call: they are compiled within them (`KernelPart`).
    ``short``: True for kernels whose inner loops are short, over a handful of parameters (`SHORT`).
    ``counted``: False for kernels that make no array and return none, so that references to their arguments need not
        be counted: a quarter less code goes to LLVM, and they run as fast.  What they call inherits it; a part that
        makes arrays for itself says True, and one that returns views is a `view`.
    ``**options``: of `numba.njit`.
    """
    if len(signature) == 1 and callable(signature[0]) and hasattr(signature[0], "__code__"):
        return njit(cache=cache, short=short, counted=counted, **options)(signature[0])
    if counted is not None:
        options["_nrt"] = counted

    def decorate(function: Callable[..., Any]) -> Any:
        if not cache and LINKED is not None and not _settings.DISABLE_JIT:
            return KernelPart(function, **options)
        # nothing here is called through a C pointer (`effects.own` makes its own), and the wrapper for it is a sixth of
        # the time that compiling takes
        pipeline = SHORT if short else KERNEL
        folder = _folder(Path(function.__code__.co_filename)) if cache else None
        declare = _declare(
            *signature, cache=folder is not None, no_cfunc_wrapper=True, pipeline_class=pipeline, **options
        )
        if folder is None:
            return declare(function)
        before = {name: getattr(_settings, name, "") for name in ("CACHE_DIR", "CACHE_LOCATOR_CLASSES")}
        _settings.CACHE_DIR, _settings.CACHE_LOCATOR_CLASSES = str(folder), f"{__name__}.{Locator.__name__}"
        try:
            return declare(function)
        finally:
            for name, value in before.items():
                setattr(_settings, name, value)

    return decorate


class Locator:
    """Where Numba keeps a kernel: in the folder that is set while it is declared, whose name tells its source."""

    def __init__(self, line: int) -> None:
        self._folder, self._line = str(_settings.CACHE_DIR), line

    @classmethod
    def from_function(cls, function: Any, _file: str) -> Locator:
        """For a function that is being declared."""
        Path(_settings.CACHE_DIR).mkdir(parents=True, exist_ok=True)
        return cls(function.__code__.co_firstlineno)

    def ensure_cache_path(self) -> None:
        """Make the folder; somebody may have emptied the cache since."""
        Path(self._folder).mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        """The folder."""
        return self._folder

    def get_source_stamp(self) -> str:
        """What changes with the source: the folder's name."""
        return Path(self._folder).name

    def get_disambiguator(self) -> str:
        """Tells functions of one name apart."""
        return str(self._line)


def part(function: Callable[..., Any]) -> Any:
    """A function that kernels call, as `KernelPart`: compiled within them, and kept in their cache entries."""
    return njit(cache=False, error_model="numpy")(function)


def view(function: Callable[..., Any]) -> Any:
    """A function that returns views of its arguments, written into its callers, whose arrays they are (`njit`)."""
    return _declare(inline="always")(function)


@cache
def fingerprint(path: Path) -> str:
    """Hexadecimal digest of a file and of all files of the package below it in the order of imports."""
    seen: dict[Path, bytes] = {}
    waiting = [path]
    while waiting:
        file = waiting.pop()
        if file not in seen:
            seen[file] = file.read_bytes()
            waiting += imported(seen[file].decode())
    digest = hashlib.sha256()
    for file in sorted(seen):
        digest.update(str(file.relative_to(_ROOT) if file.is_relative_to(_ROOT) else file).encode())
        digest.update(seen[file])
    return digest.hexdigest()[:16]


def imported(source: str) -> list[Path]:
    """Files of the package that a source imports, by their names in its import statements."""
    files = []
    for package, names, module in _IMPORT.findall(source):
        base = _file(package or module)
        files += [base] if base is not None else []
        for name in re.findall(r"\w+", re.sub(r"#[^\n]*|\bas\s+\w+", "", names)):
            part = _file(f"{package}.{name}")
            files += [part] if part is not None else []
    return files


def _file(module: str) -> Path | None:
    """The file of a module of the package, None if there is no such module; ``__init__`` files hold no kernel."""
    file = _ROOT.joinpath(*module.split(".")[1:]).with_suffix(".py") if "." in module else None
    return file if file is not None and file.is_file() else None


def _folder(path: Path) -> Path | None:
    """Where the kernels of a file are cached: where the user says, else in the user's cache, or beside the package.

    The temporary folder where none of these can be written to, as in a container; None where that cannot either.
    """
    for base in _bases():
        if _writable(base):
            folder = base / fingerprint(path.resolve())
            with contextlib.suppress(OSError):  # it was used today; rebuilt, those that nobody uses make room
                os.utime(folder) if folder.is_dir() else _sweep(base)
            return folder
    _compiling.kept = False
    return None


def is_kept(path: Path) -> bool:
    """Whether compiled kernels of a file are in the cache, or none can be kept."""
    folder = _folder(path)
    return folder is None or any(folder.rglob("*.nbc"))


def _bases() -> Iterator[Path]:
    """Folders to try, the best first; what Numba and NumPy of other versions compiled is theirs."""
    own = f"kernels-numba-{numba.__version__}-numpy-{numpy.__version__}"
    if _settings.CACHE_DIR:
        yield Path(_settings.CACHE_DIR) / own
    else:
        with contextlib.suppress(RuntimeError):  # no home at all
            yield Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "whsklearn" / own
        yield _ROOT / "__pycache__" / own
    with contextlib.suppress(FileNotFoundError):  # no temporary folder either
        yield _own_temporary_folder() / own


@cache
def _sweep(base: Path) -> None:
    """Remove kernels of sources that no process has declared for long."""
    for folder in base.iterdir():
        if time.time() - folder.stat().st_mtime > STALE_SECONDS:
            shutil.rmtree(folder, ignore_errors=True)


@cache
def _own_temporary_folder() -> Path:
    """One that only this user can write to: what is in a cache is run as code."""
    user = os.getuid() if hasattr(os, "getuid") else ""
    folder = Path(tempfile.gettempdir(), f"whsklearn-{user}")
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        if stat.S_ISDIR(found.st_mode) and (user == "" or (found.st_uid == user and not found.st_mode & 0o022)):
            return folder
    raise FileNotFoundError(f"{folder} is not this user's own.")


@cache
def _writable(folder: Path) -> bool:
    """Whether files can be made in a folder, by making one, which is what Numba will do."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def borrowed(arrays):
    """A view of an array, or of all arrays of a tuple, whose references nobody counts: for the inner loop of a kernel.

    Numba counts an array's references, with an atomic addition, wherever one function passes it to another, and does
    not see that the counts of a loop cancel. That was more than three quarters of a servo's fine step (79 ns with it,
    15 without) and half of a chain's sample with effects (125 to 48 ns); the numbers are the same to the last bit.
    The owner must live longer than the view: borrow arguments, not arrays that the same function makes.
    """
    return arrays


def _piece(array, first, shape):
    """Consecutive elements of a contiguous array from the flat index ``first`` on, as a view of ``shape``.

    The caller knows that they are all there.  A slice of Numba's checks its bounds, and ``reshape`` whether the
    elements are consecutive; together that was a sixth of the code of the two large kernels.
    """
    return array.reshape(-1)[first : first + math.prod(shape)].reshape(shape)


def _compiled_piece(_context: Any, array: Any, first: Any, shape: Any) -> Any:
    if array.layout != "C":
        raise numba.errors.TypingError(f"a piece of {array}, whose elements are not consecutive")
    view = array.copy(ndim=len(shape), layout="C")

    def made(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        source = context.make_array(array)(context, builder, arguments[0])
        size = context.get_constant(numba.types.intp, context.get_abi_sizeof(context.get_value_type(array.dtype)))
        cast = functools.partial(context.cast, builder, toty=numba.types.intp)
        lengths = [cast(builder.extract_value(arguments[2], i), fromty=kind) for i, kind in enumerate(shape)]
        strides = [size]
        for length in lengths[:0:-1]:
            strides.insert(0, builder.mul(strides[0], length))
        out = context.make_array(view)(context, builder)
        numba.np.arrayobj.populate_array(
            out, builder.gep(source.data, [cast(arguments[1], fromty=first)]), lengths, strides, size,
            source.meminfo, source.parent,
        )  # fmt: skip
        return numba.core.imputils.impl_ret_borrowed(context, builder, view, out._getvalue())

    return view(array, first, shape), made


piece: Any = _piece if _settings.DISABLE_JIT else intrinsic(_compiled_piece)


@intrinsic
def _unowned(_context: Any, arrays: Any) -> Any:
    """The arrays with no owner of their memory."""

    def bare(context: Any, builder: Any, kind: Any, value: Any) -> Any:
        if isinstance(kind, numba.types.Array):
            view = context.make_array(kind)(context, builder, value=value)
            view.meminfo = numba.core.cgutils.get_null_value(view.meminfo.type)
            return view._getvalue()
        if isinstance(kind, numba.types.BaseTuple):
            for i, inner in enumerate(kind):  # type: ignore[arg-type,var-annotated]
                item = bare(context, builder, inner, builder.extract_value(value, i))
                value = builder.insert_value(value, item, i)
        return value

    def made(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return bare(context, builder, arrays, arguments[0])

    return arrays(arrays), made


@overload(borrowed, jit_options={"forceinline": True})
def _borrowed(arrays):  # noqa: ARG001  # by its type the compiler chooses
    return lambda arrays: _unowned(arrays)  # type: ignore[call-arg]  # the compiler gives the context
