"""Per-triangle shadow frusta, rasterized hierarchically over the view samples, on all CPU cores."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.geometry.solids import Solids, find_solids
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods import sample_tree
from umbrae.methods.frustum_traversal import BATCH, COUNTERS, facing_chunk, merge, traverse_batch
from umbrae.methods.light_frame import LightFrame, light_frames, surface_error
from umbrae.methods.method import Caster, Method
from umbrae.parallel import run
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

_FACING_CHUNK = 16384

BLOCK = 1 << 23
"""Samples per hierarchy: a 3840 x 2160 picture is one block; larger ones go band by band to bound the memory."""


@dataclass(frozen=True)
class Frustum(Method):
    """Exact shadows of any triangle soup after Sintorn, Olsson and Assarsson 2011, opaque casters.

    Every triangle's shadow frustum (its four planes: three through the light and an edge, and the triangle's own)
    descends a hierarchy of boxes over the view samples: a box outside is rejected, a box inside is accepted as a
    whole in the hierarchical shadow buffer, anything else is refined down to the samples (section 3.1). Tests are done
    in float32 with derived bounds; a sample that they leave open is decided by `geometry.predicates.shadows`, exactly.

    Deviations from the paper: the hierarchy stands in the light's normalized device coordinates instead of the
    camera's (see `sample_tree`), where side planes are lines and a frustum's bounds in x and y do what the two
    silhouette planes towards the eye do there; frusta descend in batches (see `frustum_traversal`); there is no bias,
    as a sample knows its own triangle; samples without a camera are served as well.

    Options
    -------
    front_face_culling
        Leave half of each solid's triangles out (section 3.5): a ray that crosses a closed surface crosses triangles
        that face the light and triangles that face away in pairs. The paper drops the former, or the latter; here it
        is always those that face away from the light: on its way to a light outside, a ray from anywhere crosses at
        least as many of the others, also one that starts inside a solid or on it. That holds for parts whose winding
        number is nowhere negative (see `geometry.solids`); all others are never culled, nor are parts that are not
        opaque or whose bounding box holds the light. Off by default: finding the solids takes longer than it saves
        unless the same geometry is asked many times.
    """

    front_face_culling: bool = False

    name: ClassVar[str] = "frustum"
    paper: ClassVar[str] = "Sintorn, Olsson, Assarsson 2011"
    guarantee: ClassVar[Guarantee] = Guarantee.EXACT

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "FrustumCaster":
        return FrustumCaster(scene, self.front_face_culling)


class FrustumCaster(Caster):
    """The raw arrays, and the solids if wanted; everything else depends on the light."""

    def __init__(self, scene: Scene, front_face_culling: bool) -> None:
        self.scene = scene
        self.solids: Solids | None = None
        if front_face_culling and len(scene.triangles):
            solid = np.array([material.casts_solid for material in scene.materials])
            self.solids = find_solids(scene.positions, scene.triangles, solid[scene.material_id])

    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
        samples.check(self.scene)
        clock = clock or Clock()
        in_shadow = np.zeros(samples.size, bool)
        stats = np.zeros(len(COUNTERS), np.int64)
        if len(self.scene.triangles) and samples.size:
            source = light.position.astype(np.float64)
            with clock.span("facing"):
                facing, bounds = self._facing(source, clock)
            width = samples.size // samples.shape[0]
            step = max(4, BLOCK // width // 4 * 4)
            for start in range(0, samples.shape[0], step):
                block = samples.rows(start, start + step)
                part = in_shadow[start * width : (start + step) * width]
                stats += self._shadow_block(source, block, facing, bounds, part, clock)
        counters = dict(zip(COUNTERS, (int(n) for n in stats), strict=True))
        return ShadowMask(in_shadow.reshape(samples.shape), Guarantee.EXACT, stats=counters)

    def _shadow_block(
        self,
        source: NDArray[np.float64],
        samples: ViewSamples,
        facing: NDArray[np.int8],
        bounds: NDArray[np.float64],
        in_shadow: NDArray[np.bool_],
        clock: Clock,
    ) -> NDArray[np.int64]:
        with clock.span("hierarchy"):
            frames = light_frames(source, _including(bounds, samples))
            error = surface_error(bounds)
            leaves, trees = sample_tree.build(samples, facing, source, frames, error, in_shadow, clock)
        with clock.span("traversal"):
            stats = self._traverse(source, samples, facing, frames, leaves, trees, clock)
        with clock.span("merge"):
            for tree in trees:
                if tree is not None:
                    merge(tree.level, tree.slot, tree.full, leaves.own, leaves.sample, in_shadow)
        return stats

    def _facing(self, source: NDArray[np.float64], clock: Clock) -> tuple[NDArray[np.int8], NDArray[np.float64]]:
        """Which side of each triangle the light is on, and the bounds `(2, 3)` of the scene."""
        count = len(self.scene.triangles)
        facing = np.empty(count, np.int8)
        bounds = np.empty((-(-count // _FACING_CHUNK), 2, 3))

        def task(chunk: int) -> None:
            start, stop = chunk * _FACING_CHUNK, min((chunk + 1) * _FACING_CHUNK, count)
            facing_chunk(self.scene.positions, self.scene.triangles, source, start, stop, facing, bounds[chunk])

        run(task, len(bounds), clock)
        return facing, np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])

    def _traverse(
        self,
        source: NDArray[np.float64],
        samples: ViewSamples,
        facing: NDArray[np.int8],
        frames: list[LightFrame],
        leaves: sample_tree.Leaves,
        trees: list[sample_tree.SampleTree | None],
        clock: Clock,
    ) -> NDArray[np.int64]:
        count = len(self.scene.triangles)
        batches = -(-count // BATCH)
        active = [(frame, tree) for frame, tree in zip(frames, trees, strict=True) if tree is not None]
        casts = self._casts(source, facing)
        raw: tuple[Any, ...] = (
            samples.barycentric.reshape(-1, 2),
            samples.side.reshape(-1),
            samples.position.reshape(-1, 3),
        )

        def task(number: int) -> NDArray[np.int64]:
            frame, tree = active[number // batches]
            start = number % batches * BATCH
            stats = np.zeros(len(COUNTERS), np.int64)
            traverse_batch(
                self.scene.positions, self.scene.triangles, facing, casts, source, frame,
                start, min(start + BATCH, count), tree.box, tree.level, tree.slot, tree.full,
                leaves.x, leaves.y, leaves.q, leaves.own, leaves.sample, leaves.slack, leaves.box, *raw, stats,
            )  # fmt: skip
            return stats

        if not active:
            return np.zeros(len(COUNTERS), np.int64)
        total: NDArray[np.int64] = np.sum(run(task, batches * len(active), clock), axis=0, dtype=np.int64)
        return total

    def _casts(self, source: NDArray[np.float64], facing: NDArray[np.int8]) -> NDArray[np.bool_]:
        """`(t,)` which triangles cast; empty when all do."""
        if self.solids is None or len(self.solids.lower) == 0:
            return np.zeros(0, bool)
        holds_light = (source[:3] >= self.solids.lower) & (source[:3] <= self.solids.upper)
        culled = ~holds_light.all(axis=1) | (source[3] == 0.0)
        of = self.solids.of
        casts: NDArray[np.bool_] = (of < 0) | ~culled[of] | (facing > 0)
        return casts


def _including(bounds: NDArray[np.float64], samples: ViewSamples) -> NDArray[np.float64]:
    """The scene's bounds `(2, 3)`, widened to the samples where some are free points."""
    if samples.camera is not None or (samples.triangle >= 0).all():
        return bounds
    points = samples.position.reshape(-1, 3)
    return np.stack([np.minimum(bounds[0], points.min(axis=0)), np.maximum(bounds[1], points.max(axis=0))])
