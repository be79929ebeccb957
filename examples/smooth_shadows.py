"""Shadows that do not show how coarse a mesh is, and what goes wrong with simpler ways to get them.

After Figures 1, 4, 5, 7 and 11 of Mattausch, Scherzer, Wimmer, Igarashi 2012. Needs OpenGL.
"""

import dataclasses
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

import umbrae as um
from umbrae.geometry.tessellation import tessellate
from umbrae.methods.smooth.gl import SmoothGl, SmoothVolumes
from umbrae.methods.volumes.engine import Frame
from umbrae.models.builder import Builder
from umbrae.models.sphere_scene import sphere
from umbrae.shade import shade

Pixels = NDArray[np.uint8]
COLORS = {"floor": (0.66, 0.64, 0.6), "red": (0.75, 0.3, 0.22), "blue": (0.27, 0.42, 0.6), "ochre": (0.8, 0.6, 0.3)}
DISCRETE, ACCURATE, PHONG, SMOOTH = (
    um.METHODS["smooth"](silhouette=silhouette) for silhouette in ("discrete", "accurate", "phong", "smooth")
)


def ground() -> Builder:
    """A floor to put things on."""
    build = Builder([um.Material((*color, 1.0), name=name) for name, color in COLORS.items()])
    build.quad([(-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)], "floor")
    return build


def ball(build: Builder, center: tuple[float, float, float], segments: int, rings: int, color: str = "red") -> None:
    """A sphere of radius 1."""
    mesh = sphere(segments=segments, rings=rings)
    build.smooth(mesh.positions + np.array(center), mesh.triangles, color, mesh.normals)


def torus(build: Builder, center: tuple[float, float, float], around: int, through: int, color: str) -> None:
    """An upright ring."""
    a, b = np.meshgrid(2 * np.pi * np.arange(around) / around, 2 * np.pi * np.arange(through) / through, indexing="ij")
    normals = np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)], axis=2)
    points = np.stack([np.cos(a), np.sin(a), 0 * a], axis=2) + 0.4 * normals
    number = np.arange(around * through).reshape(around, through)
    beside, above = np.roll(number, -1, axis=0), np.roll(number, -1, axis=1)
    both = np.roll(beside, -1, axis=1)
    triangles = np.stack([number, beside, both, number, both, above], axis=2).reshape(-1, 3)
    build.smooth(points.reshape(-1, 3) + center, triangles, color, normals.reshape(-1, 3))


def side_by_side(name: str, *pictures: Pixels) -> None:
    """Save pictures next to each other."""
    um.Image(np.concatenate(pictures, axis=1)).save(f"smooth_{name}.png")


def shapes(fine: int) -> um.Scene:
    """A sphere, a torus and a cylinder, whose ends are creases, from so many times as many pieces."""
    build = ground()
    ball(build, (-2.6, 1.3, 0.3), 10 * fine, 6 * fine)
    torus(build, (0.3, 1.6, 0.0), 12 * fine, 7 * fine, "blue")
    build.lathe([(0.8, 0.0), (0.8, 2.0)], (2.8, 0.4, 0.0), "ochre", 8 * fine)
    return build.scene()


def three_silhouettes() -> None:
    """Figure 1: the silhouette of the triangles, that of the normals, and that bent."""
    scene, sun, pictures = shapes(1), um.Light.sun(320.0, 40.0), []
    camera = um.Camera.look_at((0.3, 7.5, 8.5), (0.4, 0.7, 0.9), fov_y=35.0, width=480, height=320)
    samples = um.sample(ground().scene(), camera)
    true = um.shadow(shapes(12), sun, samples).in_shadow
    for way in (DISCRETE, ACCURATE, SMOOTH):
        pictures.append(um.render(scene, camera, sun, way, samples_per_pixel=4).pixels)
        wrong = um.shadow(scene, sun, samples, way).in_shadow != true
        print(f"{way.silhouette}: {wrong.sum()} samples of the floor are not as under a fine mesh")
    side_by_side("shapes", *pictures)


def three_contours() -> None:
    """Figure 4: contours that are not bent, bent by Phong's quadratic curves, and by Hermite's cubic ones."""
    build = ground()
    mesh, radii = sphere(segments=8, rings=5), np.array((1.0, 1.6, 0.6))
    build.smooth(mesh.positions * radii + (0, 2, 0), mesh.triangles, "red", mesh.normals / radii)
    scene, lamp = build.scene(), um.Light.point((-3.0, 6.0, -2.0))
    camera = um.Camera.look_at((3.0, 10.0, 6.0), (1.6, 0.6, 1.0), fov_y=36.0, width=400, height=360)
    ways = (ACCURATE, PHONG, SMOOTH)
    side_by_side("contours", *(um.render(scene, camera, lamp, way, samples_per_pixel=4).pixels for way in ways))


class InFront(SmoothVolumes):
    """Smooth volumes counted in front of samples (z-pass), for an eye that is in the light."""

    def counting(self, light: um.Light, camera: um.Camera, *_: object) -> tuple[bool, int, um.Camera]:
        """In front, from 0."""
        return False, 0, camera


