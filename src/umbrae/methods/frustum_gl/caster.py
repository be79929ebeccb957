"""The passes of a frame."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.errors import GraphicsError, InputError
from umbrae.geometry.solids import Solids, find_solids
from umbrae.geometry.volume_faces import facing_of_all
from umbrae.gl.compute import clear, dispatch, groups_of
from umbrae.gl.context import Session, session
from umbrae.gl.timers import stage
from umbrae.light import Light
from umbrae.mask import ShadowMask
from umbrae.methods.frustum_gl.exact import decide_pairs
from umbrae.methods.frustum_gl.tiles import tiles_of
from umbrae.methods.frustum_gl.uploaded import Band, GpuShadow, UploadedSamples, camera_of, rows_of_band
from umbrae.methods.method import Caster
from umbrae.samples import ViewSamples
from umbrae.scene import Scene
from umbrae.transmission import transmission_of

HERE = Path(__file__).parent
(
    POSITIONS, TRIANGLES, FACING, OWN, BARYCENTRICS, SIDES, PLACES, BOXES, PRESENT, DARK, FRUSTA, COUNTERS, CASTING,
    QUEUE, UNSURE, VERDICT,
) = range(16)  # fmt: skip
"""Where the shaders find their buffers."""
SOLIDS, CULLED, FOUND = QUEUE, UNSURE, QUEUE
"""Where those find others that use neither of these."""

BATCH = 1 << 17
"""Triangles whose frusta go down together: 25 MB of planes, and no dispatch that takes long."""
FRUSTUM_BYTES = 12 * 16
DECIDERS = 512
"""Groups of 64 that take pairs in turns."""
PAIR_BYTES = 8
PAIRS = 1 << 20
"""Room in the queue, to begin with."""
GROUPS = 4096
"""Of 32 lanes, that take frusta in turns: as many as a large GPU holds at once."""

QUEUED, UNDECIDED, TILE_TESTS, SAMPLE_TESTS, ACCEPTS, REJECTS = 2, 3, 4, 6, 8, 10
"""Counters, as in `frustum.glsl`; the last four are of 64 bits."""
_COUNTER_BYTES = 48
STATS = {
    "tile_frustum_tests": TILE_TESTS,
    "sample_frustum_tests": SAMPLE_TESTS,
    "accepts": ACCEPTS,
    "rejects": REJECTS,
}
_UNSURE_SIDE = 2


class FrustumGlCaster(Caster):
    """A scene's triangles in OpenGL buffers."""

    def __init__(
        self, scene: Scene, silhouette_planes: bool, skip_full: bool, front_face_culling: bool, clock: Clock | None
    ) -> None:
        clock = clock or Clock()
        if transmission_of(scene) is not None:
            raise InputError(
                "frustum-gl: materials of this scene let light through, which it does not serve; the method `frustum` "
                "does"
            )
        self.scene = scene
        self.session: Session = session()
        self._outlines = {"SILHOUETTE_PLANES": 1} if silhouette_planes else {}
        self._skips = {"SKIP_FULL": 1} if skip_full else {}
        self._solids: Solids | None = None
        if front_face_culling and len(scene.triangles):
            with clock.span("solids"):
                self._solids = find_solids(scene.positions, scene.triangles, np.ones(len(scene.triangles), bool))
        self._reach = float(np.abs(scene.bounds).max())
        self._room = PAIRS
        self._scratch: dict[int, Any] = {}
        with self.session.current() as current:
            self._most = current.integer("GL_MAX_SHADER_STORAGE_BLOCK_SIZE")
            for name, array in (("vertices", scene.positions), ("triangles", scene.triangles)):
                if array.nbytes > self._most:
                    raise GraphicsError(
                        f"frustum-gl: {len(array)} {name} need {array.nbytes} bytes in one buffer, this OpenGL driver "
                        f"takes {self._most}; the method `frustum` needs no such buffer"
                    )
            self._soup = {POSITIONS: self._buffer(scene.positions), TRIANGLES: self._buffer(scene.triangles)}
            self._solid_of = None if self._solids is None else self._buffer(self._solids.of)

    def shadow(self, light: Light, samples: ViewSamples, clock: Clock | None = None) -> ShadowMask:
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
        step = rows_of_band(camera, samples.size // (camera.width * camera.height), self._most)
        starts = range(0, camera.height, step) if len(self.scene.triangles) else ()
        with self.session.current() as current, stage(current, clock or Clock(), "upload"):
            bands = tuple(self._band(samples, camera, top, top + step) for top in starts)
        return UploadedSamples(samples, camera, bands)

    def shadow_on_gpu(self, light: Light, uploaded: UploadedSamples, clock: Clock | None = None) -> GpuShadow:
        """The verdicts about samples that this caster has uploaded, left in OpenGL buffers."""
        clock = clock or Clock()
        stats = dict.fromkeys((*STATS, "fallbacks", "predicate_fallbacks"), 0)
        verdicts = []
        with self.session.current() as current:
            if uploaded.bands:
                with stage(current, clock, "facing"):
                    self._face(light)
            for band in uploaded.bands:
                with stage(current, clock, "hierarchy"):
                    self._build(band)
                pairs = self._cast(light, uploaded.camera, band, stats, clock)
                with clock.span("exact"):
                    found = self._decide(light, band, pairs)
                with stage(current, clock, "merge"):
                    verdicts.append(self._merge(band, found))
        return GpuShadow(self.session, uploaded, tuple(verdicts), stats)

    def _band(self, samples: ViewSamples, camera: Camera, top: int, bottom: int) -> Band:
        """Rows of a picture, and their places."""
        part = samples.rows(top, bottom)
        height, width = part.shape[:2]
        per_pixel = part.size // (height * width)
        tiles = tiles_of(width, height, per_pixel)
        sides = np.zeros(-(-part.size // 4) * 4, np.int8)
        sides[: part.size] = part.side.reshape(-1)
        own = np.where(part.covered, part.triangle, np.int32(-1))
        places = self.session.moderngl.buffer(reserve=16 * tiles.places)
        made = Band(
            part, top * width * per_pixel, tiles, self._buffer(own), self._buffer(part.barycentric),
            self._buffer(sides), places,
        )  # fmt: skip
        uniforms = {**self._view(camera), **tiles.uniforms, "count": tiles.places}
        buffers = {OWN: made.own, BARYCENTRICS: made.barycentrics, PLACES: places}
        self._run("place", groups_of(tiles.places), uniforms, buffers)
        return made

    def _face(self, light: Light) -> None:
        """The side of every triangle; exact arithmetic decides what float64 leaves open."""
        count = len(self.scene.triangles)
        sides, counters = self._room_for(FACING, 4 * count), self._counters()
        buffers = {FACING: sides, COUNTERS: counters}
        if self._solids is not None:
            low, high, source = self._solids.lower, self._solids.upper, light.position.astype(np.float64)
            holds_light = ((source[:3] >= low) & (source[:3] <= high)).all(axis=1) & (not light.is_directional)
            buffers |= {SOLIDS: self._solid_of, CULLED: self._buffer((~holds_light).astype(np.uint32))}
        uniforms = {"light": tuple(light.position.tolist()), "count": count}
        self._run("facing", groups_of(count), uniforms, buffers, {} if self._solids is None else {"CULL": 1})
        if self._count(counters)[UNDECIDED]:
            found = np.frombuffer(sides.read(4 * count), np.int32).copy()
            unsure = np.flatnonzero(found == _UNSURE_SIDE)
            found[unsure] = facing_of_all(self.scene.positions, self.scene.triangles[unsure], light.position)
            sides.write(found.tobytes())

    def _build(self, band: Band) -> None:
        """The tree, from the leaves up, and no shadow in it."""
        tiles = band.tiles
        buffers = {
            FACING: self._scratch[FACING],
            SIDES: band.sides,
            PLACES: band.places,
            BOXES: self._room_for(BOXES, 32 * tiles.nodes),
            PRESENT: self._room_for(PRESENT, 4 * tiles.words),
        }
        for level in range(1, tiles.depth + 1):
            leaves = {"LEAVES": 1} if level == 1 else {}
            self._run("hierarchy", groups_of(tiles.count(level)), {**tiles.uniforms, "level": level}, buffers, leaves)
        clear(self.session, self._room_for(DARK, 4 * tiles.words))

    def _cast(self, light: Light, camera: Camera, band: Band, stats: dict[str, int], clock: Clock) -> NDArray[np.int32]:
        """Send all frusta down the tree; returns the pairs `(p, 2)` of sample and triangle that are still open."""
        start, step, count = 0, BATCH, len(self.scene.triangles)
        uniforms = {
            **self._view(camera), **band.tiles.uniforms, "light": tuple(light.position.tolist()), "reach": self._reach
        }  # fmt: skip
        left: list[NDArray[np.int32]] = []
        while start < count:
            size = min(step, count - start)
            counters = self._cast_batch(start, size, uniforms, band, clock)
            if (queued := int(counters[QUEUED])) > self._room:
                # Once more with room for all; what is found again is found for good.
                if queued * PAIR_BYTES <= self._most:
                    self._room = min(2 * queued, self._most // PAIR_BYTES)
                else:
                    step = max(1, size // 2)  # a single triangle has no more pairs than there are samples
                continue
            start += size
            for name, at in STATS.items():
                stats[name] += int(counters[at]) + (int(counters[at + 1]) << 32)
            stats["fallbacks"] += queued
            if unsure := int(counters[UNDECIDED]):
                pairs = np.frombuffer(self._scratch[UNSURE].read(PAIR_BYTES * unsure), np.int32)
                left.append(pairs.reshape(-1, 2))
                stats["predicate_fallbacks"] += unsure
        return np.concatenate(left) if left else np.zeros((0, 2), np.int32)

    def _cast_batch(
        self, first: int, count: int, uniforms: Mapping[str, Any], band: Band, clock: Clock
    ) -> NDArray[np.uint32]:
        """Set up and send down the frusta of some triangles; returns the counters."""
        scratch = self._scratch
        counters, room = self._counters(), {"room": self._room}
        made = {
            BOXES: scratch[BOXES],
            COUNTERS: counters,
            FRUSTA: self._room_for(FRUSTA, FRUSTUM_BYTES * count),
            CASTING: self._room_for(CASTING, 4 * count),
        }
        with stage(self.session, clock, "setup"):
            buffers = {**made, FACING: scratch[FACING]}
            self._run("setup", groups_of(count), {**uniforms, "first": first, "count": count}, buffers, self._outlines)
        queue = self._room_for(QUEUE, PAIR_BYTES * self._room)
        with stage(self.session, clock, "traversal"):
            buffers = {
                **made, PLACES: band.places, PRESENT: scratch[PRESENT], DARK: scratch[DARK], QUEUE: queue
            }  # fmt: skip
            self._run("traversal", min(GROUPS, count), {**uniforms, **room}, buffers, {**self._outlines, **self._skips})
        with stage(self.session, clock, "decide"):
            buffers = {
                OWN: band.own, BARYCENTRICS: band.barycentrics, DARK: scratch[DARK], COUNTERS: counters, QUEUE: queue,
                UNSURE: self._room_for(UNSURE, PAIR_BYTES * self._room),
            }  # fmt: skip
            self._run("decide", DECIDERS, {**uniforms, **room}, buffers)
        return self._count(counters)

    def _decide(self, light: Light, band: Band, pairs: NDArray[np.int32]) -> NDArray[np.int32]:
        """The samples of a band, `(n,) int32`, that are in shadow by pairs left open."""
        samples, found = band.samples, np.zeros(len(pairs), bool)
        if len(pairs):
            decide_pairs(
                self.scene.positions, self.scene.triangles, light.position.astype(np.float64),
                samples.triangle.reshape(-1), samples.barycentric.reshape(-1, 2), samples.side.reshape(-1), pairs, found,
            )  # fmt: skip
        return np.unique(pairs[found, 0])

    def _merge(self, band: Band, found: NDArray[np.int32]) -> Any:
        """A buffer with a byte for each sample."""
        tiles, size = band.tiles, -(-band.samples.size // 4) * 4
        words = {DARK: self._scratch[DARK], PRESENT: self._scratch[PRESENT]}
        for level in reversed(range(1, tiles.depth)):
            self._run("merge", groups_of(tiles.count(level)), {**tiles.uniforms, "level": level}, words)
        verdict = self.session.moderngl.buffer(reserve=size)
        uniforms = {**tiles.uniforms, "count": band.samples.size}
        self._run("merge", groups_of(size // 4), uniforms, {**words, OWN: band.own, VERDICT: verdict}, {"VERDICTS": 1})
        if len(found):
            buffers = {FOUND: self._buffer(found), VERDICT: verdict}
            self._run("mark", groups_of(len(found)), {"count": len(found)}, buffers)
        return verdict

    def _view(self, camera: Camera) -> dict[str, Any]:
        """The camera for `place.glsl` and `setup.glsl`. q is 1 at a distance that nothing exceeds by much."""
        rows = camera.world_to_clip[:, :3]
        farthest = float(np.abs(camera.eye).max()) + self._reach
        return {
            "eye": tuple(camera.eye.tolist()),
            "rows": [tuple(row) for row in rows.tolist()],
            "columns": [tuple(column) for column in np.linalg.inv(rows).T.tolist()],
            "unit": 2.0 ** math.frexp(farthest)[1],
        }

    def _run(
        self,
        name: str,
        groups: int,
        uniforms: Mapping[str, Any],
        buffers: Mapping[int, Any],
        defines: Mapping[str, int | str] | None = None,
    ) -> None:
        dispatch(self.session, HERE / f"{name}.glsl", groups, uniforms, {**self._soup, **buffers}, defines)

    def _buffer(self, values: NDArray[Any]) -> Any:
        """A buffer with these values; never empty, which OpenGL does not allow."""
        return self.session.moderngl.buffer(np.ascontiguousarray(values).tobytes() or bytes(4))

    def _room_for(self, binding: int, size: int) -> Any:
        """A buffer of at least that size, kept from call to call."""
        kept = self._scratch.get(binding)
        if kept is None or kept.size < size:
            kept = self._scratch[binding] = self.session.moderngl.buffer(reserve=max(size, 4))
        return kept

    def _counters(self) -> Any:
        """All counters at zero."""
        counters = self._room_for(COUNTERS, _COUNTER_BYTES)
        clear(self.session, counters)
        return counters

    def _count(self, counters: Any) -> NDArray[np.uint32]:
        return np.frombuffer(counters.read(_COUNTER_BYTES), np.uint32)
