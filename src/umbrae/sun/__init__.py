"""Hours of direct sun: where the sun stands, on which sensors, how long."""

from umbrae.sun.heat_map import finer_camera, sun_map
from umbrae.sun.legend import legend_height
from umbrae.sun.results import STUDIES, save_study, summary
from umbrae.sun.sensors import both_sides, surface_sensors
from umbrae.sun.solar import Sky, day_times, longitude_zone
from umbrae.sun.study import SunStudy, sun_hours, sun_study, sunnier

__all__ = [
    "STUDIES",
    "Sky",
    "SunStudy",
    "both_sides",
    "day_times",
    "finer_camera",
    "legend_height",
    "longitude_zone",
    "save_study",
    "summary",
    "sun_hours",
    "sun_map",
    "sun_study",
    "sunnier",
    "surface_sensors",
]
