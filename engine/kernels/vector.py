"""A row of lanes as one value: the sums of several ties stay in registers, where loops over lanes store every term.

``lanes_at`` takes the value out of an array whose last axis holds the lanes, ``put_lanes`` puts it back; between them
it is added, subtracted, multiplied and divided, by other rows and by numbers. Without the compiler it is an array of
numpy. Products and sums may be contracted, as everywhere in the kernels.

Comparisons make a truth for every lane, false where a NaN is compared; ``and`` and ``or`` of them are & and |.
``everywhere`` asks for all lanes, ``choose`` takes each lane from one of two rows.
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
_TRUTHS = ir.VectorType(ir.IntType(1), LANES)
_BYTES = 8  # rows of arrays begin at any number
_LEAST, _BIAS, _MANTISSA = -1022, 1023, 52  # of float64: least exponent, what is added to it, bits of the mantissa


def lanes_at(array, index):
    """The row of lanes at an index, a tuple of all but the last axis."""
    return array[index].copy()


def put_lanes(array, index, row):
    """Store a row of lanes at an index, a tuple of all but the last axis."""
    array[index] = row


def all_lanes(number):
    """A number in every lane."""
    return np.full(LANES, number)


def two_to(row):
    """Two to the power of whole numbers; those below ``_LEAST`` count as that."""
    return np.ldexp(1.0, np.maximum(row, _LEAST).astype(np.int64))


def root(row):
    """The square root of every lane."""
    return np.sqrt(row)


def total(row):
    """The sum of all lanes: first of those half the lanes apart, and so on."""
    while len(row) > 1:
        row = row[: len(row) // 2] + row[len(row) // 2 :]
    return row[0]


def everywhere(truths):
    """Whether all lanes are true."""
    return bool(np.all(truths))


def choose(truths, one, other):
    """The lanes of one row where they are true, of the other elsewhere; numbers stand for rows."""
    return np.where(truths, one, other)


class Row(types.Type):
    """Numba's type of a row of lanes."""

    def __init__(self):
        super().__init__(name=f"Row({LANES})")


ROW = Row()


@register_model(Row)
class _RowModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _ROW)


class Truths(types.Type):
    """Numba's type of a truth for every lane."""

    def __init__(self):
        super().__init__(name=f"Truths({LANES})")


TRUTHS = Truths()


@register_model(Truths)
class _TruthsModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _TRUTHS)


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


@lower_builtin(two_to, Row)
def _lower_two_to(context, builder, called, values):
    """A sum with 1.5 2^52 holds a whole number in its lowest bits: they become the exponent."""
    least, shift = (_spread(builder, _DOUBLE(number)) for number in (_LEAST, 1.5 * 2.0**_MANTISSA + _BIAS))
    power = builder.select(builder.fcmp_ordered("<", values[0], least), least, values[0])
    whole = ir.VectorType(ir.IntType(64), LANES)
    bits = builder.bitcast(builder.fadd(power, shift), whole)
    return builder.bitcast(builder.shl(bits, ir.Constant(whole, [_MANTISSA] * LANES)), _ROW)


@lower_builtin(root, Row)
def _lower_root(context, builder, called, values):
    kind = ir.FunctionType(_ROW, [_ROW])
    return builder.call(builder.module.declare_intrinsic(f"llvm.sqrt.v{LANES}f64", (), kind), values)


@lower_builtin(total, Row)
def _lower_total(context, builder, called, values):
    row, count = values[0], LANES
    while count > 1:
        count //= 2
        nowhere, whole = ir.Constant(row.type, ir.Undefined), ir.VectorType(ir.IntType(32), count)
        halves = [ir.Constant(whole, list(range(first, first + count))) for first in (0, count)]
        row = builder.fadd(*(builder.shuffle_vector(row, nowhere, half) for half in halves))
    return builder.extract_element(row, ir.Constant(ir.IntType(32), 0))


@lower_builtin(everywhere, Truths)
def _lower_everywhere(context, builder, called, values):
    bits = ir.IntType(LANES)
    return builder.icmp_unsigned("==", builder.bitcast(values[0], bits), ir.Constant(bits, -1))


@type_callable(choose)
def _type_choose(context):
    kinds = (ROW, types.float64)
    return lambda truths, one, other: ROW if truths == TRUTHS and one in kinds and other in kinds else None


@lower_builtin(choose, Truths, types.Any, types.Any)
def _lower_choose(context, builder, called, values):
    return builder.select(values[0], *_rows(builder, called.args[1:], values[1:]))


def _rows(builder, kinds, values):
    """Values as rows, numbers spread."""
    return [value if kind == ROW else _spread(builder, value) for kind, value in zip(kinds, values, strict=True)]


def _known(operation, result, *arguments):
    """Tell numba the type of what an operation makes of arguments of some types."""

    class Template(ConcreteTemplate):
        cases: ClassVar = [signature(result, *kinds) for kinds in arguments]

    infer_global(operation)(Template)


for _function, _result, _argument in (
    (all_lanes, ROW, types.float64),
    (two_to, ROW, ROW),
    (root, ROW, ROW),
    (total, types.float64, ROW),
    (everywhere, types.boolean, TRUTHS),
):
    _known(_function, _result, (_argument,))


def _between_rows(operation, result, build):
    """Make an operation known between rows, and between a row and a number."""
    _known(operation, result, (ROW, ROW), (types.float64, ROW), (ROW, types.float64))

    def lower(context, builder, called, values):
        return build(builder, *_rows(builder, called.args, values))

    for kinds in ((Row, Row), (types.Float, Row), (Row, types.Float)):
        lower_builtin(operation, *kinds)(lower)


def _between_truths(operation, instruction):
    """Make an operation known between truths."""
    _known(operation, TRUTHS, (TRUTHS, TRUTHS))
    lower_builtin(operation, Truths, Truths)(
        lambda context, builder, called, values: getattr(builder, instruction)(*values)
    )


for _operation, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _between_rows(
        _operation, ROW, lambda builder, *rows, of=_instruction: getattr(builder, of)(*rows, flags=("contract",))
    )
for _operation, _sign in ((operator.le, "<="), (operator.lt, "<"), (operator.ge, ">="), (operator.gt, ">")):
    _between_rows(_operation, TRUTHS, lambda builder, *rows, of=_sign: builder.fcmp_ordered(of, *rows))
for _operation, _instruction in ((operator.and_, "and_"), (operator.or_, "or_")):
    _between_truths(_operation, _instruction)
