"""Smooth outlines of coarse meshes: what the camera would see of the curved surface, as samples of the mesh itself."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.checks import instance, whole
from umbrae.clock import Clock
from umbrae.errors import InputError, OptionError
from umbrae.geometry.hermite import MOST_PIECES
from umbrae.geometry.tessellation import tessellate
from umbrae.memory import require
from umbrae.parallel import kernel, run
from umbrae.samples import ViewSamples
from umbrae.sampling.coverage import held_by_sample
from umbrae.sampling.cpu import sample
from umbrae.sampling.seen import put_point
from umbrae.scene import Scene
from umbrae.transmission import transmission_of

_BYTES_PER_TRIANGLE = 80
"""Of each small one, with its share of points, and their projection."""
_SAMPLES_PER_TASK = 65536


def sample_tessellated(
    scene: Scene, camera: Camera, level: int, samples_per_pixel: int = 1, clock: Clock | None = None
) -> ViewSamples:
    """What the camera sees of the scene's triangles, each cut into `level`^2 on a curved surface (Phong tessellation).

    Only what is seen where comes from the curved surface. Samples are those of the scene, at the same barycentrics of
    the triangle that was cut and on the same side, so shadows and shading are as ever, up to a smooth outline
    (Mattausch et al. 2012, Figure 7c). They do not lie on the rays of their pixels, and have no `depth`: methods that
    rasterize the picture anew refuse them.

    Raises
    ------
    InputError
        For a scene that lets light through.
    OptionError
        For a level that is not a whole number of 1 to 64, or what `sample` refuses.
    CapacityError
        When the small triangles would not fit into memory.
    """
    instance(scene, Scene, "scene")
    check_level(level)
    if transmission_of(scene) is not None:
        raise InputError(
            "smooth outlines: wanted a scene of solid surfaces, but some let light through: "
            "take all as solid (Scene.opaque(), --opaque)"
        )
    require(
        len(scene.triangles) * level * level * _BYTES_PER_TRIANGLE,
        f"{len(scene.triangles)} triangles, cut into {level * level} each,",
    )
    fine = tessellate(scene.positions, scene.triangles, scene.normals, level)
    seen = sample(Scene(fine.positions, fine.triangles), camera, samples_per_pixel, clock)
    flat = seen.triangle.reshape(-1), seen.barycentric.reshape(-1, 2), seen.position.reshape(-1, 3)
    mesh = scene.positions, scene.triangles

    def task(i: int) -> None:
        rows = i * _SAMPLES_PER_TASK, min((i + 1) * _SAMPLES_PER_TASK, seen.size)
        put_on_mesh(*mesh, fine.source, fine.place, fine.corners, *rows, *flat)

    run(task, -(-seen.size // _SAMPLES_PER_TASK))
    return replace(seen, depth=None)


def check_level(level: int) -> None:
    """Refuse anything but a whole number of 1 to 64."""
    if not 1 <= whole(level, "smooth outlines") <= MOST_PIECES:
        raise OptionError(f"smooth outlines: wanted a level of 1 to {MOST_PIECES}, got {level}")


@kernel
def put_on_mesh(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    source: NDArray[np.int32],
    place: NDArray[np.int32],
    corners: NDArray[np.float64],
    start: int,
    stop: int,
    triangle: NDArray[np.int32],
    barycentric: NDArray[np.float32],
    position: NDArray[np.float32],
) -> None:
    """Turn samples `start` to `stop` on small triangles into samples on those that they are parts of, in place."""
    for at in range(start, stop):
        small = triangle[at]
        if small < 0:
            continue
        t, part = source[small], place[small]
        b, c = np.float64(barycentric[at, 0]), np.float64(barycentric[at, 1])
        a = 1.0 - b - c
        u, v = held_by_sample(
            a * corners[part, 0, 0] + b * corners[part, 1, 0] + c * corners[part, 2, 0],
            a * corners[part, 0, 1] + b * corners[part, 1, 1] + c * corners[part, 2, 1],
        )
        triangle[at], barycentric[at, 0], barycentric[at, 1] = t, u, v
        put_point(positions, triangles, t, u, v, position, at)
