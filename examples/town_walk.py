"""A walk down a street and a flight above the roofs: what cannot be seen in shadow is left out, and nothing changes."""

import umbrae as um
from umbrae import models

LOTS = (20, 20)
town = models.town(LOTS, triangles=300_000, tree=50_000)
sun = models.town_sun()
caster = um.METHODS["frustum"]().prepare(town)
plain = um.METHODS["frustum"](culling=False).prepare(town)

for name, path in (("walk", models.town_walk), ("flight", models.town_flight)):
    for frame in range(4):
        camera = path(LOTS, frame / 3, 480, 270)
        samples = um.sample(town, camera)
        mask = caster.shadow(sun, samples)
        assert (mask.in_shadow == plain.shadow(sun, samples).in_shadow).all()
        left_out = mask.stats["culled"] / len(town.triangles)
        print(f"{name} {frame}: {left_out:.0%} of the triangles left out")
        um.render(town, camera, sun, caster=caster).save(f"town_{name}_{frame}.png")
