"""Scenes that Umbrae makes itself: for the demo, the tests, the examples and the benchmarks."""

from umbrae.models.pavilion_scene import pavilion, pavilion_camera, pavilion_light
from umbrae.models.sphere_scene import sphere, spheres, spheres_light
from umbrae.models.town_scene import town, town_flight, town_sun, town_walk

__all__ = [
    "pavilion",
    "pavilion_camera",
    "pavilion_light",
    "sphere",
    "spheres",
    "spheres_light",
    "town",
    "town_flight",
    "town_sun",
    "town_walk",
]