class Open(InFront):
    """Volumes whose sides stand on the smooth contour, with nothing between that and the mesh."""

    def draw_bands(self, frame: Frame) -> None:
        """Leave them out."""


def open_and_closed() -> None:
    """Figure 5: without the bands, what is seen past the mesh inside its smooth contour is dark by mistake."""
    build = ground()
    ball(build, (0.0, 1.5, 0.0), 8, 5)
    scene, sun = build.scene(), um.Light.sun(270.0, 40.0)
    camera = um.Camera.look_at((-5.0, 5.2, 2.6), (0.4, 1.1, 0.0), fov_y=26.0, width=400, height=320)
    samples = um.sample(scene, camera, 4)
    method = SmoothGl(look_twice=False)
    caster = method.prepare(scene)
    surface = caster.silhouettes.surface(sun, samples)
    masks = [kind(scene, method, caster.silhouettes, surface, sun).shadow(sun, samples) for kind in (Open, InFront)]
    side_by_side("volumes", *(shade(scene, camera, [sun], samples, [mask]) for mask in masks))
    exact = um.shadow(scene, sun, samples, SMOOTH).in_shadow
    wrong = [int((mask.in_shadow != exact).sum()) for mask in masks]
    print(f"of {samples.size} samples {wrong[0]} are wrong without bands, {wrong[1]} with them")


def tessellated(scene: um.Scene, level: int) -> um.Scene:
    """The scene as Phong tessellation makes it, with the normals that it is shaded by."""
    assert scene.normals is not None
    fine = tessellate(scene.positions, scene.triangles, scene.normals, level)
    u, v = np.moveaxis(fine.corners[fine.place], 2, 0)
    normals = np.einsum(
        "tcw,twx->tcx", np.stack([1 - u - v, u, v], axis=2), scene.normals[scene.triangles][fine.source]
    )
    return um.Scene(
        fine.positions[fine.triangles].reshape(-1, 3),
        np.arange(3 * len(fine.triangles)).reshape(-1, 3),
        scene.materials,
        scene.material_id[fine.source],
        normals.reshape(-1, 3),
    )


def smooth_outlines() -> None:
    """Figure 7: a coarse mesh; tessellated for eye and light, where it shades itself; for the eye alone."""
    build = ground()
    ball(build, (0.0, 1.2, 0.0), 10, 6)
    scene, sun = build.scene(), um.Light.sun(290.0, 28.0)
    camera = um.Camera.look_at((1.2, 2.6, 4.6), (0.4, 1.0, 0.0), fov_y=34.0, width=360, height=320)
    side_by_side(
        "outlines",
        um.render(scene, camera, sun, samples_per_pixel=4).pixels,
        um.render(tessellated(scene, 3), camera, sun, samples_per_pixel=4).pixels,
        um.render(scene, camera, sun, SMOOTH, samples_per_pixel=4, smooth_outlines=8).pixels,
    )


def falling_sun() -> None:
    """Levels of detail: where the sun's height changes and the mesh as well, smooth shadows do not jump."""
    camera = um.Camera.look_at((3.5, 9.0, 6.0), (2.5, 0.0, 0.0), fov_y=50.0, width=480, height=320)
    samples = um.sample(ground().scene(), camera)
    scenes = []
    for segments, rings in ((10, 6), (16, 9), (32, 17)):
        build = ground()
        ball(build, (0.0, 1.5, 0.0), segments, rings)
        scenes.append(build.scene())
    for method in (DISCRETE, SMOOTH):
        casters = [method.prepare(scene) for scene in scenes]
        differ, apart = [], []
        for height in np.linspace(60.0, 15.0, 16):
            sun = um.Light.sun(270.0, height)
            dark = [caster.shadow(sun, samples).in_shadow for caster in casters]
            changes = [a != b for a, b in pairwise(dark)]
            differ.append(max(change.sum() for change in changes))
            apart.append(max((change & inside(b)).sum() for change, b in zip(changes, dark[1:], strict=True)))
        print(f"{method.silhouette}: {max(differ)} samples change with the mesh, {max(apart)} by more than a pixel")


def inside(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels that are like all eight around them."""
    around = np.lib.stride_tricks.sliding_window_view(np.pad(mask, 1, mode="edge"), (3, 3))
    alike: NDArray[np.bool_] = around.min(axis=(2, 3)) == around.max(axis=(2, 3))
    return alike


def soft() -> None:
    """Figure 11: a lamp with a size, of which each point casts a smooth shadow."""
    build = ground()
    ball(build, (-1.3, 1.1, 0.0), 8, 5)
    torus(build, (1.6, 1.4, 0.3), 10, 6, "blue")
    scene, lamp = build.scene(), um.Light.point((-3.0, 6.0, -2.5), radius=0.5)
    camera = um.Camera.look_at((1.5, 7.0, 7.5), (0.9, 0.5, 1.2), fov_y=38.0, width=480, height=320)
    ways = (dataclasses.replace(way, light_samples=128) for way in (DISCRETE, SMOOTH))
    side_by_side("soft", *(um.render(scene, camera, lamp, way, samples_per_pixel=2).pixels for way in ways))


for part in (three_silhouettes, three_contours, open_and_closed, smooth_outlines, falling_sun, soft):
    part()
