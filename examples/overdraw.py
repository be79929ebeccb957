"""How much work shadow volumes and per-triangle frusta do on the same picture, small and large.

After Figures 5 and 7 of Sintorn, Olsson, Assarsson 2011. Needs OpenGL.
"""

import numpy as np

import umbrae as um
from umbrae import models
from umbrae.methods.volumes.silhouette_ts import SilhouetteTs

SIZES = ((320, 180), (1280, 720))
METHODS = {
    "z-pass": SilhouetteTs(counting="zpass"),
    "z-fail": SilhouetteTs(counting="zfail"),
    "frustum": um.METHODS["frustum"](),
}
COUNTERS = "counter_updates", "tile_frustum_tests", "sample_frustum_tests"

scene = models.pavilion().opaque()
sun = models.pavilion_light()
work: dict[str, list[int]] = {name: [] for name in METHODS}
for size in SIZES:
    camera = models.pavilion_camera(*size)
    samples = um.sample(scene, camera)
    for name, method in METHODS.items():
        stats = um.shadow(scene, sun, samples, method).stats
        work[name].append(sum(stats.get(counter, 0) for counter in COUNTERS))

print("updates or tests", *(f"{width:5d} x {height}" for width, height in SIZES))
for name, numbers in work.items():
    print(f"{name:16s}", *(f"{number:11,d}" for number in numbers))

# The picture, and beside it how many sides of volumes lie before each sample: black none, yellow the most.
faces = SilhouetteTs().prepare(scene).faces_before(sun, samples)
share = np.log1p(faces) / np.log1p(faces.max())
heat = np.stack([2.2 * share, 1.8 * share - 0.7, 0.8 * share * (1.2 - share)], axis=-1)
heat = np.round(255 * np.clip(heat, 0, 1)).astype(np.uint8)
picture = um.render(scene, camera, sun).pixels
um.Image(np.concatenate([picture, heat], axis=1)).save("overdraw.png")
