"""The truth: exact rationals where floating point is unsure."""

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import whole
from umbrae.clock import Clock
from umbrae.errors import OptionError
from umbrae.geometry import bvh
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods.area_samples import light_samples
from umbrae.methods.method import LIGHT_SAMPLES, Caster, Method
from umbrae.methods.oracle_filter import decide_chunk, margin_chunk
from umbrae.methods.oracle_transmission import Product, Share
from umbrae.parallel import run
from umbrae.samples import ViewSamples
from umbrae.scene import Scene
from umbrae.transmission import SOLID, transmission_of

_CHUNK = 4096

_ROOM = 1 << 14
"""Pairs of sample and triangle that a thread holds at a time; in larger scenes as many as there are triangles."""

_PAIRS = 1 << 20
"""Pairs of sample and light sample that are asked about at a time, to bound the memory."""


@dataclass(frozen=True)
class Oracle(Method):
    """Every sample asks the triangles one by one; a floating-point filter first, rationals where it is unsure.

    The definition is the one of `geometry.predicates`, written a second time so that neither can hide the other's
    mistakes: determinants are formed around the sample instead of around a vertex (`oracle_filter`), and exact signs
    come from `fractions.Fraction`. A conservative box tree (`tree = True`) leaves out triangles that the segment from
    the sample to the light cannot meet; `tree = False` asks all of them.

    Where casters let light through, all of them are collected and their shares multiplied up in float64
    (`oracle_transmission`); `OracleCaster.decide` also says between what the result lies.

    Of a light with a size, each view sample asks for its own light samples, one by one (see `area_samples`): the truth
    for methods that look at the same ones.
    """

    tree: bool = True

    name: ClassVar[str] = "oracle"
    paper: ClassVar[str] = "the definition itself"
    guarantee: ClassVar[Guarantee] = Guarantee.EXACT
    accepts: ClassVar[tuple[str, ...]] = ("pictures", "points", "transparency", "area lights")

    def __post_init__(self) -> None:
        if whole(self.light_samples, f"{self.name}: light_samples") < 1:
            raise OptionError(f"{self.name}: light_samples: wanted at least 1, got {self.light_samples}")

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "OracleCaster":
        return OracleCaster(scene, self.tree, self.light_samples)


class Decided(NamedTuple):
    """A mask, and `(..., 3) float32` between what its shares of light lie; None where each sample is lit or dark.

    The two differ where a texture or vertex colours decide and float64 cannot say more: by about 1e-12, or by the whole
    share of a triangle where alpha is that near to the cut-off of alpha mode MASK.
    """

    mask: ShadowMask
    lowest: NDArray[np.float32] | None
    highest: NDArray[np.float32] | None


