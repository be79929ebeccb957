"""What Milet, Kobrtek, Zemcik and Peciva measured: their Tables 1 to 9, in frames per second as they print them."""

from collections.abc import Callable, Sequence

from umbrae.bench.sweep import TIME, PaperRow, Quantity

RADEON, GEFORCE = "R9 280X", "GTX 680"
TS, TS_3, GS, GS_3 = "TS", "TS, 3 edges", "GS", "GS, 3 edges"
SM, TS_TRIANGLE, GS_TRIANGLE = "SM", "TS triangle", "GS triangle"

OPENGL = Quantity("OpenGL", "ms on OpenGL", 1e6, ("opengl_ns",))
"""What OpenGL's part of a frame takes until it has finished, the way there and back not counted."""
SPEED_UPS = (
    Quantity("speed-up", "times", 1e6, ("speed_up_ppm",), comparable=True),
    Quantity("speed-up on OpenGL", "times on OpenGL", 1e6, ("opengl_speed_up_ppm",), comparable=True),
)
"""How many times less a view of nothing takes than one of everything, in parts per million."""

_BOTH = tuple((device, row) for device in (RADEON, GEFORCE) for row in (TS_3, TS, GS_3, GS))
"""The order of columns in the paper's tables of two methods with two determinisms each."""

RESOLUTION = """
800x600 112 130 51 49 175 178 62 61
1024x768 116 124 49 50 177 178 61 60
1366x768 107 116 48 48 159 160 60 61
1920x1080 95 101 47 46 122 126 60 59
"""
TEXTURES = """
tex 121 130 48 49 176 185 60 62
notex 112 123 51 52 197 219 64 63
"""
SPHERES = """
32400 984 995 490 484 739 825 542 540
67600 921 963 488 487 624 667 494 513
102400 615 729 484 479 491 555 372 402
360000 203 233 270 272 218 228 131 135
1081600 72 88 104 110 82 94 46 49
1440000 56 72 84 91 67 81 36 39
1960000 34 41 59 62 49 58 26 28
"""
BOX = """
336 3000 3010 2830 2750 2940 2990 2780 2780
1308 2950 2980 2730 2700 2830 2860 2650 2630
15612 1820 2050 2540 2650 1960 1980 1460 1570
102412 613 741 945 995 822 992 465 503
360000 196 245 299 323 281 353 149 163
577600 122 155 186 203 180 224 94 103
1000000 73 92 111 119 106 134 55 60
1960000 37 46 56 60 54 68 28 31
3686400 19 25 30 32 29 36 0.5 0.5
"""
MILLION = """
1 73 92 111 120 106 134 55 60
4 74 94 113 121 101 126 53 58
25 64 76 97 101 76 88 46 50
64 68 76 90 89 61 66 40 43
100 64 70 84 82 58 62 39 42
240 58 55 70 64 50 49 35 36
399 53 48 61 54 36 36 27 28
625 43 38 53 46 29 27 22 22
851 40 44 46 50 24 25 19 20
1250 35 37 28 31 19 19 16 16
2500 23 19 15.1 15.4 12 11 10.8 10.1
3116 21.2 21.5 12.8 12.5 11.1 11.2 9.1 9.2
3920 15.7 14 10.1 10.12 9.1 8.7 7.7 7.5
5100 14.8 14.2 7.8 7.75 8.2 8.2 6.7 6.8
15600 7.45 6.45 3.07 3.14 10.5 9.1 3.6 3.6
"""
HUNDRED_THOUSAND = """
1 630 765 962 1025 825 1003 470 510
4 561 657 881 920 660 742 410 441
25 534 583 630 645 445 453 340 352
64 443 448 485 475 297 289 273 273
100 485 531 403 408 234 237 211 212
225 307 258 199 203 147 145 124 125
900 99 103 48 49 61 61 45.5 45.7
2500 34 36 16 17 28.5 28.6 17 16.8
3600 24 25 11 12 20.3 20 11.8 11.7
"""
SHADOW_MAP = """
32400 995 252 825 245
67600 963 250 667 237
102400 729 244 555 225
360000 233 219 228 190
1081600 88 168 94 135
1440000 72 155 81 115
1960000 41 120 58 103
"""
SHADOW_MAP_ORDER = tuple((device, row) for device in (RADEON, GEFORCE) for row in (TS, SM))
INVISIBLE = """
1x1 1.24 1.3 1.36 1.4 1.19 1.25 1.13 1.11
50x50 1.65 1.98 1.77 2.07 3.81 5.04 3.16 3.35
"""
OVERALL = """
4000000 5.8 23.7 3.1 34 93 7.9 32 4.9 14.8 74
sponza 102 130 51 49 0 83 185 73 62 0
"""
OVERALL_ORDER = tuple((device, row) for device in (RADEON, GEFORCE) for row in (TS_TRIANGLE, TS, GS_TRIANGLE, GS, SM))


def columns_of(text: str) -> list[str]:
    """The names in the first column of a table."""
    return [line.split()[0] for line in text.split("\n") if line]


def rows_of(
    text: str,
    name: Callable[[str], str] = str,
    order: Sequence[tuple[str, str]] = _BOTH,
    quantities: Sequence[Quantity] = (TIME, OPENGL),
) -> tuple[PaperRow, ...]:
    """A table's rows, one for each device, method and quantity; frames per second become milliseconds, rates stay.

    Parameters
    ----------
    name
        What our table calls the paper's column.
    order
        Device and row of the numbers in each line. A zero is none, as in the paper.
    """
    lines = [line.split() for line in text.split("\n") if line]
    rate = quantities == SPEED_UPS
    told: dict[tuple[str, str], dict[str, float]] = {}
    for label, *numbers in lines:
        for key, number in zip(order, map(float, numbers), strict=True):
            if number:
                told.setdefault(key, {})[name(label)] = number if rate else round(1e3 / number, 4)
    return tuple(
        PaperRow(row, device, values, quantity.name)
        for quantity in quantities
        for (device, row), values in told.items()
    )
