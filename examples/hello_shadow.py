"""A picture with exact shadows: the pavilion, seen from its garden in the afternoon sun."""

import umbrae as um
from umbrae import models

scene = models.pavilion()
camera = models.pavilion_camera(width=640, height=360)
image = um.render(scene, camera, models.pavilion_light(), samples_per_pixel=4)
image.save("pavilion.png")

(mask,) = image.masks
seen = mask.in_shadow[image.samples.covered]
print(f"pavilion.png: {seen.mean():.0%} of what is seen lies in shadow, guarantee: {mask.guarantee}")
