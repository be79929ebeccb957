"""What callers hand in, checked where it arrives: a wrong type ends in one line, as a wrong value does."""

import math
from collections.abc import Sequence
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.errors import InputError

Vector = Sequence[float] | NDArray[np.floating]


def instance(value: object, kind: type, name: str) -> None:
    """Refuse anything but an object of a kind, such as a tuple where a `Light` belongs."""
    if not isinstance(value, kind):
        raise InputError(f"{name}: wanted {kind.__name__}, got {type(value).__name__}")


def number(value: Any, name: str) -> float:
    """A finite real number, Python's or NumPy's."""
    if not isinstance(value, Real) or not math.isfinite(value):
        raise InputError(f"{name}: wanted a finite number, got {shown(value)}")
    return float(value)


def is_whole(value: Any) -> bool:
    """Whether a value is a whole number, Python's or NumPy's; True and False are none."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def whole(value: Any, name: str) -> int:
    """A whole number, Python's or NumPy's."""
    if not is_whole(value):
        raise InputError(f"{name}: wanted a whole number, got {shown(value)}")
    return int(value)


def vector(values: Any, name: str) -> NDArray[np.float64]:
    """`(3,)` finite numbers as float64."""
    found = array(values, name)
    if found.shape != (3,) or found.dtype.kind not in "iuf" or not np.isfinite(found).all():
        raise InputError(f"{name}: wanted 3 finite numbers, got {shown(values)}")
    return found.astype(np.float64)


def array(values: Any, name: str) -> NDArray[Any]:
    """What `numpy.asarray` makes of it; refuses rows of different lengths."""
    try:
        return np.asarray(values)
    except ValueError as error:
        raise InputError(f"{name}: wanted an array, got rows of different lengths") from error


def shown(value: object) -> str:
    """A value for a message: one line of it, not more than 80 characters."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else f"{text[:77]}..."
