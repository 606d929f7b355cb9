"""Eight numbers that a kernel computes with at once, in one vector register where the processor has one that wide.

The compiler turns a loop over eight axes into vector instructions only if it can prove that none of the arrays overlap,
which it checks again at every loop, and it keeps intermediate results in memory.  Here the eight are a type of their
own with + - * /, so a formula for one axis is the formula for eight, its intermediate results stay in registers,
and every number has the same bits as alone.  Uncompiled, eight numbers are an array of shape (8,).
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, models, overload, register_model

LANES = 8
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)


class _Lanes(types.Type):  # type: ignore[misc]  # untyped base
    """Numba's type of eight numbers."""

    def __init__(self) -> None:
        super().__init__(name="Lanes")


_lanes = _Lanes()


@register_model(_Lanes)
class _Model(models.PrimitiveModel):  # type: ignore[misc]  # untyped base
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)


def _lower(operation: Any, instruction: str, operands: int) -> None:
    """Let kernels apply an operator to lanes."""

    class _Typing(ConcreteTemplate):  # type: ignore[misc]  # untyped base
        cases = [signature(*[_lanes] * (operands + 1))]  # noqa: RUF012  # Numba's name

    infer_global(operation)(_Typing)

    @lower_builtin(operation, *[_lanes] * operands)
    def _made(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return getattr(builder, instruction)(*arguments)


for _operation, _instruction, _operands in (
    (operator.add, "fadd", 2), (operator.sub, "fsub", 2), (operator.mul, "fmul", 2), (operator.truediv, "fdiv", 2),
    (operator.neg, "fneg", 1),
):  # fmt: skip
    _lower(_operation, _instruction, _operands)


def take(array, i):
    """The i-th eight numbers of a contiguous array."""
    return array[i * LANES : (i + 1) * LANES].copy()


def put(array, i, lanes):
    """Store eight numbers as the i-th of a contiguous array."""
    array[i * LANES : (i + 1) * LANES] = lanes


def gather(array, at, stride):
    """Eight numbers of a contiguous array, from ``at`` on, ``stride`` apart.

    Reading them one by one into a register takes half the time of copying them side by side and reading those: a
    register that is filled from eight fresh stores has to wait for all of them.
    """
    return array[at + stride * np.arange(LANES)]


def _pointer(context: Any, builder: Any, kind: Any, array: Any, at: Any) -> Any:
    return builder.gep(context.make_array(kind)(context, builder, value=array).data, [at])


def _vector_at(context: Any, builder: Any, kind: Any, array: Any, i: Any) -> Any:
    first = builder.mul(i, ir.Constant(i.type, LANES))
    return builder.bitcast(_pointer(context, builder, kind, array, first), _VECTOR.as_pointer())


@intrinsic
def _take(_context: Any, array: Any, _i: Any) -> Any:
    def made(context: Any, builder: Any, kinds: Any, arguments: Any) -> Any:
        return builder.load(_vector_at(context, builder, kinds.args[0], *arguments), align=8)

    return _lanes(array, types.intp), made


@intrinsic
def _put(_context: Any, array: Any, _i: Any, lanes: Any) -> Any:
    def made(context: Any, builder: Any, kinds: Any, arguments: Any) -> Any:
        builder.store(arguments[2], _vector_at(context, builder, kinds.args[0], *arguments[:2]), align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, lanes), made


@intrinsic
def _gather(_context: Any, array: Any, _at: Any, _stride: Any) -> Any:
    def made(context: Any, builder: Any, kinds: Any, arguments: Any) -> Any:
        vector = ir.Constant(_VECTOR, ir.Undefined)
        where = _pointer(context, builder, kinds.args[0], *arguments[:2])
        for lane in range(LANES):
            if lane:
                where = builder.gep(where, [arguments[2]])
            vector = builder.insert_element(vector, builder.load(where), ir.Constant(ir.IntType(32), lane))
        return vector

    return _lanes(array, types.intp, types.intp), made


@overload(take, jit_options={"forceinline": True})
def _take_compiled(array, i):  # noqa: ARG001  # by its types the compiler chooses
    return lambda array, i: _take(array, i)  # type: ignore[call-arg]  # the compiler gives the context


@overload(put, jit_options={"forceinline": True})
def _put_compiled(array, i, lanes):  # noqa: ARG001
    return lambda array, i, lanes: _put(array, i, lanes)  # type: ignore[call-arg]


@overload(gather, jit_options={"forceinline": True})
def _gather_compiled(array, at, stride):  # noqa: ARG001
    return lambda array, at, stride: _gather(array, at, stride)  # type: ignore[call-arg]
