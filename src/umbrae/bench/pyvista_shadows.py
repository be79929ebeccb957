"""How many pixels PyVista's shadows get wrong: `Plotter.enable_shadows`, which is VTK's shadow map."""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from importlib.util import find_spec
from multiprocessing import get_context
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.bench.scenes import SCENES
from umbrae.bench.sweep import Cell, Quantity, Sweep, SweepRecord
from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.console import one_line
from umbrae.errors import GraphicsError, UmbraeError
from umbrae.light import Light
from umbrae.methods import make_method
from umbrae.sampling import sample
from umbrae.scene import Scene

SIZES = ((768, 768), (1024, 768))
NAMES = ("spheres-96k", "pavilion")
WRONG = Quantity("wrong", "% wrong", 1e4, ("wrong_ppm",))
CUTS = np.arange(0.05, 1.0, 0.05)
"""Shares of the light below which a pixel counts as dark: VTK's shadows are not black."""

NOTE = (
    "Pixels that are dark in one and lit in the other, of those that both see, against frustum's exact mask. The light "
    "is parallel, for VTK has no maps for all directions. PyVista's shadows are soft: a pixel is dark below that share "
    "of its light that suits PyVista best, found anew for each picture."
)

Image = NDArray[np.uint8]


def run_pyvista(names: Sequence[str], sizes: Sequence[tuple[int, int]], clock: Clock) -> SweepRecord:
    """Pictures by PyVista, and shadow maps of Umbrae's, held against exact shadows."""
    columns = [(name, size) for name in names for size in sizes]
    cells: list[Cell] = []
    titles = []
    for name, (width, height) in columns:
        title = f"{name} {width}x{height}"
        titles.append(title)
        with clock.span(title):
            cells += _measure(SCENES[name].load(None), name, title, width, height)
    title = "Wrong pixels of PyVista's shadows"
    sweep = Sweep("pyvista", title, "beside exact ones", "scene", tuple(titles), "", note=NOTE, quantities=(WRONG,))
    return SweepRecord.of(sweep, cells)


def _measure(scene: Scene, name: str, title: str, width: int, height: int) -> list[Cell]:
    camera, light = SCENES[name].camera(scene, width, height), SCENES[name].light(scene, directional=True)
    samples = sample(scene, camera)
    truth = make_method("frustum").prepare(scene).shadow(light, samples).in_shadow
    cells = []
    try:
        found, seen = pyvista_mask(scene, camera, light, truth, samples.covered)
        cells.append(_cell("pyvista", title, found[seen] != truth[seen]))
    except GraphicsError as error:
        cells.append(Cell("pyvista", title, "none", not_run=str(error)))
    try:
        mask = make_method("shadow-map").prepare(scene).shadow(light, samples)
        cells.append(_cell("shadow-map", title, (mask.in_shadow != truth)[samples.covered]))
    except UmbraeError as error:
        cells.append(Cell("shadow-map", title, "none", not_run=str(error)))
    return cells


def _cell(row: str, title: str, wrong: NDArray[np.bool_]) -> Cell:
    counters = {"wrong_ppm": round(1e6 * float(wrong.mean()))}
    return Cell(row, title, "none", (), counters, wrong.size, int(np.count_nonzero(wrong)))


def pyvista_mask(
    scene: Scene, camera: Camera, light: Light, truth: NDArray[np.bool_], covered: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """`(h, w)` what is dark in PyVista's picture at the cut nearest to the truth, and what both see.

    Raises `GraphicsError` where PyVista is not installed or has no picture.
    """
    if find_spec("pyvista") is None:
        raise GraphicsError("pyvista is not installed: pip install 'umbrae[pyvista]'")
    if not light.is_directional:
        raise GraphicsError("pyvista's shadows want a parallel light")
    try:
        # VTK ends the display that our own context lives on, and may end the process where it finds no driver.
        with ProcessPoolExecutor(1, get_context("spawn")) as apart:
            lit, shadowed = apart.submit(
                _pictures, scene.positions, scene.triangles, camera, light.position[:3]
            ).result()
    except (ImportError, RuntimeError, ValueError, AttributeError) as error:
        raise GraphicsError(f"pyvista draws nothing: {one_line(str(error))}") from error
    return darkest_fit(lit, shadowed, truth, covered)


def darkest_fit(
    lit: Image, shadowed: Image, truth: NDArray[np.bool_], covered: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """What is dark and what is seen, of pictures `(h, w, 3)` without shadows and with, of white things before blue."""
    background = (lit == (0, 0, 255)).all(axis=-1)
    seen = covered & ~background
    if not seen.any():
        raise GraphicsError("pyvista's picture shows nothing of the scene")
    without, with_shadows = (picture[..., 0].astype(np.float64) for picture in (lit, shadowed))
    fits = [with_shadows <= cut * without for cut in CUTS]
    return min(fits, key=lambda dark: int(np.count_nonzero((dark != truth)[seen]))), seen


def _pictures(
    positions: NDArray[np.float32], triangles: NDArray[np.int32], camera: Camera, towards: NDArray[np.float32]
) -> tuple[Image, Image]:
    """PyVista's pictures without shadows and with: everything white, the light alone."""
    import pyvista

    pyvista.vtk_verbosity("off")  # VTK looks for a screen first, and complains
    faces = np.concatenate([np.full((len(triangles), 1), 3), triangles], axis=1)
    mesh = pyvista.PolyData(np.array(positions), faces.ravel())
    low, high = positions.min(axis=0).astype(np.float64), positions.max(axis=0).astype(np.float64)
    middle, farthest = (low + high) / 2, float(((positions - camera.eye) @ camera.axes[2]).max())
    away = 2.0 * float((high - low).max()) * towards.astype(np.float64) / np.linalg.norm(towards)
    white = {"color": "white", "ambient": 0.0, "diffuse": 1.0, "specular": 0.0}
    made: list[Image] = []
    for shadows in (False, True):
        plotter: Any = pyvista.Plotter(off_screen=True, window_size=(camera.width, camera.height), lighting="none")
        plotter.add_mesh(mesh, smooth_shading=False, **white)
        plotter.set_background("blue")
        plotter.disable_anti_aliasing()
        plotter.add_light(pyvista.Light(position=middle + away, focal_point=middle, color="white"))
        if shadows:
            plotter.enable_shadows()
        view = plotter.camera
        view.position, view.focal_point, view.up = camera.eye, camera.eye + camera.axes[2], camera.axes[1]
        view.view_angle, view.clipping_range = camera.fov_y, (camera.near, 1.01 * farthest)
        made.append(np.array(plotter.screenshot(return_img=True)[..., :3]))
        plotter.close()
    return made[0], made[1]
