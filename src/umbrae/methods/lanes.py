"""Sixteen float32 numbers as one value in kernels, and comparisons that give bit masks.

LLVM turns simple loops into vector code by itself, but not into comparisons that end in a mask. Inside kernels,
`load` and `splat` make a value whose `+ - *`, `abs` and comparisons work on all lanes at once; a comparison gives an
int32 with bit i set where it holds in lane i. On a processor with narrower vectors LLVM splits the operations.
"""

import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

LANES = 16
"""Samples per leaf, and triangles per cluster."""

ALL = (1 << LANES) - 1


class _Lanes(types.Type):  # type: ignore[misc]
    def __init__(self) -> None:
        super().__init__(name="Lanes")


_lanes = _Lanes()
_vector = ir.VectorType(ir.FloatType(), LANES)


@register_model(_Lanes)
class _LanesModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _vector)


@intrinsic
def load(typing_context, array, row, column):
    """Lanes from `array[row, column:column + 16]`, float32."""

    def build(context, builder, signature, args):
        return _row(context, builder, signature, args, ir.FloatType(), 4)

    return _lanes(array, types.intp, types.intp), build


@intrinsic
def equal(typing_context, array, row, column, number):
    """Mask of the lanes in which `array[row, column:column + 16]`, of integers, is `number`."""
    element = ir.IntType(array.dtype.bitwidth)

    def build(context, builder, signature, args):
        values = _row(context, builder, signature, args, element, array.dtype.bitwidth // 8)
        return _bits(builder, builder.icmp_signed("==", values, _spread(builder, args[3])))

    return types.int32(array, types.intp, types.intp, array.dtype), build


def _row(context, builder, signature, args, element, size):
    """Read 16 neighbours from a row of a C-ordered array."""
    array = context.make_array(signature.args[0])(context, builder, args[0])
    columns = builder.extract_value(array.shape, 1)
    first = builder.gep(array.data, [builder.add(builder.mul(args[1], columns), args[2])])
    return builder.load(builder.bitcast(first, ir.VectorType(element, LANES).as_pointer()), align=size)


def _spread(builder, number):
    vector = ir.VectorType(number.type, LANES)
    first = builder.insert_element(ir.Constant(vector, ir.Undefined), number, ir.Constant(ir.IntType(32), 0))
    places = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(first, ir.Constant(vector, ir.Undefined), places)


def _bits(builder, verdicts):
    return builder.zext(builder.bitcast(verdicts, ir.IntType(LANES)), ir.IntType(32))


@intrinsic
def splat(typing_context, number):
    """A float32 number in all lanes."""
    return _lanes(types.float32), lambda context, builder, signature, args: _spread(builder, args[0])


@intrinsic
def choose(typing_context, mask, value, other):
    """Lanes of `value` where the mask's bit is set, else of `other`."""

    def build(context, builder, signature, args):
        bits = builder.bitcast(builder.trunc(args[0], ir.IntType(LANES)), ir.VectorType(ir.IntType(1), LANES))
        return builder.select(bits, args[1], args[2])

    return _lanes(types.int32, _lanes, _lanes), build


def _reduction(name):
    @intrinsic
    def operation(typing_context, value):
        def build(context, builder, signature, args):
            function_type = ir.FunctionType(ir.FloatType(), [_vector])
            called = f"llvm.vector.reduce.{name}.v{LANES}f32"
            function = cgutils.get_or_insert_function(builder.module, function_type, called)
            return builder.call(function, args)

        return types.float32(_lanes), build

    return operation


smallest, largest = _reduction("fmin"), _reduction("fmax")
"""The smallest and the largest of the lanes."""


@intrinsic
def lesser(typing_context, value, other):
    """The smaller of two in each lane."""

    def build(context, builder, signature, args):
        return builder.select(builder.fcmp_ordered("<", *args), *args)

    return _lanes(_lanes, _lanes), build


def _define(symbol, result, emit):
    """Give an operator a meaning for lanes with lanes, and with one float32 for all."""

    @type_callable(symbol)
    def type_operator(context):
        def typer(a, b):
            return result if a == _lanes and b in (_lanes, types.float32) else None

        return typer

    @lower_builtin(symbol, _lanes, _lanes)
    def with_lanes(context, builder, signature, args):
        return emit(builder, *args)

    @lower_builtin(symbol, _lanes, types.float32)
    def with_number(context, builder, signature, args):
        return emit(builder, args[0], _spread(builder, args[1]))


def _comparison(sign):
    return lambda builder, a, b: _bits(builder, builder.fcmp_ordered(sign, a, b))


_define(operator.add, _lanes, lambda builder, a, b: builder.fadd(a, b))
_define(operator.sub, _lanes, lambda builder, a, b: builder.fsub(a, b))
_define(operator.mul, _lanes, lambda builder, a, b: builder.fmul(a, b))
_define(operator.lt, types.int32, _comparison("<"))
_define(operator.le, types.int32, _comparison("<="))
_define(operator.gt, types.int32, _comparison(">"))
_define(operator.ge, types.int32, _comparison(">="))


@type_callable(abs)
def _type_abs(context):
    return lambda value: _lanes if value == _lanes else None


@lower_builtin(abs, _lanes)
def _lower_abs(context, builder, signature, args):
    name = f"llvm.fabs.v{LANES}f32"
    function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(_vector, [_vector]), name)
    return builder.call(function, args)


@intrinsic
def prefetch(typing_context, array, row, column):
    """Bring the cache line of `array[row, column]` near."""

    def build(context, builder, signature, args):
        values = context.make_array(signature.args[0])(context, builder, args[0])
        columns = builder.extract_value(values.shape, 1)
        first = builder.gep(values.data, [builder.add(builder.mul(args[1], columns), args[2])])
        pointer, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        function_type = ir.FunctionType(ir.VoidType(), [pointer, number, number, number])
        function = cgutils.get_or_insert_function(builder.module, function_type, "llvm.prefetch.p0")
        builder.call(function, [builder.bitcast(first, pointer), number(0), number(3), number(1)])
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp), build


@intrinsic
def lowest(typing_context, mask):
    """Index of the lowest set bit of a nonzero int32."""

    def build(context, builder, signature, args):
        return builder.cttz(args[0], cgutils.true_bit)

    return types.int32(types.int32), build


@intrinsic
def count(typing_context, mask):
    """Number of set bits of an int32."""
    return types.int32(types.int32), lambda context, builder, signature, args: builder.ctpop(args[0])
