"""Compilation as a stage of its own, before the work starts."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, wait

import numpy as np

from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.console import ConsoleClock, note
from umbrae.light import Light
from umbrae.material import Material
from umbrae.methods import Method
from umbrae.parallel import kernels_are_cached
from umbrae.render import render
from umbrae.scene import Scene


def compile_kernels(
    methods: Sequence[Method],
    samples_per_pixel: int,
    clock: Clock,
    transparent: bool = False,
    stochastic: int | None = None,
    area: bool = False,
    smooth_outlines: int = 1,
) -> None:
    """Compile what a rendering with these methods needs, or load it from the cache; raises what hinders one of them.

    `transparent` for a scene that lets light through, `stochastic` as for `render`, `area` for a light with a size,
    `smooth_outlines` as for `render`.
    """
    for hindrance in try_out(methods, samples_per_pixel, clock, transparent, stochastic, area, smooth_outlines):
        if hindrance is not None:
            raise hindrance


def try_out(
    methods: Sequence[Method],
    samples_per_pixel: int,
    clock: Clock,
    transparent: bool = False,
    stochastic: int | None = None,
    area: bool = False,
    smooth_outlines: int = 1,
) -> list[Exception | None]:
    """Let each method render next to nothing, which compiles it; returns for each what hinders it, None if nothing.

    In a thread of its own: an interruption that arrives while LLVM calls back into Python is lost.
    """
    with clock.span("compile kernels"):
        pool = ThreadPoolExecutor(1)
        try:
            work = pool.submit(
                lambda: [
                    _hindrance(method, samples_per_pixel, transparent, stochastic, area, smooth_outlines)
                    for method in methods
                ]
            )
            if not wait([work], timeout=3.0).done and isinstance(clock, ConsoleClock):
                note(
                    "first run: compiling takes up to a minute; kernels are cached, later starts are quick"
                    if kernels_are_cached()
                    else "compiling takes up to a minute: no cache can be written (NUMBA_CACHE_DIR can name a folder)"
                )
            return work.result()
        finally:
            pool.shutdown(wait=False)


def _hindrance(
    method: Method, samples_per_pixel: int, transparent: bool, stochastic: int | None, area: bool, smooth_outlines: int
) -> Exception | None:
    """Everything once on next to nothing: smooth normals, a texture, a solid triangle and a mask or glass."""
    corners = [(-1, 0, 1), (1, 0, 1), (0, 0, -1), (-1, 1, 1), (1, 1, 1), (0, 1, -1)]
    texture = np.full((2, 2, 4), 255, np.uint8)
    leaf = Material(alpha_mode="MASK", texture=texture)
    if transparent and "transparency" in method.accepts:
        texture[0, 0] = 128
        leaf = Material(alpha_mode="BLEND", texture=texture, transmission=0.5)
    # The second triangle stands for a surface that turns away from the sun.
    normals, flat = [(0, 1, 0)] * 5 + [(-1, 1, -0.3)], [(0, 0)] * 6
    tiny = Scene(corners, [(0, 1, 2), (3, 4, 5)], [Material(), leaf], [0, 1], normals=normals, uv=flat)
    camera = Camera.frame(tiny, width=16, height=16)
    try:
        sun = Light.sun(120, 20, angular_diameter=0.5 if area else 0.0)
        render(tiny, camera, [sun], method, samples_per_pixel, stochastic=stochastic, smooth_outlines=smooth_outlines)
    except Exception as error:
        return error
    return None
