"""The picture: diffuse shading of view samples with their shadow masks, layer by layer."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, cast
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.checks import instance
from umbrae.clock import Clock
from umbrae.errors import InputError
from umbrae.geometry.diffuse import ALONE, BEFORE, CHOSEN, LAST, Lighting, Surface, View, shade_rows, tone_rows
from umbrae.geometry.mipmap import mip_levels
from umbrae.geometry.normals import first_alike, terminator_fade
from umbrae.geometry.texture import pack
from umbrae.light import Light
from umbrae.mask import ShadowMask
from umbrae.parallel import run
from umbrae.samples import ViewSamples
from umbrae.scene import Family, Scene

_ROWS_PER_TASK = 16


def shade(
    scene: Scene,
    camera: Camera,
    lights: Sequence[Light],
    samples: ViewSamples | Sequence[ViewSamples],
    masks: Sequence[ShadowMask] | Sequence[Sequence[ShadowMask]],
    up: Sequence[float] | NDArray[np.floating] = (0.0, 1.0, 0.0),
    clock: Clock | None = None,
) -> NDArray[np.uint8]:
    """Make the picture: base colour times direct light as far as the mask lets it through, plus ambient light.

    Light is linear until the end. Several samples per pixel are averaged after tone mapping and before the
    sRGB transfer, so that an edge against a bright surface stays smooth; samples chosen by chance before both. Lights
    whose intensities add up to more than one are scaled down together.

    Layers are put together front to back: each adds its light, diminished by those before it, and diminishes what lies
    behind by what `umbrae.transmission` says. Of what glass would let through it mirrors a part, after Fresnel: the sky
    is seen in it. What passes all layers meets the background.

    Parameters
    ----------
    samples
        Of an image, `(h, w)` or `(h, w, s)`, as seen by `camera`. One `ViewSamples` is shown as if all its surfaces
        were solid, or as chosen by chance if it has `throughput`; several are layers behind one another.
    masks
        One per light, in the same order; for several layers, such a sequence for each.
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
    lights = tuple(lights)
    layers, masks_of = _layers(samples, masks)
    for seen, shadows in zip(layers, masks_of, strict=True):
        _check(camera, lights, seen, shadows)
    height, width = camera.height, camera.width
    shape = (height, width, layers[0].size // (height * width))
    surface = _surface(scene)
    throughput = layers[0].throughput
    if isinstance(samples, ViewSamples):
        shown = [ALONE if throughput is None else CHOSEN]
    else:
        shown = [BEFORE] * (len(layers) - 1) + [LAST]
    shining = _shining(surface, lights)
    views = [_view(camera, seen, shape, up) for seen in layers]
    lightings = [_lighting(shining, shadows, shape) for shadows in masks_of]
    pixels = np.empty((height, width, 3), np.uint8)

    def band(index: int) -> None:
        first, last = index * _ROWS_PER_TASK, min((index + 1) * _ROWS_PER_TASK, height)
        light = np.zeros((last - first, *shape[1:], 3))
        through = np.ones_like(light)
        if throughput is not None:
            through[:] = throughput.reshape(*shape, 3)[first:last]
        for view, lighting, how in zip(views, lightings, shown, strict=True):
            shade_rows(first, last, surface, view, lighting, how, through, light)
        tone_rows(first, last, shown[0] == CHOSEN, light, pixels)

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
    """A shadow mask as a picture: 255 lit, 0 dark, averaged over a pixel's samples.

    Grey, `(h, w) uint8`, if all light that arrives is; else `(h, w, 3) uint8`. No sRGB transfer: half the light is 128.
    """
    dark = mask.in_shadow
    if dark.ndim not in (2, 3):
        raise InputError(f"mask_image: wanted the mask of an image, (h, w) or (h, w, s), got {dark.shape}")
    if mask.partial is not None:
        shares = mask.partial.reshape(*dark.shape[:2], -1, 3)
        picture: NDArray[np.uint8] = np.round(255 * shares.mean(axis=2, dtype=np.float64)).astype(np.uint8)
        colored = (shares != shares[..., :1]).any()
        return picture if colored else np.ascontiguousarray(picture[..., 0])
    samples = dark.reshape(*dark.shape[:2], -1)
    lit = samples.shape[2] - np.count_nonzero(samples, axis=2)
    grey: NDArray[np.uint8] = np.round(lit * (255 / max(1, samples.shape[2]))).astype(np.uint8)
    return grey


def _layers(
    samples: ViewSamples | Sequence[ViewSamples], masks: Sequence[ShadowMask] | Sequence[Sequence[ShadowMask]]
) -> tuple[tuple[ViewSamples, ...], tuple[tuple[ShadowMask, ...], ...]]:
    """Layers, at least one, and the masks of each."""
    if isinstance(samples, ViewSamples):
        return (samples,), (tuple(cast(Sequence[ShadowMask], masks)),)
    layers = tuple(samples)
    for layer in layers:
        instance(layer, ViewSamples, "shade: layers")
    if not layers or len(masks) != len(layers):
        raise InputError(f"shade: wanted layers and the masks of each, got {len(layers)} layers and {len(masks)} lists")
    if any(layer.shape != layers[0].shape or layer.throughput is not None for layer in layers):
        raise InputError("shade: wanted layers of one shape, as sample_layers gives them")
    return layers, tuple(tuple(each) for each in cast(Sequence[Sequence[ShadowMask]], masks))


def _check(camera: Camera, lights: tuple[Light, ...], samples: ViewSamples, masks: tuple[ShadowMask, ...]) -> None:
    size = (camera.height, camera.width)
    if len(samples.shape) not in (2, 3) or samples.shape[:2] != size or samples.size == 0:
        raise InputError(f"shade: wanted samples of the camera's image, {size} or {(*size, 's')}, got {samples.shape}")
    if len(masks) != len(lights):
        raise InputError(f"shade: wanted one mask per light, got {len(masks)} masks and {len(lights)} lights")
    for number, mask in enumerate(masks):
        if mask.in_shadow.shape != samples.shape:
            raise InputError(f"shade: mask {number} has shape {mask.in_shadow.shape}, the samples {samples.shape}")
        if mask.partial is not None and mask.partial.shape != (*samples.shape, 3):
            wanted = (*samples.shape, 3)
            raise InputError(f"shade: mask {number} has shares of shape {mask.partial.shape}, wanted {wanted}")


# Textures are prepared once per scene, wherever it is moved, not once per picture.
_SURFACES: WeakKeyDictionary[Family, Surface] = WeakKeyDictionary()


def _surface(scene: Scene) -> Surface:
    kept = _SURFACES.get(scene.family)
    if kept is None:
        kept = _prepare_surface(scene)
    elif kept.positions is not scene.positions:
        kept = kept._replace(**_placed(scene))
    _SURFACES[scene.family] = kept
    return kept


def _placed(scene: Scene) -> dict[str, NDArray[Any]]:
    """What of a surface moves with the scene's vertices."""
    normals = _rows(scene.normals, 3)
    first = first_alike(scene.positions, normals) if len(normals) else np.zeros(0, np.int32)
    return {"positions": scene.positions, "normals": normals, "first": first}


def _rows(values: NDArray[np.float32] | None, width: int) -> NDArray[np.float32]:
    return _read_only(np.zeros((0, width), np.float32)) if values is None else values


def _prepare_surface(scene: Scene) -> Surface:
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
        **_placed(scene),
        triangles=scene.triangles,
        colors=_rows(scene.colors, 4),
        uv=_rows(scene.uv, 2),
        material_id=_read_only(scene.material_id),
        base_color=np.array([material.base_color for material in scene.materials], np.float64),
        blended=np.array([material.alpha_mode == "BLEND" for material in scene.materials]),
        transmitted=np.array([material.transmission for material in scene.materials], np.float64),
        texels=textures.texels,
        offset=textures.offset,
        size=textures.size,
        slot=np.cumsum(levels) - levels,
        levels=levels,
    )


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    """A view that cannot be written to, like the scene's arrays: to Numba that is part of the type."""
    view = array.view()
    view.flags.writeable = False
    return view


