"""The main job: a scene, seen by a camera, lit by lights, as a picture with exact shadows."""

from collections.abc import Iterable

from umbrae.antialiasing import filtered_shadow
from umbrae.camera import Camera
from umbrae.checks import Vector, instance, shown, vector
from umbrae.clock import Clock
from umbrae.errors import InputError, OptionError
from umbrae.image import Image
from umbrae.light import Light
from umbrae.memory import require
from umbrae.methods import Caster, Method, cast_shadow, make_method
from umbrae.methods.area_average import AREA_LIGHTS
from umbrae.methods.frustum_cpu import BLOCK
from umbrae.samples import ViewSamples
from umbrae.sampling import sample_layers, sample_stochastic, sample_tessellated
from umbrae.sampling.layers import check_layers
from umbrae.sampling.tessellated import check_level
from umbrae.scene import Scene
from umbrae.shade import shade, up_axis
from umbrae.transmission import transmission_of

ANTIALIASING = ("samples", "derivative")
_BYTES_FOR_SUN, _BYTES_FOR_POINT = 70, 180
"""What shadows take for each sample of a block, measured; for a point light as if it stood amid the scene."""
_BYTES_FOR_SHARES = 13
"""Of a mask's sample: a byte for whether any light arrives, three float32 for how much does."""
_BYTES_FOR_MEAN = 60
"""Of a sample, while the masks of points of a light with a size are averaged: two sums in float64, and a mask."""
_SUN_AZIMUTH, _SUN_ELEVATION = 55.0, 40.0
_SUN_COLOR = (1.0, 0.96, 0.89)


def render(
    scene: Scene,
    camera: Camera | None = None,
    lights: Light | Iterable[Light] | None = None,
    method: str | Method = "frustum",
    samples_per_pixel: int = 1,
    up: Vector = (0.0, 1.0, 0.0),
    clock: Clock | None = None,
    layers: int = 8,
    stochastic: int | None = None,
    antialiasing: str = "samples",
    filter_width: float = 1.0,
    smooth_outlines: int = 1,
    caster: Caster | None = None,
) -> Image:
    """Make a picture with shadows: sample what the camera sees, decide the shadows, shade.

    Transparent surfaces are seen through, and receive shadows themselves: they are peeled layer by layer, or chosen by
    chance.

    Parameters
    ----------
    camera
        `Camera.frame(scene)` by default: the whole scene from a raised corner.
    lights
        One light or several; by default a sun that shines over the camera's shoulder.
    method
        A name from `METHODS`, or a `Method` with its options set.
    samples_per_pixel
        More than one smooths edges.
    up
        World up, for the default camera and sun and for the sky.
    clock
        Hears how long "sample", "prepare", "shadow" (once per light and layer) and "shade" take.
    layers
        How many surfaces behind one another to see at most, where they let light through; what passes the last one
        meets the background. With 1, all are shown as if solid.
    stochastic
        A seed: each sample sees one surface, by chance (`sample_stochastic`), which takes less memory than layers and
        is noisy; meant for many samples per pixel.
    antialiasing
        "samples" smooths edges by several samples per pixel, "derivative" those of shadows alone, with one: the
        footprint of each pixel on the surface that it sees is filtered (`antialiasing.filtered_shadow`).
    filter_width
        Side of that footprint in pixels; more than 1 blurs.
    smooth_outlines
        A level above 1 shows meshes with smooth normals as if each side were cut into so many pieces, on a curved
        surface (`sample_tessellated`). Shadows stay those of the mesh, by methods that take samples without a depth.
    caster
        One that `method` has prepared for a scene of which this one is a moved copy (`Scene.moved`): it follows, and
        what triangles alone decide is not found anew.

    Raises
    ------
    InputError
        For no lights, an up vector of zero, smooth outlines of a scene that lets light through, or the caster of
        another scene.
    OptionError
        For an unknown method or kind of antialiasing, samples per pixel or layers that are not a whole number from 1,
        a seed that is none from 0, a filter width that is not positive, or smooth outlines of a level that is none,
        or together with `stochastic` or "derivative".
    CapacityError
        When the picture would not fit into memory.
    """
    clock = clock or Clock()
    up = up_axis(vector(up, "up"))
    instance(scene, Scene, "scene")
    if camera is None:
        camera = Camera.frame(scene, up=up)
    instance(camera, Camera, "camera")
    shining = _lights(lights, camera, up)
    algorithm = make_method(method)
    check_layers(layers)
    filtered = is_filtered(antialiasing, samples_per_pixel, algorithm)
    check_level(smooth_outlines)
    if smooth_outlines > 1 and (filtered or stochastic is not None):
        with_what = "antialiasing 'derivative'" if filtered else "a stochastic picture"
        raise OptionError(f"smooth outlines: they do not go with {with_what}")
    if smooth_outlines > 1 and "points" not in algorithm.accepts:
        raise OptionError(f"smooth outlines: method {algorithm.name} counts along view rays, which they leave")
    with clock.span("sample"):
        found: tuple[ViewSamples, ...]
        if smooth_outlines > 1:
            found = (sample_tessellated(scene, camera, smooth_outlines, samples_per_pixel, clock),)
        elif stochastic is not None:
            found = (sample_stochastic(scene, camera, samples_per_pixel, stochastic, clock),)
        else:
            found = sample_layers(scene, camera, layers, samples_per_pixel, clock)
    _require(scene, camera, shining, found, algorithm)
    with clock.span("prepare"):
        if caster is None:
            caster = algorithm.prepare(scene, clock)
        elif caster.scene is not scene:
            caster.follow(scene, clock)
    masks = []
    for layer in found:
        of_layer = []
        for light in shining:
            with clock.span("shadow"):
                if filtered:
                    of_layer.append(filtered_shadow(algorithm, caster, light, layer, width=filter_width, clock=clock))
                else:
                    of_layer.append(cast_shadow(algorithm, caster, light, layer, clock))
        masks.append(tuple(of_layer))
    with clock.span("shade"):
        if len(found) == 1 and (layers == 1 or stochastic is not None):
            pixels = shade(scene, camera, shining, found[0], masks[0], up, clock)
        else:
            pixels = shade(scene, camera, shining, found, masks, up, clock)
    return Image(pixels, found[0], masks[0], found[1:], tuple(masks[1:]))


