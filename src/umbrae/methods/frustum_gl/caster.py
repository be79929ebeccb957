"""A frame: what is done once, for each band of a picture, and for each batch of triangles."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.errors import InputError
from umbrae.geometry.solids import Solids, find_solids
from umbrae.geometry.volume_faces import facing_of_all
from umbrae.gl.context import Session, session
from umbrae.gl.queries import stage
from umbrae.light import Light
from umbrae.mask import ShadowMask
from umbrae.methods.frustum_gl.exact import decide_pairs, shares_of_pairs
from umbrae.methods.frustum_gl.passes import MOST_TASKS, PAIR_BYTES, Defines, Passes
from umbrae.methods.frustum_gl.tiles import tiles_of
from umbrae.methods.frustum_gl.uploaded import Band, GpuShadow, UploadedSamples, camera_of, rows_of_band
from umbrae.methods.method import Caster
from umbrae.samples import ViewSamples
from umbrae.scene import Scene
from umbrae.transmission import EVEN, SOLID, VARYING, Transmission, transmission_of

BATCH = 1 << 17
"""Triangles whose frusta go down together: 25 MB of planes, and no dispatch that takes long."""
ROOM = 1 << 20
"""For tasks, and for pairs, to begin with."""
_UNSURE = 2


class FrustumGlCaster(Caster):
    """A scene's triangles on the GPU."""

    def __init__(
        self, scene: Scene, silhouette_planes: bool, skip_full: bool, front_face_culling: bool, clock: Clock | None
    ) -> None:
        clock = clock or Clock()
        self.scene = scene
        self.session: Session = session()
        self.table = transmission_of(scene)
        self._outlines: Defines = {"SILHOUETTE_PLANES": 1} if silhouette_planes else {}
        self._skips: Defines = {"SKIP_FULL": 1} if skip_full else {}
        self._solids: Solids | None = None
        if front_face_culling and len(scene.triangles):
            with clock.span("solids"):
                solid = np.ones(len(scene.triangles), bool) if self.table is None else self.table.kind == SOLID
                self._solids = find_solids(scene.positions, scene.triangles, solid)
        self._reach = float(np.abs(scene.bounds).max())
        self._batch, self._room = BATCH, ROOM
        with self.session.current() as current:
            self.passes = Passes(current, scene, self.table)
            self._solid_of = None if self._solids is None else self.passes.buffer(self._solids.of)

    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
        self.check(light, samples)
        return self.shadow_on_gpu(light, self.upload(samples, clock), clock).mask(clock)

    def upload(self, samples: ViewSamples, clock: Clock | None = None) -> UploadedSamples:
        """A picture's samples in OpenGL buffers, for any number of lights.

        Raises
        ------
        InputError
            For samples of another scene, anything but a whole picture, and points on no triangle.
        GraphicsError
            For a picture of which the driver has no room for a row.
        """
        samples.check(self.scene)
        camera = camera_of(samples)
        step = rows_of_band(camera, samples.size // (camera.width * camera.height), self.passes.most)
        starts = range(0, camera.height, step) if len(self.scene.triangles) else ()
        with self.session.current() as current, stage(current, clock or Clock(), "upload"):
            bands = tuple(self._band(samples, camera, top, top + step) for top in starts)
        return UploadedSamples(self, samples, camera, bands)

    def shadow_on_gpu(self, light: Light, uploaded: UploadedSamples, clock: Clock | None = None) -> GpuShadow:
        """The verdicts about samples that this caster has uploaded, left in OpenGL buffers."""
        if uploaded.caster is not self:
            raise InputError("frustum-gl: these samples were uploaded by another caster")
        clock = clock or Clock()
        names = "tile_frustum_tests", "sample_frustum_tests", "accepts", "rejects", "fallbacks", "predicate_fallbacks"
        stats = dict.fromkeys(names, 0)
        merged = []
        with self.session.current() as current:
            if uploaded.bands:
                with stage(current, clock, "facing"):
                    self._face(light)
            for band in uploaded.bands:
                with stage(current, clock, "hierarchy"):
                    self.passes.build(band)
                pairs = self._cast(light, uploaded.camera, band, False, stats, clock)
                if self.table is not None:
                    more = self._cast(light, uploaded.camera, band, True, stats, clock)
                    pairs = np.concatenate([pairs, more, self._on_own_edges(self.table, band)])
                with clock.span("exact"):
                    found = self._decide(light, band, pairs)
                with stage(current, clock, "merge"):
                    merged.append(self.passes.merge(band, *found))
        partial = () if self.table is None else tuple(shares for _, shares in merged)
        return GpuShadow(self.session, uploaded, tuple(verdict for verdict, _ in merged), partial, stats)

    def _band(self, samples: ViewSamples, camera: Camera, top: int, bottom: int) -> Band:
        """Rows of a picture, and their places."""
        part = samples.rows(top, bottom)
        height, width = part.shape[:2]
        tiles = tiles_of(width, height, part.size // (height * width))
        sides = np.zeros(-(-part.size // 4) * 4, np.int8)
        sides[: part.size] = part.side.reshape(-1)
        buffer = self.passes.buffer
        made = Band(
            samples=part,
            first=top * (part.size // height),
            tiles=tiles,
            own=buffer(np.where(part.covered, part.triangle, np.int32(-1))),
            barycentrics=buffer(part.barycentric),
            sides=buffer(sides),
            places=self.passes.reserve(16 * tiles.places),
        )
        self.passes.place(made, self._view(camera))
        return made

    def _face(self, light: Light) -> None:
        """The side of every triangle; exact arithmetic decides what float64 leaves open."""
        count, culling = len(self.scene.triangles), None
        if self._solids is not None:
            source = light.position.astype(np.float64)
            holds_light = ((source[:3] >= self._solids.lower) & (source[:3] <= self._solids.upper)).all(axis=1)
            culling = self._solid_of, np.asarray(~holds_light | light.is_directional)
        if self.passes.face(count, {"light": _source(light)}, culling):
            sides = self.passes.sides(count)
            unsure = np.flatnonzero(sides == _UNSURE)
            sides[unsure] = facing_of_all(self.scene.positions, self.scene.triangles[unsure], light.position)
            self.passes.set_sides(sides)

    def _cast(
        self, light: Light, camera: Camera, band: Band, see_through: bool, stats: dict[str, int], clock: Clock
    ) -> NDArray[np.int32]:
        """Send the frusta down the tree, of the casters that let light through or of the others.

        Returns the pairs `(p, 2)` of a sample and a triangle that float64 leaves open.
        """
        uniforms = {
            **self._view(camera), **band.tiles.uniforms, "light": _source(light), "reach": self._reach,
            "see_through": see_through,
        }  # fmt: skip
        through: Defines = {"SEE_THROUGH": 1} if see_through else {}
        start, count = 0, len(self.scene.triangles)
        left: list[NDArray[np.int32]] = []
        counted: list[dict[str, int]] = []
        while start < count:
            size = min(self._batch, count - start)
            with stage(self.session, clock, "setup"):
                self.passes.set_up(size, {**uniforms, "first": start}, self._outlines)
            with stage(self.session, clock, "traversal"):
                self.passes.traverse(band, self._room, uniforms, {**self._outlines, **self._skips, **through})
            with stage(self.session, clock, "decide"):
                self.passes.decide(band, self._room, uniforms, through)
            tasks, queued, pairs, tests = self.passes.counted()
            if (wanted := max(tasks, queued)) > self._room:
                self._make_room(wanted, size)
                # From the beginning: what was let through must not count twice.
                start = 0
                left.clear()
                counted.clear()
                if see_through:
                    self.passes.clear_sums(band)
                continue
            start += size
            left.append(pairs)
            counted.append({**tests, "fallbacks": queued, "predicate_fallbacks": len(pairs)})
        for name in stats:
            stats[name] += sum(tests[name] for tests in counted)
        return np.concatenate(left)

    def _make_room(self, wanted: int, size: int) -> None:
        """For as many tasks or pairs as a batch of that size wants; a single triangle has no more than samples."""
        most = min(self.passes.most // PAIR_BYTES, MOST_TASKS)
        if wanted <= most:
            self._room = min(2 * wanted, most)
        else:
            self._room, self._batch = most, max(1, size // 2)

    def _decide(
        self, light: Light, band: Band, pairs: NDArray[np.int32]
    ) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """The samples of a band, `(n,)`, that exact arithmetic finds shadowed, and what arrives there, `(n, 3)`."""
        if not len(pairs):
            return np.zeros(0, np.int32), np.zeros((0, 3), np.float32)
        scene, samples, source = self.scene, band.samples, light.position.astype(np.float64)
        own, uv, side = samples.triangle.reshape(-1), samples.barycentric.reshape(-1, 2), samples.side.reshape(-1)
        closed, found = np.ones(len(pairs), bool), np.zeros(len(pairs), bool)
        if self.table is not None:
            closed = (self.table.kind == SOLID)[pairs[:, 1]] | self.table.closed[scene.material_id[pairs[:, 1]]]
        decide_pairs(scene.positions, scene.triangles, source, own, uv, side, pairs, closed, found)
        pairs, shares = pairs[found], np.zeros((int(found.sum()), 3))
        if self.table is not None:
            shares_of_pairs(scene.positions, scene.triangles, self.table, source, own, uv, pairs, shares)
        shadowed, at = np.unique(pairs[:, 0], return_inverse=True)
        product = np.ones((len(shadowed), 3))
        np.multiply.at(product, at, shares)
        return shadowed, product.astype(np.float32)

    def _on_own_edges(self, table: Transmission, band: Band) -> NDArray[np.int32]:
        """The pairs `(p, 2)` of samples on an edge of their own triangle with it, where the edge may not be its own."""
        samples = band.samples
        own, (u, v) = samples.triangle.reshape(-1), samples.barycentric.reshape(-1, 2).T
        on_edge = (u == 0) | (v == 0) | (u.astype(np.float64) + v == 1)
        index = np.flatnonzero(samples.covered.reshape(-1) & (own >= 0) & on_edge)
        through = np.isin(table.kind, (EVEN, VARYING)) & ~table.closed[table.material_id]
        index = index[through[own[index]]]
        return np.stack([index, own[index]], axis=1).astype(np.int32)

    def _view(self, camera: Camera) -> dict[str, Any]:
        """The camera for `place.glsl` and `setup.glsl`; q is 1 at a distance that nothing exceeds by much."""
        rows = camera.world_to_clip[:, :3]
        farthest = float(np.abs(camera.eye).max()) + self._reach
        return {
            "eye": tuple(camera.eye.tolist()),
            "rows": [tuple(row) for row in rows.tolist()],
            "columns": [tuple(column) for column in np.linalg.inv(rows).T.tolist()],
            "unit": 2.0 ** math.frexp(farthest)[1],
        }


def _source(light: Light) -> tuple[float, ...]:
    return tuple(light.position.astype(np.float64).tolist())
