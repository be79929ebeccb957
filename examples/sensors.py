"""Which points of a wall are in shadow: sensors on its faces, and free points in front of it.

A wall 4 wide and 3 high faces south; a canopy 1 deep juts out from its top. With the sun in the south, 45
degrees high, the canopy shades just the upper third of the wall.
"""

import numpy as np

import umbrae as um

wall = [(0, 0, 0), (4, 0, 0), (4, 3, 0), (0, 3, 0)]
canopy = [(0, 3, 0), (4, 3, 0), (4, 3, 1), (0, 3, 1)]
scene = um.Scene(wall + canopy, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
sun = um.Light.sun(azimuth=180, elevation=45)

# 8 x 12 sensors in the middle of equal cells, as shares of the wall's width and height. Below its diagonal
# they lie on triangle 0, above it on triangle 1; there `u` and `v` follow from p = A + u (B - A) + v (C -
# A).
across, up = np.meshgrid((np.arange(8) + 0.5) / 8, (np.arange(12) + 0.5) / 12)
below = across >= up
barycentric = np.where(below[..., None], np.stack([across - up, up], axis=-1), np.stack([across, up - across], axis=-1))
sensors = um.ViewSamples.on_surface(scene, np.where(below, 0, 1), barycentric, side=1)
shaded = um.shadow(scene, sun, sensors).in_shadow

for row in shaded[::-1]:
    print("".join("#" if dark else "." for dark in row))
print(f"on the wall: {shaded.mean():.0%} in shadow")

# The same places, 0.5 in front of the wall: the canopy's edge is nearer, its shadow shorter.
in_front = um.ViewSamples.points(sensors.position + np.float32((0, 0, 0.5)))
print(f"in front of it: {um.shadow(scene, sun, in_front).in_shadow.mean():.0%} in shadow")
