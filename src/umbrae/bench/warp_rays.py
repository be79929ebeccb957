"""A comparator on the GPU: shadow rays through the tree of NVIDIA Warp."""

import math
from functools import lru_cache
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.bench.embree import RayCaster
from umbrae.clock import Clock
from umbrae.console import one_line
from umbrae.light import Light
from umbrae.scene import Scene


class WarpRunner(RayCaster):
    """NVIDIA Warp's `mesh_query_ray_anyhit`, one thread a ray; positions, indices and origins uploaded.

    Parameters
    ----------
    device
        Warp's name of where it runs. Its `cpu` traces one ray after the other, which is no comparison.
    """

    name = "warp"

    def __init__(self, device: str = "cuda:0") -> None:
        self._device = device

    def unavailable(self) -> str | None:
        if find_spec("warp") is None:
            return "warp is not installed: pip install 'umbrae[cuda]'"
        try:
            wp, _ = _warp()
        except (ImportError, AttributeError, RuntimeError) as error:
            return f"warp cannot be used: {one_line(str(error))}"
        if self._device not in (str(device) for device in wp.get_devices()):
            return f"warp finds no device {self._device}: it needs an NVIDIA GPU and its driver"
        return None

    def options(self) -> dict[str, Any]:
        return {"device": self._device}

    def set_geometry(self, scene: Scene) -> None:
        wp, _ = _warp()
        super().set_geometry(scene)
        self._tree: Any = None
        self._points = wp.array(scene.positions, dtype=wp.vec3, device=self._device)
        self._indices = wp.array(scene.triangles.reshape(-1).astype(np.int32), dtype=wp.int32, device=self._device)
        wp.synchronize_device(self._device)

    def prepare(self, clock: Clock) -> None:
        wp, _ = _warp()
        # Warp takes no mesh without triangles.
        self._tree = wp.Mesh(points=self._points, indices=self._indices) if len(self._scene.triangles) else None
        wp.synchronize_device(self._device)

    def shadow(self, light: Light, clock: Clock) -> Any:
        wp, kernel = _warp()
        if self._rays and self._tree is not None:
            farthest = math.inf if light.is_directional else 1.0
            inputs = [self._tree.id, self._origins, wp.vec4(*light.position.tolist()), farthest]
            wp.launch(kernel, self._rays, inputs, [self._hit], device=self._device)
        wp.synchronize_device(self._device)
        return _Hits(self._hit)

    def _take_origins(self, origins: NDArray[np.float32]) -> None:
        wp, _ = _warp()
        self._rays = len(origins)
        self._origins = wp.array(np.ascontiguousarray(origins), dtype=wp.vec3, device=self._device)
        self._hit = wp.zeros(self._rays, dtype=wp.bool, device=self._device)
        wp.synchronize_device(self._device)


class _Hits:
    """What was hit, on the device until it is asked for."""

    def __init__(self, array: Any) -> None:
        self._array = array

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[np.bool_]:
        found: NDArray[np.bool_] = self._array.numpy().astype(bool)
        return found


@lru_cache(maxsize=1)
def _warp() -> tuple[Any, Any]:
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    wp.init()

    @wp.kernel  # type: ignore[untyped-decorator]
    def any_hit(  # type: ignore[no-untyped-def]
        mesh: wp.uint64,
        origins: wp.array(dtype=wp.vec3),  # type: ignore[valid-type]
        light: wp.vec4,
        farthest: float,
        hit: wp.array(dtype=wp.bool),  # type: ignore[valid-type]
    ):
        i = wp.tid()
        origin = origins[i]
        direction = wp.vec3(light[0], light[1], light[2]) - light[3] * origin
        hit[i] = wp.mesh_query_ray_anyhit(mesh, origin, direction, farthest)

    return wp, any_hit
