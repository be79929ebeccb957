"""Primary visibility by OpenGL: the rasterizer proposes a triangle for each sample, the CPU says where on it.

How far OpenGL may be off. Vertices are moved to the driver's subpixel grid, mostly of 1/256 pixel: by less than one
step in all, and their edges with them. Before that they are computed in float32, with rounding errors up to 2**-19 of
their distance from the eye (two for the position relative to the eye, six to project it, three to clip, each of
2**-24, over three axes). In a triangle of which no point is nearer along the view direction than 1/64 of the distance
of its farthest corner, no picture of a point moves by more than 2**-13 of that of a unit at distance 1: an eighth of a
pixel where a field of view of 50 degrees has 1000 rows, and in general far less, since errors cancel.

All other triangles, and those that the near plane cuts, are drawn by the CPU as well, exactly. So are those that the
rasterizer claims to see where they are not, which is checked for every sample; OpenGL then draws once more without
them.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.gl.context import Session, session
from umbrae.gl.program import apply, program
from umbrae.gl.queries import stage
from umbrae.gl.state import see_nearest
from umbrae.gl.targets import id_target
from umbrae.parallel import kernel, run
from umbrae.projection import camera_uniforms, unit_scale
from umbrae.samples import ViewSamples
from umbrae.sampling.bands import Picture, project
from umbrae.sampling.drawing import Floor, draw, place
from umbrae.sampling.groups import View, groups_of, view
from umbrae.sampling.holes import NOWHERE, surface_of
from umbrae.sampling.seen import Seen, picture_of, resolve, rows_per_band
from umbrae.scene import Scene

_SHADER = Path(__file__).with_suffix(".glsl")
_DEEP = 64.0
_TOLERANCE = 0.25
"""Pixels beside a triangle that the rasterizer may be off: twice the bound above."""
_CHUNK = 1 << 15


def sample_gl(scene: Scene, camera: Camera, samples_per_pixel: int = 1, clock: Clock | None = None) -> ViewSamples:
    """What `sample` finds, with OpenGL to choose the triangles.

    Wherever it chooses the same triangle, everything is bitwise the same. It may choose another where its rounding
    decides: at samples within about 1/256 pixel of an edge, which are then brought onto the triangle, and between
    triangles that are nearer to each other than the rounding of depth, coincident ones among them.

    Surfaces with alpha mode MASK or BLEND are drawn as `sample` draws them, over what OpenGL found of the others: their
    holes and edges are exact, and cost what they cost there. Where one adjoins an opaque surface, rounding may open
    the joint between them.

    Parameters
    ----------
    samples_per_pixel
        As for `sample`, at the same places.
    clock
        Hears the stages "rasterize" and "resolve", and how far the work has come.

    Raises
    ------
    GraphicsError
        Without OpenGL 4.5, or for a picture that is too large for its driver.
    OptionError
        When `samples_per_pixel` is not a whole number from 1.
    CapacityError
        When the result would not fit into memory.
    """
    picture = picture_of(scene, camera, samples_per_pixel)
    clock = clock or Clock()
    current = session()
    geometry, surface = project(scene, camera), surface_of(scene)
    masked = surface.holes != NOWHERE
    proposed, exact = ~masked, masked | _too_deep(scene, camera)
    refused = np.zeros(len(scene.triangles), bool)
    band_rows = rows_per_band(picture)
    seen, floor = Seen.of(picture), Floor.before_all(picture)
    while True:
        with current.current(), stage(current, clock, "rasterize"):
            _rasterize(current, scene, camera, picture, proposed, seen.triangle)
        with clock.span("resolve"):
            shown = view(groups_of(scene), geometry, picture, exact)

            def band(index: int, shown: View = shown, exact: NDArray[np.bool_] = exact) -> None:
                top, bottom = index * band_rows, min((index + 1) * band_rows, picture.height)
                part = seen.rows(picture, top, bottom)
                nearest = np.empty(len(part.depth))
                place(geometry, picture, top, bottom, _TOLERANCE, nearest, part.triangle, part.side, refused)
                draw(geometry, shown, exact, picture, surface, top, bottom, floor, nearest, part.triangle, part.side)
                resolve(geometry, picture, top, bottom, part.triangle, part.barycentric, part.position)
                part.depth[:] = nearest

            run(band, -(-picture.height // band_rows), clock)
        if not refused.any():
            return seen.samples(scene, camera)
        proposed &= ~refused
        exact |= refused
        refused[:] = False


def _too_deep(scene: Scene, camera: Camera) -> NDArray[np.bool_]:
    """`(t,)` which triangles the near plane cuts, or reach too far from the eye for how near they come."""
    too_deep = np.empty(len(scene.triangles), bool)
    chunks = range(0, len(too_deep), _CHUNK)

    def task(index: int) -> None:
        part = slice(chunks[index], chunks[index] + _CHUNK)
        _reach(scene.positions, scene.triangles[part], camera.eye, camera.axes[2], camera.near, too_deep[part])

    run(task, len(chunks))
    return too_deep


@kernel
def _reach(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    eye: NDArray[np.float64],
    forward: NDArray[np.float64],
    near: float,
    too_deep: NDArray[np.bool_],
) -> None:
    for t in range(len(triangles)):
        least, most = np.inf, 0.0
        for corner in range(3):
            along, square = 0.0, 0.0
            for axis in range(3):
                d = positions[triangles[t, corner], axis] - eye[axis]
                along += forward[axis] * d
                square += d * d
            least, most = min(least, along), max(most, square)
        too_deep[t] = least < near or most > (_DEEP * least) ** 2


def _rasterize(
    current: Session,
    scene: Scene,
    camera: Camera,
    picture: Picture,
    proposed: NDArray[np.bool_],
    triangle: NDArray[np.int32],
) -> None:
    """Write the nearest of the `proposed` triangles `(t,)` at every sample to the flat `triangle`, -1 for none."""
    per_pixel, scale = len(picture.x), unit_scale(scene)
    found = triangle.reshape(picture.height, picture.width, per_pixel)
    chosen = np.flatnonzero(proposed).astype(np.int32)
    if not len(chosen):
        found[:] = -1
        return
    context: Any = current.moderngl
    shader = program(current, _SHADER)
    vertices = context.buffer((scene.positions * np.float32(scale)).tobytes())
    index = context.buffer(scene.triangles[chosen].tobytes())
    array = context.vertex_array(shader, [(vertices, "3f", "position")], index)
    target = id_target(current, picture.width, picture.height)
    numbers = np.append(chosen, np.int32(-1))  # the last one is that of number -1, background
    for sample in range(per_pixel):
        target.clear()
        see_nearest(current, target)
        apply(shader, camera_uniforms(camera, scale, sample, per_pixel))
        array.render(context.TRIANGLES)
        found[..., sample] = numbers[target.read()]
