"""The picture: diffuse shading of view samples with their shadow masks."""

import math
from collections.abc import Sequence
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.errors import InputError
from umbrae.geometry.diffuse import Lighting, Surface, View, shade_rows
from umbrae.geometry.mipmap import mip_levels
from umbrae.geometry.normals import first_alike, terminator_fade
from umbrae.geometry.texture import pack
from umbrae.light import Light
from umbrae.mask import ShadowMask
from umbrae.parallel import run
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

_ROWS_PER_TASK = 16


def shade(
    scene: Scene,
    camera: Camera,
    lights: Sequence[Light],
    samples: ViewSamples,
    masks: Sequence[ShadowMask],
    up: Sequence[float] | NDArray[np.floating] = (0.0, 1.0, 0.0),
    clock: Clock | None = None,
) -> NDArray[np.uint8]:
    """Make the picture: base colour times direct light where the mask lets it through, plus ambient light.

    Light is linear until the end. Several samples per pixel are averaged after tone mapping and before the
    sRGB transfer, so that an edge against a bright surface stays smooth. Lights whose intensities add up to
    more than one are scaled down together.

    Parameters
    ----------
    samples
        Of an image, `(h, w)` or `(h, w, s)`, as seen by `camera`.
    masks
        One per light, in the same order.
    up
        World up: the sky is there.

    Returns
    -------
    NDArray
        `(h, w, 3) uint8`, sRGB.

    Raises
    ------
    InputError
        When samples, masks, lights and camera do not belong together.
    """
    lights, masks = tuple(lights), tuple(masks)
    _check(camera, lights, samples, masks)
    height, width = camera.height, camera.width
    per_pixel = samples.size // (height * width)
    view = _view(camera, samples, per_pixel, up)
    surface = _surface(scene)
    lighting = _lighting(surface, lights, masks, view.triangle.shape)
    pixels = np.empty((height, width, 3), np.uint8)

    def band(index: int) -> None:
        first = index * _ROWS_PER_TASK
        shade_rows(first, min(first + _ROWS_PER_TASK, height), surface, view, lighting, pixels)

    run(band, -(-height // _ROWS_PER_TASK), clock)
    return pixels


def up_axis(up: Sequence[float] | NDArray[np.floating]) -> NDArray[np.float64]:
    """World up as a unit vector `(3,)`; an `InputError` if it is none."""
    axis = np.asarray(up, np.float64)
    length = float(np.linalg.norm(axis)) if axis.shape == (3,) else math.nan
    if not 0.0 < length < math.inf:
        raise InputError(f"up: wanted 3 finite numbers, not all zero, got {up}")
    direction: NDArray[np.float64] = axis / length
    return direction


def mask_image(mask: ShadowMask) -> NDArray[np.uint8]:
    """A shadow mask as a grey picture `(h, w) uint8`: 255 lit, 0 dark, averaged over a pixel's samples."""
    dark = mask.in_shadow
    if dark.ndim not in (2, 3):
        raise InputError(f"mask_image: wanted the mask of an image, (h, w) or (h, w, s), got {dark.shape}")
    samples = dark.reshape(*dark.shape[:2], -1)
    lit = samples.shape[2] - np.count_nonzero(samples, axis=2)
    grey: NDArray[np.uint8] = np.round(lit * (255 / max(1, samples.shape[2]))).astype(np.uint8)
    return grey


def _check(camera: Camera, lights: tuple[Light, ...], samples: ViewSamples, masks: tuple[ShadowMask, ...]) -> None:
    size = (camera.height, camera.width)
    if len(samples.shape) not in (2, 3) or samples.shape[:2] != size or samples.size == 0:
        raise InputError(f"shade: wanted samples of the camera's image, {size} or {(*size, 's')}, got {samples.shape}")
    if len(masks) != len(lights):
        raise InputError(f"shade: wanted one mask per light, got {len(masks)} masks and {len(lights)} lights")
    for number, mask in enumerate(masks):
        if mask.in_shadow.shape != samples.shape:
            raise InputError(f"shade: mask {number} has shape {mask.in_shadow.shape}, the samples {samples.shape}")


# Textures are prepared once per scene, not once per picture.
_SURFACES: WeakKeyDictionary[Scene, Surface] = WeakKeyDictionary()


def _surface(scene: Scene) -> Surface:
    if scene not in _SURFACES:
        _SURFACES[scene] = _prepare_surface(scene)
    return _SURFACES[scene]


def _prepare_surface(scene: Scene) -> Surface:
    def rows(values: NDArray[np.float32] | None, width: int) -> NDArray[np.float32]:
        return _read_only(np.zeros((0, width), np.float32)) if values is None else values

    normals = rows(scene.normals, 3)
    # Materials often share a texture: its levels are made once, and `pack` stores one array once.
    wanted = {}
    for material in scene.materials:
        if material.texture is not None and scene.uv is not None:
            wanted[id(material.texture), material.alpha_mode == "OPAQUE"] = material.texture
    keys = list(wanted)
    made = dict(zip(keys, run(lambda index: mip_levels(wanted[keys[index]], keys[index][1]), len(keys)), strict=True))
    chains = [made.get((id(material.texture), material.alpha_mode == "OPAQUE"), []) for material in scene.materials]
    levels = np.array([len(chain) for chain in chains], np.int64)
    textures = pack([level for chain in chains for level in chain])
    return Surface(
        scene.positions,
        scene.triangles,
        normals,
        first_alike(scene.positions, normals) if len(normals) else np.zeros(0, np.int32),
        rows(scene.colors, 4),
        rows(scene.uv, 2),
        _read_only(scene.material_id),
        np.array([material.base_color[:3] for material in scene.materials], np.float64),
        textures.texels,
        textures.offset,
        textures.size,
        np.cumsum(levels) - levels,
        levels,
    )


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    """A view that cannot be written to, like the scene's arrays: to Numba that is part of the type."""
    view = array.view()
    view.flags.writeable = False
    return view


def _view(camera: Camera, samples: ViewSamples, per_pixel: int, up: Sequence[float] | NDArray[np.floating]) -> View:
    shape = (camera.height, camera.width, per_pixel)
    right, upward, forward = camera.axes
    tan_y = math.tan(math.radians(camera.fov_y) / 2)
    tan_x = tan_y * camera.width / camera.height
    step = 2 * tan_y / camera.height
    return View(
        np.array(samples.triangle, order="C", copy=None).reshape(shape),
        np.array(samples.barycentric, order="C", copy=None).reshape(*shape, 2),
        np.array(samples.side, order="C", copy=None).reshape(shape),
        np.array(samples.position, order="C", copy=None).reshape(*shape, 3),
        np.array(samples.covered, order="C", copy=None).reshape(shape),
        np.stack(
            [
                camera.eye,
                forward,
                forward - tan_x * right + tan_y * upward,
                step * right,
                -step * upward,
                up_axis(up),
            ]
        ),
    )


def _lighting(
    surface: Surface, lights: tuple[Light, ...], masks: tuple[ShadowMask, ...], shape: tuple[int, ...]
) -> Lighting:
    position = np.array([light.position for light in lights], np.float64).reshape(-1, 4)
    radiance = np.array([light.color for light in lights], np.float64).reshape(-1, 3)
    with np.errstate(over="ignore"):
        radiance *= np.array([light.intensity for light in lights], np.float64).reshape(-1, 1)
    if not np.isfinite(radiance).all():
        raise InputError("shade: wanted lights whose colour times intensity is finite")
    exposure = 1.0 / max(1.0, float(radiance.max(axis=1, initial=0.0).sum()))
    in_shadow = np.zeros((len(lights), *shape), bool)
    for index, mask in enumerate(masks):
        in_shadow[index] = mask.in_shadow.reshape(shape)
    fade = np.empty((len(lights), len(surface.normals), 2), np.float32)
    if len(surface.normals):
        run(lambda index: terminator_fade(*surface[:4], position, index, fade), len(lights))
    return Lighting(position, radiance * exposure, in_shadow, fade)
