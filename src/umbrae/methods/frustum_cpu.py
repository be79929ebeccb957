"""Per-triangle shadow frusta, rasterized hierarchically over the view samples, on all CPU cores."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.geometry.solids import Solids, find_solids
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods.area_frustum import check_light_samples, shadow_of_area
from umbrae.methods.frustum_traversal import CLUSTERS, COUNTERS, merge, traverse_batch, write_out
from umbrae.methods.light_frame import POSITION_ERROR, LightFrame, light_frames, surface_error
from umbrae.methods.method import Caster, Method
from umbrae.methods.sample_tree import Leaves, SampleTree, bounds_with, build
from umbrae.methods.triangle_clusters import cluster_triangles, light_sides
from umbrae.parallel import run, thread_count
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

_LEAVES_PER_TASK = 4096

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
    silhouette planes towards the eye do there; frusta descend in clusters of 16 neighbours, and clusters in batches
    (see `frustum_traversal`); there is no bias,
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
    light_samples
        How many points of a light with a size each view sample looks at, 1 to 64: its shadow is a multiple of one over
        this number, exact for these points. They differ from sample to sample (see `area_samples`), and all are tested
        in one traversal with triangles' whole regions of influence (section 5; see `area_traversal`).
    """

    front_face_culling: bool = False

    name: ClassVar[str] = "frustum"
    paper: ClassVar[str] = "Sintorn, Olsson, Assarsson 2011"
    guarantee: ClassVar[Guarantee] = Guarantee.EXACT
    accepts: ClassVar[tuple[str, ...]] = ("pictures", "points", "area lights")

    def __post_init__(self) -> None:
        check_light_samples(self.light_samples)

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "FrustumCaster":
        return FrustumCaster(scene, self.front_face_culling, clock, self.light_samples)


class FrustumCaster(Caster):
    """The triangles in clusters, and the solids if wanted; everything else depends on the light."""

    def __init__(self, scene: Scene, front_face_culling: bool, clock: Clock | None, light_samples: int) -> None:
        self.scene, self.light_samples = scene, light_samples
        self.solids: Solids | None = None
        self.clusters = cluster_triangles(scene, clock)
        if front_face_culling and len(scene.triangles):
            solid = np.array([material.casts_solid for material in scene.materials])
            self.solids = find_solids(scene.positions, scene.triangles, solid[scene.material_id])

    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
        samples.check(self.scene)
        clock = clock or Clock()
        if light.is_area:
            return shadow_of_area(self.scene, self.clusters, self.solids, light, samples, self.light_samples, clock)
        in_shadow = np.zeros(samples.size, bool)
        stats = np.zeros(len(COUNTERS), np.int64)
        if len(self.scene.triangles) and samples.size:
            source = light.position.astype(np.float64)
            with clock.span("facing"):
                facing, clustered = light_sides(self.scene, self.clusters, source, clock)
                if self.solids is not None:
                    self._cull(self.solids, source, clustered)
            width = samples.size // samples.shape[0]
            step = max(4, BLOCK // width // 4 * 4)
            for start in range(0, samples.shape[0], step):
                block = samples if step >= samples.shape[0] else samples.rows(start, start + step)
                part = in_shadow[start * width : (start + step) * width]
                stats += self._shadow_block(source, block, facing, clustered, part, clock)
        counters = dict(zip(COUNTERS, (int(n) for n in stats), strict=True))
        return ShadowMask(in_shadow.reshape(samples.shape), Guarantee.EXACT, stats=counters)

    def _shadow_block(
        self,
        source: NDArray[np.float64],
        samples: ViewSamples,
        facing: NDArray[np.int8],
        clustered: NDArray[np.int8],
        in_shadow: NDArray[np.bool_],
        clock: Clock,
    ) -> NDArray[np.int64]:
        with clock.span("hierarchy"):
            bounds = bounds_with(self.clusters.bounds, samples)
            largest = float(np.abs(bounds).max())
            on_surface = samples.camera is not None or bool((samples.triangle >= 0).any())
            error = POSITION_ERROR * largest + surface_error(bounds) if on_surface else 0.0
            frames = light_frames(source, bounds, error)
            limits = error, 2.0**-50 * largest
            leaves, trees = build(samples, facing, source, frames, limits, in_shadow, clock)
        with clock.span("traversal"):
            stats = self._traverse(source, samples, clustered, frames, leaves, trees, clock)
        with clock.span("merge"):
            for tree in trees:
                if tree is not None:
                    merge(tree.level, tree.full)
                    _write_out(tree, leaves.ids, in_shadow, clock)
        leaves.release(sum(len(tree.slot) for tree in trees if tree is not None))
        return stats

    def _traverse(
        self,
        source: NDArray[np.float64],
        samples: ViewSamples,
        facing: NDArray[np.int8],
        frames: list[LightFrame],
        leaves: Leaves,
        trees: list[SampleTree | None],
        clock: Clock,
    ) -> NDArray[np.int64]:
        corners, boxes, order, _ = self.clusters
        count = len(corners)
        step = min(CLUSTERS, -(-count // (8 * thread_count())))
        batches = -(-count // step)
        active = [(frame, tree) for frame, tree in zip(frames, trees, strict=True) if tree is not None]
        raw: tuple[Any, ...] = (
            samples.barycentric.reshape(-1, 2),
            samples.side.reshape(-1),
            samples.position.reshape(-1, 3),
        )

        def task(number: int) -> NDArray[np.int64]:
            frame, tree = active[number // batches]
            start = number % batches * step
            stats = np.zeros(len(COUNTERS), np.int64)
            traverse_batch(
                self.scene.positions, self.scene.triangles, corners, boxes, order, facing, source, frame, start,
                min(start + step, count), tree.box, tree.full, tree.level, tree.slot, leaves.place, leaves.ids,
                leaves.box, *raw, stats,
            )  # fmt: skip
            return stats

        if not active:
            return np.zeros(len(COUNTERS), np.int64)
        total: NDArray[np.int64] = np.sum(run(task, batches * len(active), clock), axis=0, dtype=np.int64)
        return total

    def _cull(self, solids: Solids, source: NDArray[np.float64], clustered: NDArray[np.int8]) -> None:
        """Let the triangles of solids that face away from the light cast nothing."""
        holds_light = ((source[:3] >= solids.lower) & (source[:3] <= solids.upper)).all(axis=1)
        culled = np.append(~holds_light | (source[3] == 0.0), False)[solids.of][self.clusters.order]
        sides = clustered.reshape(-1)[: len(culled)]
        sides[culled & (sides < 0)] = 0


def _write_out(tree: SampleTree, ids: NDArray[np.int32], in_shadow: NDArray[np.bool_], clock: Clock) -> None:
    """Write the verdicts of all leaves."""
    count = len(tree.slot)

    def task(number: int) -> None:
        start, stop = number * _LEAVES_PER_TASK, min((number + 1) * _LEAVES_PER_TASK, count)
        write_out(start, stop, tree.slot, tree.full, ids, in_shadow)

    run(task, -(-count // _LEAVES_PER_TASK), clock)
