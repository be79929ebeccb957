"""Samples as shaders have them: 16 bytes each (`gl/include/samples.glsl`)."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from umbrae.memory import keep_spare, take_spare
from umbrae.methods.frustum_gl.layout import PLACE_BYTES
from umbrae.parallel import kernel, run
from umbrae.samples import ViewSamples

BACKGROUND, FREE = np.int32(-1), np.int32(-2)
"""In place of a sample's own triangle, as in `gl/include/samples.glsl`."""

_CHUNK = 1 << 16
_SPARE = "packed samples"

Sent = TypeVar("Sent")


def with_packed(samples: ViewSamples, send: Callable[[NDArray[np.int32]], Sent]) -> Sent:
    """What `send` returns of the samples, `(n, 4)`: own triangle, barycentrics and side, or `FREE` and the position.

    The array is used again by the next call.
    """
    count = samples.size
    kept: NDArray[np.int32] | None = take_spare(_SPARE)
    given = kept if kept is not None and len(kept) >= count else np.empty((count, 4), np.int32)
    arrays = (
        samples.triangle.reshape(-1),
        samples.barycentric.reshape(-1, 2),
        samples.side.reshape(-1),
        samples.position.reshape(-1, 3),
        samples.covered.reshape(-1),
    )

    def chunk(index: int) -> None:
        _pack(*arrays, given, given.view(np.float32), index * _CHUNK, min(count, (index + 1) * _CHUNK))

    run(chunk, -(-count // _CHUNK))
    sent = send(given[:count])
    keep_spare(_SPARE, given, PLACE_BYTES * len(given))
    return sent


@kernel
def _pack(
    triangle: Any,
    barycentric: Any,
    side: Any,
    position: Any,
    covered: Any,
    given: Any,
    real: Any,
    start: int,
    stop: int,
) -> None:
    for at in range(start, stop):
        own = triangle[at]
        if not covered[at]:
            given[at, 0] = BACKGROUND
        elif own >= 0:
            given[at, 0] = own
            real[at, 1] = barycentric[at, 0]
            real[at, 2] = barycentric[at, 1]
            given[at, 3] = side[at]
        else:
            given[at, 0] = FREE
            for axis in range(3):
                real[at, 1 + axis] = position[at, axis]
