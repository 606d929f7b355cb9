"""How functions are compiled: Numba's own pipeline, less what is for nothing here.

A compiler of one's own is an option of ``numba.njit`` (``pipeline_class``, "Customizing the Compiler" in Numba's
manual), and there are three:

`KERNEL`, for what Python calls.  Numba looks up the implementation of every operator under the flags of the function
that it stands in, and compares these setting by setting, hundreds of thousands of times in a first fit; functions
whose flags differ in what no operator asks for have theirs compiled anew.  Here equal flags are one object.  And loops
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

from typing import Any, ClassVar

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
