"""A cloth that waves above a floor: prepare once, then move the vertices frame by frame."""

import numpy as np

import umbrae as um

side = np.linspace(-1.0, 1.0, 41)
x, z = (axis.ravel() for axis in np.meshgrid(side, side))
corner = np.arange(41 * 40).reshape(40, 41)[:, :-1].ravel()
cloth = np.concatenate(
    [np.stack([corner, corner + 41, corner + 42], axis=1), np.stack([corner, corner + 42, corner + 1], axis=1)]
)
floor = np.array([(-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)], float)


def positions(seconds: float) -> np.ndarray:
    """All vertices at a moment: the cloth's, then the floor's."""
    y = 1.0 + 0.25 * np.sin(5.0 * x + 6.0 * seconds) * (1.0 + x) / 2
    return np.concatenate([np.stack([x, y, z], axis=1), floor])


start = len(x)
scene = um.Scene(
    positions(0.0), np.concatenate([cloth, [(start, start + 1, start + 2), (start, start + 2, start + 3)]])
)
camera = um.Camera.frame(scene, width=320, height=180)
sun = um.Light.sun(azimuth=240, elevation=55)
caster = um.METHODS["frustum"]().prepare(scene)

for frame in range(4):
    scene = caster.update(positions(frame / 4))  # the same triangles: only what moves is done anew
    samples = um.sample(scene, camera)
    on_floor = samples.triangle >= len(cloth)
    dark = caster.shadow(sun, samples).in_shadow[on_floor].mean()
    print(f"frame {frame}: {dark:.1%} of the floor in shadow")
    um.render(scene, camera, sun, caster=caster).save(f"cloth_{frame}.png")
