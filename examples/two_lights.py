"""Two lights, one scene: prepare the geometry once, ask once per light."""

import umbrae as um
from umbrae import models

scene = models.spheres(grid=(4, 4), triangles=4_000)
camera = um.Camera.frame(scene, width=480, height=270)
sun = um.Light.sun(azimuth=200, elevation=35, color=(1.0, 0.95, 0.85), intensity=0.7)
lamp = um.Light.point((-3, 9, 5), color=(0.7, 0.8, 1.0), intensity=0.5)

samples = um.sample(scene, camera)
caster = um.METHODS["frustum"]().prepare(scene)
from_sun, from_lamp = (caster.shadow(light, samples).in_shadow for light in (sun, lamp))

seen = samples.covered
print(f"no sun:  {from_sun[seen].mean():.1%}")
print(f"no lamp: {from_lamp[seen].mean():.1%}")
print(f"neither: {(from_sun & from_lamp)[seen].mean():.1%}")

um.render(scene, camera, [sun, lamp]).save("two_lights.png")
