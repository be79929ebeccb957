"""Arguments and options that several commands share."""

from pathlib import Path
from typing import Annotated, Any

import typer

from umbrae import arguments
from umbrae.arguments import Size, Sun, Vector
from umbrae.errors import OptionError

Model = Annotated[Path, typer.Argument(help="glTF, GLB, OBJ, PLY or STL file.", metavar="MODEL")]
Output = Annotated[Path, typer.Option("-o", "--output", help="File to write.", metavar="FILE")]
SizeOption = Annotated[Size, typer.Option("--size", parser=arguments.size, metavar="WxH", help="Pixels.")]
Eye = Annotated[
    Vector | None,
    typer.Option("--eye", parser=arguments.vector, metavar="X,Y,Z", help="Where the camera stands; automatic."),
]
Target = Annotated[
    Vector | None,
    typer.Option("--target", parser=arguments.vector, metavar="X,Y,Z", help="What it looks at; the centre."),
]
Up = Annotated[Vector, typer.Option("--up", parser=arguments.up_vector, metavar="y|z|X,Y,Z", help="World up.")]
Fov = Annotated[float, typer.Option("--fov", metavar="DEGREES", help="Vertical field of view.")]
Points = Annotated[
    list[Vector],
    typer.Option("--light", parser=arguments.vector, metavar="X,Y,Z", help="Point light; repeatable."),
]
Suns = Annotated[
    list[Sun],
    typer.Option(
        "--sun",
        parser=arguments.sun,
        metavar="AZIMUTH,ELEVATION",
        help="Sun in degrees: clockwise from north (-z, or +y when z is up), above the horizon; repeatable.",
    ),
]
LightRadius = Annotated[
    float,
    typer.Option("--light-radius", min=0.0, metavar="UNITS", help="Of the point lights: spheres with soft shadows."),
]
SunDiameter = Annotated[
    float,
    typer.Option(
        "--sun-diameter", min=0.0, metavar="DEGREES", help="Across, for soft shadows; 0.53 is that of the real sun."
    ),
]
LightSamples = Annotated[
    int | None,
    typer.Option(
        "--light-samples", min=1, metavar="N", help="How many points of a light with a size each sample looks at; 32."
    ),
]
MethodName = Annotated[str, typer.Option("--method", metavar="NAME", help="See `umbrae methods`.")]
Counting = Annotated[
    str | None,
    typer.Option("--counting", metavar="auto|zpass|zfail", help="Of shadow volumes: in front of samples, or beyond."),
]
Determinism = Annotated[
    str | None,
    typer.Option(
        "--determinism",
        metavar="reference-edge|three-edge|none",
        help="How silhouettes by multiplicity keep triangles' sides consistent.",
    ),
]
Counter = Annotated[
    str | None,
    typer.Option("--counter", metavar="auto|stencil|float", help="What shadow volumes are counted in."),
]
Culling = Annotated[
    bool | None,
    typer.Option(
        "--culling/--no-culling", help="Leave out casters whose shadows cannot be seen; it changes no verdict."
    ),
]
MapSize = Annotated[
    int | None, typer.Option("--map-size", metavar="TEXELS", help="Of a shadow map along each side; 8192.")
]
MapBias = Annotated[
    float | None,
    typer.Option("--map-bias", metavar="SHARE", help="Of the scene's extent, against self-shadows; 0.0001."),
]
MapSlopeBias = Annotated[
    float | None, typer.Option("--map-slope-bias", metavar="TEXELS", help="Of a caster's slope, for the same; 2.")
]
MapFilter = Annotated[
    int | None,
    typer.Option("--map-filter", metavar="TEXELS", help="Each way, of percentage-closer filtering; 1, which is none."),
]
MapProjection = Annotated[
    str | None,
    typer.Option("--map-projection", metavar="auto|single|cube", help="Of the shadow map of a point light."),
]
Silhouette = Annotated[
    str | None,
    typer.Option(
        "--silhouette",
        metavar="smooth|accurate|discrete|phong",
        help="Of the smooth methods: bent, not bent, the triangles'.",
    ),
]
Epsilon = Annotated[
    float | None,
    typer.Option("--epsilon", metavar="UNITS", help="How far chords of smooth silhouettes may lie from their curves."),
]
EpsilonPx = Annotated[
    float | None,
    typer.Option("--epsilon-px", metavar="PIXELS", help="How far the shadows of those chords may be off; 0.25."),
]
SmoothNormals = Annotated[
    float | None,
    typer.Option(
        "--smooth-normals",
        min=0.0,
        max=180.0,
        metavar="DEGREES",
        help="Make vertex normals anew; edges that turn by more stay sharp.",
    ),
]
Opaque = Annotated[
    bool, typer.Option("--opaque", help="Take every surface as solid: no holes, nothing lets light through.")
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No stages, no progress.")]

DEFAULT_SIZE: Any = "1920x1080"  # typer runs defaults through the parser
DEFAULT_UP: Any = "y"
DEFAULT_GRID: Any = "10x10"
DEFAULT_LOTS: Any = "20x20"
DEFAULT_STEP: Any = "10min"


def of_shadow_map(method: str, **options: str | float | None) -> dict[str, Any]:
    """The options of `shadow-map` that the command line names, where `method` is that or all.

    Raises `OptionError` for others, by the names that the options have on the command line.
    """
    named = given(**options)
    if named and method not in ("shadow-map", "all"):
        raise OptionError(f"--map-{next(iter(named)).replace('_', '-')} is that of --method shadow-map, not {method}")
    return named


def given(**options: str | float | bool | None) -> dict[str, Any]:
    """The options of a method that the command line names."""
    return {name: value for name, value in options.items() if value is not None}
