"""A row of lanes as one value: the sums of several ties stay in registers, where loops over lanes store every term.

``lanes_at`` takes the value out of an array whose last axis holds the lanes, ``put_lanes`` puts it back; between them
it is added, subtracted, multiplied and divided, by other rows and by numbers. Without the compiler it is an array of
numpy. Products and sums may be contracted, as everywhere in the kernels.
"""

import operator
from typing import ClassVar

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import lower_builtin, models, register_model, type_callable

from engine.kernels.layout import LANES

_DOUBLE = ir.DoubleType()
_ROW = ir.VectorType(_DOUBLE, LANES)
_BYTES = 8  # rows of arrays begin at any number


def lanes_at(array, index):
    """The row of lanes at an index, a tuple of all but the last axis."""
    return array[index].copy()


def put_lanes(array, index, row):
    """Store a row of lanes at an index, a tuple of all but the last axis."""
    array[index] = row


def all_lanes(number):
    """A number in every lane."""
    return np.full(LANES, number)


class Row(types.Type):
    """Numba's type of a row of lanes."""

    def __init__(self):
        super().__init__(name=f"Row({LANES})")


ROW = Row()


@register_model(Row)
class _RowModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _ROW)


def _holds_rows(array, index):
    """Whether the arguments are an array of rows and an index of one."""
    return (
        isinstance(array, types.Array)
        and (array.dtype, array.layout) == (types.float64, "C")
        and isinstance(index, types.UniTuple | types.Tuple)
        and len(index) == array.ndim - 1
        and all(isinstance(part, types.Integer) for part in index)  # signed and unsigned add up to a float
    )


@type_callable(lanes_at)
def _type_lanes_at(context):
    return lambda array, index: ROW if _holds_rows(array, index) else None


@type_callable(put_lanes)
def _type_put_lanes(context):
    return lambda array, index, row: types.none if _holds_rows(array, index) and row == ROW else None


@type_callable(all_lanes)
def _type_all_lanes(context):
    return lambda number: ROW if number == types.float64 else None


def _pointer(context, builder, kinds, values):
    """Pointer to the row of an array at an index; checked where numba checks indices."""
    array = context.make_array(kinds[0])(context, builder, values[0])
    parts = [
        context.cast(builder, part, kind, types.intp)
        for part, kind in zip(cgutils.unpack_tuple(builder, values[1]), kinds[1], strict=True)
    ]
    inside = [*parts, context.get_constant(types.intp, 0)]
    found = cgutils.get_item_pointer(
        context, builder, kinds[0], array, inside, wraparound=False, boundscheck=context.enable_boundscheck
    )
    return builder.bitcast(found, _ROW.as_pointer())


@lower_builtin(lanes_at, types.Array, types.BaseTuple)
def _load(context, builder, called, values):
    return builder.load(_pointer(context, builder, called.args, values), align=_BYTES)


@lower_builtin(put_lanes, types.Array, types.BaseTuple, Row)
def _store(context, builder, called, values):
    builder.store(values[2], _pointer(context, builder, called.args, values), align=_BYTES)
    return context.get_dummy_value()


def _spread(builder, number):
    """The same number in every lane."""
    one = builder.insert_element(ir.Constant(_ROW, ir.Undefined), number, ir.Constant(ir.IntType(32), 0))
    nowhere = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(one, ir.Constant(_ROW, ir.Undefined), nowhere)


@lower_builtin(all_lanes, types.float64)
def _lower_all_lanes(context, builder, called, values):
    return _spread(builder, values[0])


def _arithmetic(operation, instruction):
    """Make an operation known between rows, and between a row and a number."""

    class Template(ConcreteTemplate):
        cases: ClassVar = [signature(ROW, *kinds) for kinds in ((ROW, ROW), (types.float64, ROW), (ROW, types.float64))]

    infer_global(operation)(Template)

    def lower(context, builder, called, values):
        one, other = (
            value if kind == ROW else _spread(builder, value) for kind, value in zip(called.args, values, strict=True)
        )
        return getattr(builder, instruction)(one, other, flags=("contract",))

    for kinds in ((Row, Row), (types.Float, Row), (Row, types.Float)):
        lower_builtin(operation, *kinds)(lower)


for _operation, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _arithmetic(_operation, _instruction)
