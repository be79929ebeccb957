"""The shadow of a tree in five ways: leaves cut out of cards, half transparent, textured, by chance, and coloured.

After Figure 8 of Sintorn, Olsson, Assarsson 2011.
"""

import dataclasses

import numpy as np

import umbrae as um
from umbrae.methods.frustum_cpu import Frustum
from umbrae.models.builder import Builder
from umbrae.models.textures import sprig
from umbrae.models.tree import tree

CARD = sprig(128, "b3c765", "7a9f45", seed=7)
LEAVES = {
    "cut out": um.Material((1.0, 1.0, 1.0, 1.0), "MASK", 0.5, texture=CARD),
    "half": um.Material((0.35, 0.5, 0.15, 0.5), "BLEND"),
    "textured": um.Material((1.0, 1.0, 1.0, 0.7), "BLEND", texture=CARD),
    "by chance": um.Material((1.0, 1.0, 1.0, 0.7), "BLEND", texture=CARD),
    "coloured": um.Material((1.0, 1.0, 1.0, 1.0), "BLEND", transmission=0.9, texture=CARD),
}


def scene_with(leaf: um.Material) -> um.Scene:
    """A tree on a pale floor."""
    bark = um.Material((0.28, 0.2, 0.14, 1.0), name="bark")
    floor = um.Material((0.75, 0.74, 0.7, 1.0), name="floor")
    build = Builder([bark, dataclasses.replace(leaf, name="leaf"), floor])
    build.quad([(-6, 0, 6), (6, 0, 6), (6, 0, -6), (-6, 0, -6)], "floor")
    tree(build, (0.0, 0.0, 0.0), height=4.0, seed=8)
    return build.scene()


camera = um.Camera.look_at((1.0, 6.2, 8.4), (1.0, 1.35, 0.0), fov_y=32.0, width=300, height=300)
sun = um.Light.sun(250.0, 42.0)
pictures = []
for name, leaf in LEAVES.items():
    scene = scene_with(leaf)
    method = Frustum(transparency="stochastic" if name == "by chance" else "exact")
    image = um.render(scene, camera, sun, method, samples_per_pixel=4)
    pictures.append(image.pixels)
    floor = image.samples.triangle < 2
    light = image.masks[0].transmittance[floor & image.samples.covered].mean(axis=0)
    print(f"{name:10s} {' '.join(f'{share:5.1%}' for share in light)} of red, green, blue reaches the floor")
um.Image(np.concatenate(pictures, axis=1)).save("tree_shadows.png")
