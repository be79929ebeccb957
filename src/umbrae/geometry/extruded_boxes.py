"""Boxes extruded away from a light: what any shadow of their content lies in."""

import numpy as np
from numpy.typing import NDArray

from umbrae.parallel import inline, kernel

OUTSIDE, AROUND, INSIDE = 0, 1, 2
"""An extruded box lies outside of the picture; around the eye or about the light; somewhere in the picture."""


def place_boxes(
    lower: NDArray[np.float32],
    upper: NDArray[np.float32],
    light: NDArray[np.float64],
    eye: NDArray[np.float64],
    world_to_clip: NDArray[np.float64],
    far_plane: NDArray[np.float64],
    slack: float,
    margin: tuple[float, float],
) -> tuple[NDArray[np.int8], NDArray[np.float64], NDArray[np.float64]]:
    """Where boxes, extruded away from a light, lie in a picture.

    Parameters
    ----------
    lower, upper
        `(n, 3)` corners of boxes that are not empty.
    light, eye, world_to_clip
        `(4,)` homogeneous with w exactly 0 or 1, `(3,)`, `(3, 4)` as `Camera.world_to_clip`.
    far_plane
        `(4,)` where extruded boxes end, `n . p = w`; zeros: at infinity.
    slack
        How far out of the picture a box must lie, as a share of it.
    margin
        By how much boxes are widened: a length, and one for each unit of spread, the ends' distance from the light
        over that of an edge of the box (2 for a light infinitely far away).

    Returns
    -------
    `(n,)` `OUTSIDE`, `AROUND` or `INSIDE`, and `(n, 3)` corners of the widened boxes. An eye around which a box
    reaches keeps the margin once more; a light is about a box that is nearer than four margins.
    """
    place = np.empty(len(lower), np.int8)
    low, high = lower.astype(np.float64), upper.astype(np.float64)
    place_each(low, high, light, eye, world_to_clip, far_plane, slack, *margin, place)
    return place, low, high


@kernel
def place_each(lower, upper, light, eye, world_to_clip, far_plane, slack, margin, per_spread, place):
    """Fill `place`, and widen the boxes."""
    for i in range(len(lower)):
        wide = margin + 2.0 * per_spread
        apart = np.inf
        if light[3] != 0.0:
            gap, size = 0.0, 0.0
            for axis in range(3):
                beside = max(lower[i, axis] - light[axis], light[axis] - upper[i, axis], 0.0)
                gap += beside * beside
                size += (upper[i, axis] - lower[i, axis]) ** 2
            apart = np.sqrt(gap)
            # Both ends of an edge within size + apart; the widened box is not nearer than half of that.
            wide = margin + per_spread * 4.0 * (np.sqrt(size) + apart) / apart if apart > 0.0 else np.inf
        if not apart > 4.0 * wide:
            place[i] = AROUND
            continue
        for axis in range(3):
            lower[i, axis] -= wide
            upper[i, axis] += wide
        if shades_eye(lower, upper, i, wide, light, eye):
            place[i] = AROUND
        elif leaves_picture(lower, upper, i, light, world_to_clip, far_plane, slack):
            place[i] = OUTSIDE
        else:
            place[i] = INSIDE


@inline
def shades_eye(lower, upper, i, wide, light, eye):
    """Whether the way from the eye to the light meets box i, widened."""
    start, stop = 0.0, (1.0 if light[3] != 0.0 else np.inf)
    for axis in range(3):
        step = light[axis] - light[3] * eye[axis]
        low, high = lower[i, axis] - wide - eye[axis], upper[i, axis] + wide - eye[axis]
        if step == 0.0:
            if low > 0.0 or high < 0.0:
                return False
        else:
            enter, leave = (low / step, high / step) if step > 0.0 else (high / step, low / step)
            start, stop = max(start, enter), min(stop, leave)
    return start <= stop


@inline
def leaves_picture(lower, upper, i, light, world_to_clip, far_plane, slack):
    """Whether box i and its far end lie beyond one and the same side of the picture."""
    m = world_to_clip
    left, right, below, above, behind = True, True, True, True, True
    endless = far_plane[0] == 0.0 and far_plane[1] == 0.0 and far_plane[2] == 0.0
    for k in range(16):
        x = upper[i, 0] if k & 1 else lower[i, 0]
        y = upper[i, 1] if k & 2 else lower[i, 1]
        z = upper[i, 2] if k & 4 else lower[i, 2]
        h = 1.0
        if k & 8:
            ax, ay, az = light[3] * x - light[0], light[3] * y - light[1], light[3] * z - light[2]
            if endless:
                x, y, z, h = ax, ay, az, 0.0
            else:
                n = far_plane
                far = (n[3] - n[0] * x - n[1] * y - n[2] * z) / (n[0] * ax + n[1] * ay + n[2] * az)
                x, y, z = x + far * ax, y + far * ay, z + far * az
        clip_x = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3] * h
        clip_y = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3] * h
        w = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3] * h
        room = slack * (abs(clip_x) + abs(clip_y) + abs(w))
        left = left and clip_x + w < -room
        right = right and w - clip_x < -room
        below = below and clip_y + w < -room
        above = above and w - clip_y < -room
        behind = behind and w < -room
    return left or right or below or above or behind
