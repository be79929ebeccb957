"""Alias-free shadow maps: view samples in lists over the light's view, and triangles drawn over them."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import whole
from umbrae.clock import Clock
from umbrae.errors import OptionError
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask, add_stats
from umbrae.memory import require
from umbrae.methods.alias_free_raster import rasterize, write_out
from umbrae.methods.frustum_leaves import COUNTERS, EXACT_TESTS, FALLBACKS, SAMPLE_TESTS, TILE_TESTS, Receivers
from umbrae.methods.light_frame import POSITION_ERROR, light_frames, surface_error
from umbrae.methods.lit_clusters import LitClusters
from umbrae.methods.method import Caster, Method, require_solid
from umbrae.methods.sample_lists import build
from umbrae.methods.sample_tree import bounds_with
from umbrae.methods.triangle_clusters import cluster_triangles, moved_clusters
from umbrae.parallel import run, thread_count
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

BLOCK = 1 << 22
"""Samples in lists at a time: larger pictures go band by band to bound the memory."""

MOST_CELLS = 2048

_SAMPLES_PER_CELL = 32
"""Of the default grid, were samples spread evenly."""

_CLUSTERS_PER_TASK = 64
_LEAVES_PER_TASK = 4096
_BYTES_PER_LEAF = 400
_BYTES_PER_SAMPLE = 50
_SHOWN = (TILE_TESTS, SAMPLE_TESTS, FALLBACKS, EXACT_TESTS)


@dataclass(frozen=True)
class AliasFreeMap(Method):
    """Exact shadows by an irregular z-buffer: samples in lists over the light's view, triangles drawn into the lists.

    After Sintorn, Eisemann and Assarsson 2008, whose hard shadows test each sample of a list against the triangles
    that meet the list's cell; the idea of samples in lists is that of Johnson et al. 2005 and of Aila and Laine 2004.
    A triangle is drawn conservatively, row by row: a cell is left out where a side of its shadow frustum leaves all of
    it out, or all samples are nearer to the light. Samples of the other cells ask its four planes in float32 with
    derived bounds, then `geometry.predicates.shadows`, exactly. A cell whose samples are all in shadow is left out
    from then on.

    Deviations from the papers: on the CPU, all cores; the grid is fitted to the samples; a point light amid its scene
    has six of them, a cube's faces; lists consist of packets of 16 samples, with bounds that are asked before their
    samples are; samples know their own triangles, so there is no bias. Sintorn et al. go on to soft shadows; here a
    light with a size is a number of hard ones.

    Beside `frustum`, which has a tree over the samples instead of a grid: a large triangle asks every cell in its
    shadow, and samples that crowd in few cells ask every triangle over them. Memory is about 50 bytes a sample and 400
    for each packet, at most one for 16 samples and one for each cell in use.

    Options
    -------
    cells
        Cells along each side of the grid, up to 2048; 0 takes as many as give 32 samples to each on average.
    """

    cells: int = 0

    name: ClassVar[str] = "alias-free-map"
    paper: ClassVar[str] = "Sintorn, Eisemann, Assarsson 2008"
    guarantee: ClassVar[Guarantee] = Guarantee.EXACT

    def __post_init__(self) -> None:
        if not 0 <= whole(self.cells, f"{self.name}: cells") <= MOST_CELLS:
            raise OptionError(f"{self.name}: cells: wanted 0 to {MOST_CELLS}, got {self.cells}")

    def prepare(self, scene: Scene, clock: Clock | None = None) -> "AliasFreeMapCaster":
        return AliasFreeMapCaster(scene, self, clock)


class AliasFreeMapCaster(Caster):
    """The triangles in clusters of 16, which are set up together."""

    def __init__(self, scene: Scene, method: AliasFreeMap, clock: Clock | None) -> None:
        require_solid(scene, method.name)
        self.scene, self.method = scene, method
        self.clusters = cluster_triangles(scene, clock)

    def _place(self, scene: Scene, clock: Clock | None) -> None:
        self.scene, self.clusters = scene, moved_clusters(self.clusters, scene, clock)

    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
        self.check(light, samples)
        clock = clock or Clock()
        in_shadow, stats = np.zeros(samples.size, bool), dict[str, int]()
        if len(self.scene.triangles) and samples.size:
            source = light.position.astype(np.float64)
            with clock.span("facing"):
                own = np.zeros(len(self.scene.triangles), np.int8)
                lit = LitClusters(self.scene, self.clusters, source, own)
                lit.find(np.ones(len(self.clusters.corners), bool), clock)
            width = samples.size // samples.shape[0]
            step = max(1, BLOCK // width)
            for start in range(0, samples.shape[0], step):
                block = samples if step >= samples.shape[0] else samples.rows(start, start + step)
                part = in_shadow[start * width : (start + step) * width]
                add_stats(stats, self._shadow_block(source, block, own, lit.sides, part, clock))
        return ShadowMask(in_shadow.reshape(samples.shape), Guarantee.EXACT, stats=stats)

    def _shadow_block(
        self,
        source: NDArray[np.float64],
        samples: ViewSamples,
        own: NDArray[np.int8],
        clustered: NDArray[np.int8],
        in_shadow: NDArray[np.bool_],
        clock: Clock,
    ) -> dict[str, int]:
        """Decide the samples of one band."""
        with clock.span("lists"):
            bounds = bounds_with(self.clusters.bounds, samples)
            largest = float(np.abs(bounds).max())
            on_surface = bool((samples.triangle >= 0).any())
            error = POSITION_ERROR * largest + surface_error(bounds) if on_surface else 0.0
            frames = light_frames(source, bounds, error)
            cells = self.method.cells or min(MOST_CELLS, max(1, int((samples.size / _SAMPLES_PER_CELL) ** 0.5)))
            in_use = min(samples.size, len(frames) * cells * cells + samples.size // 16)
            require(in_use * _BYTES_PER_LEAF + _BYTES_PER_SAMPLE * samples.size, f"shadows by {self.method.name}")
            leaves, lists, grids = build(samples, own, source, frames, (error, 2.0**-50 * largest), cells, in_shadow)
        raw = samples.barycentric.reshape(-1, 2), samples.side.reshape(-1), samples.position.reshape(-1, 3)
        receivers = Receivers(self.scene.positions, self.scene.triangles, source, *leaves[:3], *raw)
        corners, order = self.clusters.corners, self.clusters.order
        asked = [(frame, part) for frame, grid in zip(frames, grids, strict=True) for part in (grid, grid.rest)]
        active = [(frame, grid) for frame, grid in asked if lists.has(grid)]
        step = max(1, min(_CLUSTERS_PER_TASK, -(-len(corners) // (8 * thread_count()))))
        batches = -(-len(corners) // step)

        def draw(number: int) -> NDArray[np.int64]:
            frame, grid = active[number // batches]
            start, stop = number % batches * step, min((number % batches + 1) * step, len(corners))
            stats = np.zeros(len(COUNTERS), np.int64)
            rasterize(corners, order, clustered, frame, grid, start, stop, lists, receivers, stats)
            return stats

        def write(number: int) -> None:
            start, stop = number * _LEAVES_PER_TASK, min((number + 1) * _LEAVES_PER_TASK, len(lists.slots))
            write_out(lists.slots, start, stop, leaves.ids, in_shadow)

        with clock.span("rasterize"):
            done = run(draw, batches * len(active), clock)
        with clock.span("verdicts"):
            run(write, -(-len(lists.slots) // _LEAVES_PER_TASK), clock)
        total = np.sum([np.zeros(len(COUNTERS), np.int64), *done], axis=0)
        counters = {COUNTERS[which]: int(total[which]) for which in _SHOWN}
        return {**counters, "lists_bytes": lists.bytes + leaves.bytes_of(len(lists.slots))}
