"""The 145 directions that sky studies ask for: the centres of Tregenza's sky patches.

P. R. Tregenza, "Subdivision of the sky hemisphere for luminance measurements", Lighting Research and
Technology 19 (1987).
"""

from umbrae.light import Light

ROWS = (30, 30, 24, 24, 18, 12, 6, 1)
"""Patches of each row, from the horizon to the zenith; the rows are 12 degrees high, the last is the cap."""
PATCHES = sum(ROWS)


def patches(count: int = PATCHES) -> list[Light]:
    """Directional lights from the patch centres, y up; of fewer than all, a regular pick.

    Row by row from the horizon up, each from north (-z) to the east, as Radiance numbers them.
    """
    centres = [
        (360.0 * number / patches, min(6.0 + 12.0 * row, 90.0))
        for row, patches in enumerate(ROWS)
        for number in range(patches)
    ]
    return [Light.sun(*centres[index * PATCHES // count]) for index in range(count)]
