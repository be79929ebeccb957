"""Shadow maps on OpenGL: what the light sees, as a picture of depths that samples are looked up in."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import number, shown, whole
from umbrae.clock import Clock
from umbrae.errors import GraphicsError, OptionError
from umbrae.geometry.volume_faces import facing_of_all
from umbrae.gl.compute import dispatch, groups_of
from umbrae.gl.context import Session, session
from umbrae.gl.program import program
from umbrae.gl.queries import stage
from umbrae.gl.state import cast_depth
from umbrae.gl.targets import DepthTarget, depth_target
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.memory import require
from umbrae.methods.method import Caster, Method, require_solid
from umbrae.methods.shadow_map.projection import PROJECTIONS, View, views
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

_HERE = Path(__file__).parent

_AT_ONCE = 1 << 22
"""Samples in one buffer: far below the 128 MB that every driver takes."""

_MOST_TAPS = 16

_BYTES_PER_SAMPLE = 48


@dataclass(frozen=True)
class ShadowMap(Method):
    """Shadow mapping after Williams 1978, as people would use it instead; it promises nothing.

    The scene is drawn from the light, and each sample compares its depth with that of the texel it falls into. The
    map is fitted to the scene. Parallel light has one map; so has a point light that sees the whole scene within 90
    degrees, and any other the six faces of a cube. What Milet et al. compare with is the same where there is one map:
    8192 x 8192 texels, without a filter. They had none for all directions, so in Sponza they have no numbers; their fit
    and their bias are not told.

    Depths are 32-bit floats, reversed, so that digits last from the light to the far end. A texel stands for all
    samples in it: shadows end in its steps, and a surface shadows itself unless something is taken off its depth
    (`bias`). Too much of that, and shadows come off their casters. Samples whose own triangle turns its back to the
    light are dark without a look, as any shading makes them.

    Options
    -------
    size
        Texels along each side. The faces of a cube have half of that. Memory is 4 bytes a texel, 256 MiB by default;
        the faces are drawn one after the other into the same 64 MiB.
    bias
        How much nearer to the light samples are taken to be, along the map's axis: a share of the scene's largest
        extent.
    slope_bias
        How much farther casters are drawn, in texels of their slope (times the filter's width). Within its texel a
        plane's depth is off by at most 1; 2 serves curved surfaces.
    filter
        Percentage-closer filtering (Reeves et al. 1987) over so many texels each way: the share of them that is lit. 1
        is none; at most 16. The faces of a cube overlap by as much, so that shadows are filtered across their borders.
    projection
        `auto` as above; `single` one map for a point light, up to 152 degrees; `cube` always six.
    """

    size: int = 8192
    bias: float = 1e-4
    slope_bias: float = 2.0
    filter: int = 1
    projection: str = "auto"

    name: ClassVar[str] = "shadow-map"
    paper: ClassVar[str] = "Williams 1978"
    guarantee: ClassVar[Guarantee] = Guarantee.NONE
    engine: ClassVar[str] = "OpenGL"

    def __post_init__(self) -> None:
        if whole(self.size, f"{self.name}: size") < 2:
            raise OptionError(f"{self.name}: size: wanted at least 2 texels, got {self.size}")
        for option, value in (("bias", self.bias), ("slope_bias", self.slope_bias)):
            if number(value, f"{self.name}: {option}") < 0:
                raise OptionError(f"{self.name}: {option}: wanted a number of at least 0, got {value}")
        if not 1 <= whole(self.filter, f"{self.name}: filter") <= _MOST_TAPS:
            raise OptionError(f"{self.name}: filter: wanted 1 to {_MOST_TAPS} texels, got {self.filter}")
        if self.projection not in PROJECTIONS:
            wanted = f"wanted one of {', '.join(PROJECTIONS)}"
            raise OptionError(f"{self.name}: projection: {wanted}, got {shown(self.projection)}")

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "ShadowMapCaster":
        return ShadowMapCaster(scene, self, clock)


class ShadowMapCaster(Caster):
    """A scene's geometry in OpenGL buffers, moved and scaled to lie between -1 and 1."""

    def __init__(self, scene: Scene, method: ShadowMap, clock: Clock | None) -> None:
        require_solid(scene, method.name)
        self.method = method
        self.session = session()
        with self.session.current() as current:
            largest = current.integer("GL_MAX_TEXTURE_SIZE")
            if method.size > largest:
                raise GraphicsError(
                    f"{method.name}: size: this OpenGL driver takes up to {largest} texels, got {method.size}"
                )
            if len(scene.triangles):
                self.index = current.moderngl.buffer(scene.triangles)
        self._place(scene, clock)

    def _place(self, scene: Scene, clock: Clock | None) -> None:
        self.scene = scene
        low, high = scene.bounds.astype(np.float64)
        self.middle, self.extent = (low + high) / 2, float((high - low).max()) or 1.0
        self.half = (high - low) / self.extent
        if len(scene.triangles):
            with self.session.current() as current:
                self.vertices = current.moderngl.buffer(self._scaled(scene.positions))

    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
        self.check(light, samples)
        clock = clock or Clock()
        taps, dark = self.method.filter**2, np.zeros(samples.size, np.uint16)
        stats = {"maps": 0, "texels_per_side": 0, "map_bytes": 0}
        if len(self.scene.triangles) and samples.size:
            with clock.span("facing"):
                asked = self._not_turned_away(light, samples, dark)
            maps = self._views(light)
            size = self.method.size if len(maps) == 1 else max(1, self.method.size // 2)
            stats = {"maps": len(maps), "texels_per_side": size, "map_bytes": 4 * size * size}
            require(stats["map_bytes"] + _BYTES_PER_SAMPLE * len(asked), f"shadows by {self.method.name}")
            with self.session.current() as current:
                dark[asked] = self._look_up(current, maps, size, samples.position.reshape(-1, 3), asked, clock)
        dark = dark.reshape(samples.shape)
        partial = None
        if taps > 1:
            lit = 1 - dark.astype(np.float32) / np.float32(taps)
            partial = np.repeat(lit[..., None], 3, axis=-1)
        return ShadowMask(dark == taps, Guarantee.NONE, stats=stats, partial=partial)

    def _views(self, light: Light) -> list[View]:
        here = light.position.astype(np.float64)
        if not light.is_directional:
            here[:3] = (here[:3] - self.middle) * (2 / self.extent)
        # Texels on each side of a cube's face for the filter alone; of very small faces no more than half.
        face = max(1, self.method.size // 2)
        margin = min(self.method.filter // 2 / face, 0.25)
        found = views(here, self.half, self.method.projection, margin)
        if found is None:
            raise OptionError(
                f"{self.method.name}: projection='single' cannot show the whole scene from this light; 'auto' takes a "
                "cube"
            )
        return found

    def _not_turned_away(self, light: Light, samples: ViewSamples, dark: NDArray[np.uint16]) -> NDArray[np.intp]:
        """Flat indices of the samples to be looked up; those whose own triangle turns away are set `dark`."""
        facing = np.append(facing_of_all(self.scene.positions, self.scene.triangles, light.position), np.int8(0))
        covered = samples.covered.reshape(-1)
        away = covered & (facing[samples.triangle.reshape(-1)] * samples.side.reshape(-1) < 0)
        dark[away] = self.method.filter**2
        return np.flatnonzero(covered & ~away)

    def _look_up(
        self,
        current: Session,
        maps: list[View],
        size: int,
        positions: NDArray[np.float32],
        asked: NDArray[np.intp],
        clock: Clock,
    ) -> NDArray[np.uint32]:
        """How many texels are dark around each of the samples at flat indices `asked`."""
        context = current.moderngl
        with stage(current, clock, "upload"):
            parts = [asked[start : start + _AT_ONCE] for start in range(0, len(asked), _AT_ONCE)]
            places = [context.buffer(self._scaled(positions[part])) for part in parts]
            counts = [context.buffer(bytes(4 * len(part))) for part in parts]
        target = depth_target(current, size)
        for view in maps:
            with stage(current, clock, "map"):
                self._draw(current, target, view)
            with stage(current, clock, "lookup"):
                uniforms = {
                    "map": 0,
                    "to_map": _columns(view.to_map),
                    "own": view.own,
                    "nearer": tuple(view.nearer(2 * self.method.bias).tolist()),
                }
                current.gl.glBindTextureUnit(0, target.depth)
                for part, place, count in zip(parts, places, counts, strict=True):
                    given = {**uniforms, "count": len(part)}
                    taps = {"TAPS": self.method.filter}
                    file = _HERE / "lookup.glsl"
                    dispatch(current, file, groups_of(len(part)), given, {0: place, 1: count}, taps)
        with clock.span("read"):
            found = [np.frombuffer(count.read(), np.uint32) for count in counts]
        return np.concatenate([np.zeros(0, np.uint32), *found])

    def _draw(self, current: Session, target: DepthTarget, view: View) -> None:
        target.clear()
        cast_depth(current, target, self.method.slope_bias * self.method.filter)
        drawn = program(current, _HERE / "draw.glsl")
        drawn["to_map"].value = _columns(view.to_map)
        context = current.moderngl
        array = context.vertex_array(drawn, [(self.vertices, "3f", "position")], self.index)
        array.render(context.TRIANGLES)

    def _scaled(self, positions: NDArray[np.float32]) -> NDArray[np.float32]:
        """Scene coordinates in the units of the buffers."""
        placed: NDArray[np.float32] = ((positions - self.middle) * (2 / self.extent)).astype(np.float32)
        return placed


def _columns(matrix: NDArray[np.float64]) -> tuple[float, ...]:
    """A matrix as OpenGL takes it."""
    return tuple(matrix.T.ravel().tolist())
