"""The comparators: shadow rays through Embree, by Mitsuba 3 on all cores and by embreex on one."""

from functools import lru_cache
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.bench.runner import Runner
from umbrae.bench.scenes import extent
from umbrae.clock import Clock
from umbrae.console import one_line
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.parallel import thread_count
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

OFFSET = 1e-6
"""How far a ray starts off its surface, as a share of the scene's extent: without it, rays hit where they start."""


class RayCaster(Runner[Any]):
    """One ray from every covered sample to the light, which is in shadow when anything is hit."""

    def set_geometry(self, scene: Scene) -> None:
        self._scene = scene
        self._normals = _normals(scene)

    def set_samples(self, samples: ViewSamples) -> None:
        self._covered = samples.covered
        own = samples.triangle[samples.covered]
        step = samples.side[samples.covered].astype(np.float32) * np.float32(OFFSET * extent(self._scene))
        # Towards the side that is seen, as renderers do: a step towards the light goes through thin walls.
        self._take_origins(samples.position[samples.covered] + step[:, None] * self._normals[own])

    def mask(self, answer: Any) -> ShadowMask:
        in_shadow = np.zeros(self._covered.shape, bool)
        in_shadow[self._covered] = np.asarray(answer)
        return ShadowMask(in_shadow, Guarantee.NONE)

    def _take_origins(self, origins: NDArray[np.float32]) -> None:
        raise NotImplementedError


class MitsubaRunner(RayCaster):
    """Embree in packets on all threads, through Mitsuba's `llvm_ad_rgb`; positions, indices and origins uploaded."""

    name = "mitsuba"

    def unavailable(self) -> str | None:
        if find_spec("mitsuba") is None:
            return "mitsuba is not installed: pip install 'umbrae[bench]'"
        try:
            _mitsuba()
        except ImportError as error:
            if "LLVM" in str(error):
                return "mitsuba needs libLLVM: apt install libllvm15, or name the file in DRJIT_LIBLLVM_PATH"
            return f"mitsuba cannot be imported: {one_line(str(error))}"
        return None

    def set_geometry(self, scene: Scene) -> None:
        mi, dr = _mitsuba()
        super().set_geometry(scene)
        self._tree: Any = None
        self._mesh = mi.Mesh("mesh", len(scene.positions), len(scene.triangles))
        arrays = mi.traverse(self._mesh)
        arrays["vertex_positions"] = scene.positions.ravel()
        arrays["faces"] = scene.triangles.ravel().astype(np.uint32)
        arrays.update()
        dr.sync_thread()
        dr.flush_malloc_cache()

    def prepare(self, clock: Clock) -> None:
        mi, dr = _mitsuba()
        self._tree = mi.load_dict({"type": "scene", "mesh": self._mesh})
        dr.sync_thread()

    def shadow(self, light: Light, clock: Clock) -> Any:
        mi, dr = _mitsuba()
        if self._rays == 0:
            return np.zeros(0, bool)  # Mitsuba aborts the process on empty arrays
        towards = mi.Vector3f(light.position[:3].tolist())
        dr.make_opaque(towards)  # an argument, not a constant of the compiled kernel
        point = not light.is_directional
        direction = towards - self._origins if point else towards
        ray = mi.Ray3f(o=self._origins, d=direction, maxt=1.0 if point else np.inf, time=0.0, wavelengths=[])
        assert self._tree is not None
        hit = self._tree.ray_test(ray)
        dr.eval(hit)
        dr.sync_thread()
        return hit

    def _take_origins(self, origins: NDArray[np.float32]) -> None:
        mi, dr = _mitsuba()
        self._rays = len(origins)
        self._origins = mi.Point3f(np.ascontiguousarray(origins.T))
        dr.eval(self._origins)
        dr.sync_thread()


class EmbreexRunner(RayCaster):
    """Embree ray by ray on one thread, through embreex and NumPy; the tree is built on all."""

    name = "embreex"

    def unavailable(self) -> str | None:
        if find_spec("embreex") is None:
            return "embreex is not installed: pip install 'umbrae[bench]'"
        return None

    def set_geometry(self, scene: Scene) -> None:
        super().set_geometry(scene)
        self._tree: Any = None

    def prepare(self, clock: Clock) -> None:
        from embreex import rtcore_scene
        from embreex.mesh_construction import TriangleMesh

        self._tree = rtcore_scene.EmbreeScene()
        TriangleMesh(self._tree, self._scene.positions, self._scene.triangles)
        # The first query builds the tree.
        one = np.ones((1, 3), np.float32)
        self._tree.run(one, one, query="OCCLUDED")

    def shadow(self, light: Light, clock: Clock) -> NDArray[np.bool_]:
        assert self._tree is not None
        directions = light.position[:3] - light.position[3] * self._origins
        far = np.full(len(directions), np.inf if light.is_directional else 1.0, np.float32)
        hit: NDArray[np.bool_] = self._tree.run(self._origins, directions, far, query="OCCLUDED") >= 0
        return hit

    def _take_origins(self, origins: NDArray[np.float32]) -> None:
        self._origins = origins


@lru_cache(maxsize=1)
def _mitsuba() -> tuple[Any, Any]:
    import mitsuba

    mitsuba.set_variant("llvm_ad_rgb")
    import drjit

    drjit.set_thread_count(thread_count())
    return mitsuba, drjit


def _normals(scene: Scene) -> NDArray[np.float32]:
    """`(t, 3)` unit normals; zeros for triangles without area."""
    a, b, c = (scene.positions[scene.triangles[:, corner]].astype(np.float64) for corner in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    unit: NDArray[np.float32] = (normal / np.where(length > 0, length, 1)).astype(np.float32)
    return unit