def _view(
    camera: Camera, samples: ViewSamples, shape: tuple[int, ...], up: Sequence[float] | NDArray[np.floating]
) -> View:
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


class _Shining(NamedTuple):
    """Of all lights, what is the same in every layer: see `Lighting`."""

    position: NDArray[np.float64]
    radiance: NDArray[np.float64]
    fade: NDArray[np.float32]


def _shining(surface: Surface, lights: tuple[Light, ...]) -> _Shining:
    position = np.array([light.position for light in lights], np.float64).reshape(-1, 4)
    radiance = np.array([light.color for light in lights], np.float64).reshape(-1, 3)
    with np.errstate(over="ignore"):
        radiance *= np.array([light.intensity for light in lights], np.float64).reshape(-1, 1)
    if not np.isfinite(radiance).all():
        raise InputError("shade: wanted lights whose colour times intensity is finite")
    exposure = 1.0 / max(1.0, float(radiance.max(axis=1, initial=0.0).sum()))
    fade = np.empty((len(lights), len(surface.normals), 2), np.float32)
    if len(surface.normals):
        run(lambda index: terminator_fade(*surface[:4], position, index, fade), len(lights))
    return _Shining(position, radiance * exposure, fade)


def _lighting(shining: _Shining, masks: tuple[ShadowMask, ...], shape: tuple[int, ...]) -> Lighting:
    in_shadow = np.zeros((len(masks), *shape), bool)
    count = sum(mask.partial is not None for mask in masks)
    partial, slot = np.empty((count, *shape, 3), np.float32), np.full(len(masks), -1)
    for index, mask in enumerate(masks):
        in_shadow[index] = mask.in_shadow.reshape(shape)
        if mask.partial is not None:
            slot[index] = slot.max(initial=-1) + 1
            partial[slot[index]] = mask.partial.reshape(*shape, 3)
    return Lighting(shining.position, shining.radiance, in_shadow, partial, slot, shining.fade)
