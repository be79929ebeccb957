"""Coordinates in which shadow frusta stand upright: the light's own normalized device coordinates.

A *light frame* maps space to (x, y, q). Two samples on one ray from the light have the same x and y, and q grows
towards the light, so a shadow frustum is a triangle in x and y, and below a plane in q. All four of its planes are
linear there, just as they are in the camera's clip space.

With the major axis c, the other two axes a, b and the sign g of the light's side:

    point light, P' = P - l, in the pyramid where Z = g P'_c is the largest component:   x = P'_a / Z, q = 1 / Z
    directional light with |l_c| largest:              x = P_a - (l_a / l_c) P_c,        q = g P_c

A point light has up to six such frames, the faces of a cube around it; a directional light has one. Each is scaled
and moved to a window: (x - x0) / hx and so on lie in [-1, 1] over the scene, so that float32 spends its digits there.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

POSITION_ERROR = 2.0**-23
"""Samples' float32 positions against the exact points, relative to the largest coordinate (one rounding is 2**-24)."""


def surface_error(bounds: NDArray[np.float64]) -> float:
    """What else a position on a triangle within `bounds (2, 3)` may be off by, in world units.

    A + u (B - A) + v (C - A) is evaluated in float64 with up to 6 roundings of 2**-53 of the vertices' largest
    coordinate, however small the result; and below 2**-126 rounding to float32 costs up to 2**-150, of anything.
    """
    return 2.0**-50 * float(np.abs(bounds).max()) + 2.0**-149


WIDEST = 4.0
"""Largest |x| and |y| of a point light's only frame."""


class LightFrame(NamedTuple):
    """One frame as plain numbers, for kernels.

    `slope_a`, `slope_b` are l_a / l_c, l_b / l_c of a directional light, else 0; `x0 … hq` are the window.
    """

    axis_a: int
    axis_b: int
    axis_c: int
    sign: float
    slope_a: float
    slope_b: float
    x0: float
    y0: float
    q0: float
    hx: float
    hy: float
    hq: float

    def row(self) -> tuple[float, ...]:
        """What `sample_clusters` needs, in the order of `AXIS_C ... SCALE_Q`."""
        place = (self.axis_c, self.sign, self.slope_a, self.slope_b, self.x0, self.y0, self.q0)
        return (*place, 1.0 / self.hx, 1.0 / self.hy, 1.0 / self.hq)


AXIS_C, SIGN, SLOPE_A, SLOPE_B, X0, Y0, Q0, SCALE_X, SCALE_Y, SCALE_Q = range(10)


def light_frames(light: NDArray[np.float64], bounds: NDArray[np.float64], error: float) -> list[LightFrame]:
    """The frames of a light `(4,)` over a box `(2, 3)` that holds all samples: one, or six for a point light.

    A point light too has a single frame when the box lies before it so that x and y stay below `WIDEST` and every
    sample is much farther from the light's plane than the `error` of its position.
    """
    corners = np.array([[bounds[i, 0], bounds[j, 1], bounds[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    if light[3] == 0.0:
        c = int(np.argmax(np.abs(light[:3])))
        a, b = (c + 1) % 3, (c + 2) % 3
        slope_a, slope_b = float(light[a] / light[c]), float(light[b] / light[c])
        sign = float(np.sign(light[c]))
        x, y = corners[:, a] - slope_a * corners[:, c], corners[:, b] - slope_b * corners[:, c]
        window = zip(*(_window(values) for values in (x, y, sign * corners[:, c])), strict=True)
        return [LightFrame(a, b, c, sign, slope_a, slope_b, *next(window), *next(window))]
    relative = corners - light[:3]
    faces = [(c, sign) for c in range(3) for sign in (1.0, -1.0)]
    nearest = [float((sign * relative[:, c]).min()) for c, sign in faces]
    best = int(np.argmax(nearest))
    reach = float(np.abs(relative).max())
    if nearest[best] > max(4096.0 * (error + 2.0**-50 * reach), reach / WIDEST):
        faces = [faces[best]]
    return [_face(relative, c, sign, WIDEST if len(faces) == 1 else 1.0) for c, sign in faces]


def _face(relative: NDArray[np.float64], c: int, sign: float, widest: float) -> LightFrame:
    """A point light's frame along an axis for samples within corners `relative (8, 3)` and |x|, |y| <= `widest`."""
    a, b = (c + 1) % 3, (c + 2) % 3
    z = sign * relative[:, c]
    x0 = y0 = q0 = 0.0
    hx = hy = 1.0
    hq = 1.0 / (float(np.abs(relative).max()) or 1.0)
    if z.min() > 0.0:
        x0, hx = _window(np.clip(relative[:, a] / z, -widest, widest))
        y0, hy = _window(np.clip(relative[:, b] / z, -widest, widest))
        hq = 1.0 / float(z.min())
        # A shift would waste float32's digits where q spans orders of magnitude.
        if z.max() < 4.0 * z.min():
            q0, hq = _window(1.0 / z)
    return LightFrame(a, b, c, sign, 0.0, 0.0, x0, y0, q0, hx, hy, hq)


def _window(values: NDArray[np.float64]) -> tuple[float, float]:
    """Centre and half-width of an interval, a little wider than needed and never empty."""
    low, high = float(values.min()), float(values.max())
    half = (high - low) / 2 + 1e-6 * max(abs(low), abs(high))
    return (low + high) / 2, half or 1.0
