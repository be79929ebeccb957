"""Hours of direct sun on the ground of a courtyard, its north half and its south half, on three days of the year.

Four walls, 4 high, around a court of 12 x 12, in Linz; y is up and -z is north.
"""

import datetime as dt

import umbrae as um
from umbrae.sun import Sky, day_times, sun_map, surface_sensors

court = [(-6, -6), (6, -6), (6, 6), (-6, 6)]
positions = [(x, y, z) for y in (0, 4) for x, z in court]
ground = [(0, 2, 1), (0, 3, 2)]
walls = [triangle for a, b in ((0, 1), (1, 2), (2, 3), (3, 0)) for triangle in ((a, b, b + 4), (a, b + 4, a + 4))]
scene = um.Scene(positions, ground + walls)

sensors = surface_sensors(scene, spacing=1.0)
on_ground = sensors.triangle < len(ground)
north = sensors.position[:, 2] < 0
for date in ("2026-12-21", "2026-03-20", "2026-06-21"):
    times = day_times(date, step=dt.timedelta(minutes=10), timezone="Europe/Vienna")
    study = um.sun_hours(scene, sensors, times, latitude=48.3, longitude=14.3)
    inside = [study.hours[on_ground & half].mean() for half in (north, ~north)]
    print(f"{date}: {study.sky.possible_hours:4.1f} h of day, north {inside[0]:.1f} h, south {inside[1]:.1f} h")

# The last day as a picture: every pixel holds its own hours.
camera = um.Camera.look_at((9, 16, 14), (0, 0, 0), fov_y=45, width=480, height=270)
image, _ = sun_map(scene, camera, Sky.over(times, 48.3, 14.3))
image.save("sun_hours.png")