def is_filtered(antialiasing: str, samples_per_pixel: int, method: Method) -> bool:
    """Whether shadows are filtered; refuses what filtering cannot work with."""
    if antialiasing not in ANTIALIASING:
        raise OptionError(f"antialiasing: wanted one of {', '.join(ANTIALIASING)}, got {shown(antialiasing)}")
    if antialiasing == "samples":
        return False
    if samples_per_pixel != 1:
        raise OptionError(f"antialiasing 'derivative' takes one sample per pixel, got {samples_per_pixel}")
    if "points" not in method.accepts:
        raise OptionError(
            f"antialiasing 'derivative': {method.name} takes whole pictures only, and footprints are points"
        )
    return True


def _require(
    scene: Scene, camera: Camera, lights: tuple[Light, ...], layers: tuple[ViewSamples, ...], method: Method
) -> None:
    """Refuse a picture of which shadows and shading would not fit into memory."""
    work = max(_BYTES_FOR_SUN if light.is_directional else _BYTES_FOR_POINT for light in lights)
    solid, soft = transmission_of(scene) is None, any(light.is_area for light in lights)
    shares = 1 if solid and not soft else _BYTES_FOR_SHARES
    total, samples = len(layers) * layers[0].size, layers[0].size
    # Each mask is there twice while shading, and the picture has three bytes per pixel.
    size = min(samples, BLOCK) * work + total * 2 * len(lights) * shares + camera.width * camera.height * 3
    if soft and AREA_LIGHTS not in method.accepts:
        size += samples * _BYTES_FOR_MEAN
    several = f" in {len(layers)} layers (fewer need less)" if len(layers) > 1 else ""
    require(size, f"after sampling, the rest of a picture of {camera.width} x {camera.height} pixels{several}")


def default_sun(camera: Camera, up: Vector = (0.0, 1.0, 0.0)) -> Light:
    """A warm sun behind the camera's left shoulder: shadows fall to the right and away from the eye."""
    _right, upward, forward = camera.axes
    # Looking straight down, what is up in the picture lies ahead.
    axis = up_axis(up)
    behind = -upward if abs(float(forward @ axis)) > 0.99 else -forward
    return Light.sun(_SUN_AZIMUTH, _SUN_ELEVATION, up=axis, north=behind, color=_SUN_COLOR)


def _lights(lights: Light | Iterable[Light] | None, camera: Camera, up: Vector) -> tuple[Light, ...]:
    if lights is None:
        return (default_sun(camera, up),)
    shining = tuple(lights) if isinstance(lights, Iterable) else (lights,)
    if not shining:
        raise InputError("lights: wanted at least one light, got none")
    for light in shining:
        instance(light, Light, "lights")
    return shining
