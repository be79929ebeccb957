"""Coloured glass before coloured glass, seen through and lit through: eight layers, peeled one by one.

After Figure 1c of Sintorn, Olsson, Assarsson 2011.
"""

import numpy as np

import umbrae as um
from umbrae.models.builder import Builder

COLORS = {"red": (0.9, 0.08, 0.06), "amber": (0.95, 0.6, 0.05), "green": (0.1, 0.75, 0.2), "blue": (0.1, 0.2, 0.95)}
glass = [um.Material((*color, 0.85), "BLEND", transmission=0.9, name=name) for name, color in COLORS.items()]
stone = um.Material((0.78, 0.76, 0.72, 1.0), name="stone")
build = Builder([*glass, stone])
build.quad([(-6, 0, 5), (6, 0, 5), (6, 0, -5), (-6, 0, -5)], "stone")
build.box((-3.4, 0.0, -3.2), (3.4, 0.15, 2.6), "stone")
for row in range(4):
    for column, name in enumerate(np.roll(list(COLORS), row)):
        x, z = -2.6 + 1.4 * column, 2.0 - 1.4 * row
        build.quad([(x, 0.15, z), (x + 1.2, 0.15, z), (x + 1.2, 1.9, z - 0.3), (x, 1.9, z - 0.3)], name)
build.lathe([(0.0, 0.0), (0.45, 0.25), (0.5, 0.6), (0.3, 0.95), (0.0, 1.1)], (0.2, 0.15, -0.2), "stone", 48)

scene = build.scene()
camera = um.Camera.look_at((-2.5, 4.6, 9.0), (0.3, 0.35, 0.4), fov_y=38.0, width=640, height=400)
image = um.render(scene, camera, um.Light.sun(322.0, 38.0), samples_per_pixel=4, layers=8)
image.save("stained_glass.png")

for number, layer in enumerate(image.layers, 1):
    print(f"layer {number}: {layer.covered.mean():6.2%} of the picture")