class OracleCaster(Caster):
    """A scene with its box tree."""

    takes_area_lights = True

    def __init__(self, scene: Scene, tree: bool = True, light_samples: int = LIGHT_SAMPLES) -> None:
        self.scene = scene
        self.light_samples = light_samples
        self.transmission = transmission_of(scene)
        table = self.transmission
        self.kind = table.kind if table is not None else np.full(len(scene.triangles), SOLID, np.uint8)
        self.closed = self.kind == SOLID
        if table is not None:
            self.closed |= table.closed[table.material_id]
        self._pruned = tree
        self._place(scene, None)

    def _place(self, scene: Scene, clock: Clock | None) -> None:
        self.scene = scene
        self.tree = bvh.build(scene.positions, scene.triangles)
        if not self._pruned:
            self.tree.lower[:] = -np.inf
            self.tree.upper[:] = np.inf

    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
        return self.decide(light, samples, clock).mask

    def decide(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> Decided:
        """The mask of `shadow`, and how well its shares of light are known."""
        covered = samples.covered.reshape(-1)
        mask, *bounds = self.decide_at(light, samples, np.flatnonzero(covered), clock)

        def spread(values: NDArray[Any], background: Any) -> NDArray[Any]:
            """What covered samples have, in the shape of all."""
            result = np.full((samples.size, *values.shape[1:]), background, values.dtype)
            result[covered] = values
            return result.reshape(*samples.shape, *values.shape[1:])

        partial, lowest, highest = (None if part is None else spread(part, 1) for part in (mask.partial, *bounds))
        # Background is lit.
        return Decided(replace(mask, in_shadow=spread(mask.in_shadow, False), partial=partial), lowest, highest)

    def decide_at(
        self, light: Light, samples: ViewSamples, chosen: NDArray[np.intp], clock: Clock | None = None
    ) -> Decided:
        """`decide` for the samples at flat indices `(n,)`, as a list."""
        self.check(light, samples)
        clock = clock or Clock()
        value, lowest, highest = np.empty((3, len(chosen), 3), np.float32)
        asked = 0
        count = self.light_samples if light.is_area else 1
        step = max(1, _PAIRS // count)
        for start in range(0, len(chosen), step):
            some = chosen[start : start + step]
            lights = self._lights(light, samples, some)
            left, fallbacks = self._decide(lights.reshape(-1, 4), samples.take(np.repeat(some, count)), clock)
            asked += fallbacks
            for all_of, part in zip((value, lowest, highest), left, strict=True):
                all_of[start : start + step] = part.reshape(-1, count, 3).mean(axis=1)
        mask = ShadowMask((value == 0).all(axis=1), Guarantee.EXACT, stats={"predicate_fallbacks": asked})
        if self.transmission is None and not light.is_area:
            return Decided(mask, None, None)
        return Decided(replace(mask, partial=value), lowest, highest)

    def _lights(self, light: Light, samples: ViewSamples, chosen: NDArray[np.intp]) -> NDArray[np.float32]:
        """The points of a light that some samples ask for, `(n, light samples, 4)`."""
        if light.is_area:
            return light_samples(light, samples, self.light_samples, chosen)
        return np.tile(light.position, (len(chosen), 1, 1))

    def _decide(self, lights: NDArray[np.float32], samples: ViewSamples, clock: Clock) -> tuple[Share, int]:
        """What arrives at each sample of a list from a light of its own, and how often rationals were asked."""
        verdict = np.zeros(samples.size, np.int8)
        product = Product(self.scene, self.kind, lights, samples)
        with clock.span("oracle"):
            unsure = self._filter(lights, samples, verdict, product, clock) if len(self.scene.triangles) else []
        with clock.span("rationals"):
            asked = 0
            for pairs in unsure:
                through = []
                for sample, triangle in pairs.tolist():
                    if verdict[sample] == 0:
                        asked += 1
                        exact = Exact(self.scene, Light(lights[sample]))
                        if exact.shades(samples, sample, triangle, bool(self.closed[triangle])):
                            if self.kind[triangle] == SOLID:
                                verdict[sample] = 1
                            else:
                                through.append((sample, triangle))
                product.multiply(np.array(through, np.int64).reshape(-1, 2))
        for left in product.left:
            left[verdict != 0] = 0.0
        return product.left, asked

    def _filter(
        self,
        lights: NDArray[np.float32],
        samples: ViewSamples,
        verdict: NDArray[np.int8],
        product: Product,
        clock: Clock,
    ) -> list[NDArray[np.int64]]:
        """Write verdicts and take the shares of sure casters; returns `(n, 2)` pairs that are left to rationals."""
        room = max(_ROOM, len(self.scene.triangles))

        def task(chunk: int) -> list[NDArray[np.int64]]:
            start, stop = chunk * _CHUNK, min((chunk + 1) * _CHUNK, samples.size)
            unsure = []
            pairs = np.empty((room, 3), np.int64)
            while start < stop:
                found, start = decide_chunk(*self._arrays(), lights, *_raw(samples), start, stop, verdict, pairs)
                sure = pairs[:found, 2] != 0
                unsure.append(pairs[:found][~sure, :2])
                product.multiply(pairs[:found][sure, :2])
            return unsure

        return [pairs for chunk in run(task, -(-samples.size // _CHUNK), clock) for pairs in chunk]

    def margin(
        self, light: Light, samples: ViewSamples, in_shadow: NDArray[np.bool_], clock: Clock | None = None
    ) -> NDArray[np.float32]:
        """`(...) float32` world units: a lower bound of how far each sample must move before its verdict changes.

        Lit samples: the distance to the nearest shadow frustum. Samples in shadow: the depth inside the frustum that
        holds them deepest. Where casters let light through, those are solid ones; all other samples have the distance
        to the nearest side of any frustum, so that within it the casters are the same, though not what a texture lets
        through. Never more than a hundredth of the scene's extent, where looking further is not worth it; so too for
        background and samples that their own triangle shades.
        """
        margins = self.margin_at(light, samples, np.arange(samples.size), in_shadow.reshape(-1), clock)
        return margins.reshape(samples.shape)

    def margin_at(
        self,
        light: Light,
        samples: ViewSamples,
        chosen: NDArray[np.intp],
        in_shadow: NDArray[np.bool_],
        clock: Clock | None = None,
    ) -> NDArray[np.float32]:
        """`margin` for the samples at flat indices `(n,)`; `in_shadow (n,)` is theirs.

        For a light with a size, the smallest of all its light samples, as if they stayed where they are: the distance
        to the nearest side of any frustum.
        """
        low, high = self.scene.bounds.astype(np.float64)
        cap = float(np.linalg.norm(high - low)) / 100.0
        found = np.full(len(chosen), cap)
        count = self.light_samples if light.is_area else 1
        step = max(1, _PAIRS // count)
        for start in range(0, len(chosen) if len(self.scene.triangles) else 0, step):
            some = chosen[start : start + step]
            lights = self._lights(light, samples, some).reshape(-1, 4)
            flat, margins = samples.take(np.repeat(some, count)), np.full(len(lights), cap)
            shaded = np.zeros(len(lights), bool) if light.is_area else in_shadow[start : start + step].copy()

            def task(chunk: int, of=(lights, flat, shaded, margins)) -> None:  # type: ignore[no-untyped-def]
                lights, flat, shaded, margins = of
                begin, end = chunk * _CHUNK, min((chunk + 1) * _CHUNK, flat.size)
                margin_chunk(*self._arrays(), lights, *_raw(flat), begin, end, flat.covered, shaded, margins)

            run(task, -(-flat.size // _CHUNK), clock)
            found[start : start + step] = margins.reshape(-1, count).min(axis=1)
        # One step down: rounding to float32, and in float64 before it, must not make a margin larger.
        return np.nextafter(found.astype(np.float32), np.float32(0))

    def _arrays(self) -> tuple[Any, ...]:
        return (self.scene.positions, self.scene.triangles, *self.tree, self.kind)


def _raw(samples: ViewSamples) -> tuple[Any, ...]:
    return samples.triangle, samples.barycentric, samples.side, samples.position


Vector = tuple[Fraction, Fraction, Fraction]


class Exact:
    """The definition in rational numbers, one sample and one triangle at a time."""

    def __init__(self, scene: Scene, light: Light) -> None:
        self.scene = scene
        *direction, self.w = (Fraction(float(x)) for x in light.position)
        self.light: Vector = (direction[0], direction[1], direction[2])

    def corners(self, triangle: int) -> tuple[Vector, Vector, Vector]:
        """The triangle's vertices."""
        a, b, c = (_vector(self.scene.positions[i]) for i in self.scene.triangles[triangle])
        return a, b, c

    def facing(self, triangle: int) -> int:
        """The side of the triangle's plane that the light is on; 0 in the plane, or no area."""
        a, b, c = self.corners(triangle)
        return _sign(_dot(_cross(_minus(b, a), _minus(c, a)), _minus(self.light, _times(self.w, a))))

    def shades(self, samples: ViewSamples, sample: int, triangle: int, closed: bool = True) -> bool:
        """Whether the triangle shadows sample number `sample` of a flat list.

        Side planes belong to the triangle if `closed`; else a sample on one counts as moved by (e, e**2, e**3), e -> 0.
        So on an edge of its own triangle it may be moved off it, like off any other.
        """
        own, side = int(samples.triangle[sample]), int(samples.side[sample])
        facing = self.facing(triangle)
        if triangle == own and closed:
            return side * facing < 0
        if facing == 0:
            return False
        point, offset = _vector(samples.position[sample]), (Fraction(0), Fraction(0), Fraction(0))
        if own >= 0:
            u, v = (Fraction(float(x)) for x in samples.barycentric[sample])
            a, b, c = self.corners(own)
            ab, ac = _minus(b, a), _minus(c, a)
            point = _plus(a, _plus(_times(u, ab), _times(v, ac)))
            offset = _times(Fraction(side), _cross(ab, ac))

        def side_of(normal: Vector, base: Vector) -> int:
            return _sign(_dot(normal, _minus(point, base))) or _sign(_dot(normal, offset))

        a, b, c = self.corners(triangle)
        for first, second in ((a, b), (b, c), (c, a)):
            normal = _cross(_minus(_times(self.w, first), self.light), _minus(second, first))
            sign = side_of(normal, first)
            if sign == 0 and not closed:
                sign = next((_sign(component) for component in normal if component), 0)
            if -facing * sign < 0:
                return False
        return -facing * side_of(_cross(_minus(b, a), _minus(c, a)), a) > 0


def _vector(values: NDArray[np.float32]) -> Vector:
    x, y, z = (Fraction(float(value)) for value in values)
    return x, y, z


def _plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _times(factor: Fraction, a: Vector) -> Vector:
    return factor * a[0], factor * a[1], factor * a[2]


def _dot(a: Vector, b: Vector) -> Fraction:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _sign(value: Fraction) -> int:
    return (value > 0) - (value < 0)
