"""The shadow algorithms, one visible line each."""

import dataclasses
import difflib
from typing import Any

from umbrae.checks import instance, shown
from umbrae.clock import Clock
from umbrae.errors import OptionError
from umbrae.light import Light
from umbrae.mask import ShadowMask
from umbrae.methods.alias_free_map import AliasFreeMap
from umbrae.methods.area_average import cast_shadow
from umbrae.methods.frustum_cpu import Frustum
from umbrae.methods.frustum_gl.method import FrustumGl
from umbrae.methods.method import Caster, Method
from umbrae.methods.oracle import Oracle
from umbrae.methods.shadow_map.method import ShadowMap
from umbrae.methods.smooth.cpu import Smooth
from umbrae.methods.smooth.gl import SmoothGl
from umbrae.methods.volumes.robust_gs import RobustGs
from umbrae.methods.volumes.silhouette_compute import SilhouetteCompute
from umbrae.methods.volumes.silhouette_cpu import SilhouetteCpu
from umbrae.methods.volumes.silhouette_gs import SilhouetteGs
from umbrae.methods.volumes.silhouette_ts import SilhouetteTs
from umbrae.methods.volumes.triangle_gs import TriangleGs
from umbrae.methods.volumes.triangle_ts import TriangleTs
from umbrae.methods.volumes.triangle_ts_single import TriangleTsSingle
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

METHODS: dict[str, type[Method]] = {
    "oracle": Oracle,
    "frustum": Frustum,
    "frustum-gl": FrustumGl,
    "alias-free-map": AliasFreeMap,
    "smooth": Smooth,
    "smooth-gl": SmoothGl,
    "silhouette-cpu": SilhouetteCpu,
    "silhouette-compute": SilhouetteCompute,
    "silhouette-gs": SilhouetteGs,
    "silhouette-ts": SilhouetteTs,
    "robust-gs": RobustGs,
    "triangle-gs": TriangleGs,
    "triangle-ts": TriangleTs,
    "triangle-ts-single": TriangleTsSingle,
    "shadow-map": ShadowMap,
}

__all__ = ["METHODS", "Caster", "Method", "cast_shadow", "make_method", "shadow"]


def make_method(method: str | Method, **options: Any) -> Method:
    """A method by name, with options by name; or one as it is, but for the options given.

    Raises
    ------
    OptionError
        For an unknown method, an option that it does not have, or a value that it does not take.
    """
    if isinstance(method, Method):
        known = method.options()
        for name in options:
            if name not in known:
                has = f"it has: {', '.join(known)}" if known else "it has none"
                raise OptionError(f"method {method.name} has no option {name} ({has})")
        return dataclasses.replace(method, **options) if options else method
    if not isinstance(method, str):
        raise OptionError(f"method: wanted a name or a Method object, got {shown(method)}")
    if method not in METHODS:
        near = difflib.get_close_matches(str(method), METHODS, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise OptionError(f"unknown method {method!r}{hint} (known: {', '.join(METHODS)})")
    return make_method(METHODS[method](), **options)


def shadow(
    scene: Scene,
    light: Light,
    samples: ViewSamples,
    method: str | Method = "frustum",
    clock: Clock | None = None,
) -> ShadowMask:
    """Decide for every sample whether it lies in the shadow that the scene casts from the light.

    Parameters
    ----------
    method
        A name from `METHODS`, or a `Method` with its options set.
    clock
        Hears which stage takes how long.

    Raises
    ------
    InputError
        For anything but a scene, a light and samples, or samples that were made for another scene.
    OptionError
        For an unknown method.
    """
    clock = clock or Clock()
    for value, kind, name in ((scene, Scene, "scene"), (light, Light, "light"), (samples, ViewSamples, "samples")):
        instance(value, kind, name)
    algorithm = make_method(method)
    with clock.span("prepare"):
        caster = algorithm.prepare(scene, clock)
    with clock.span("shadow"):
        return cast_shadow(algorithm, caster, light, samples, clock)
