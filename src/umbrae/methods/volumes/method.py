"""The options that shadow volume methods share."""

from dataclasses import dataclass
from typing import ClassVar

from umbrae.checks import shown
from umbrae.errors import OptionError
from umbrae.mask import Guarantee
from umbrae.methods.method import Method

COUNTING = ("auto", "zpass", "zfail")
COUNTER = ("auto", "stencil", "float")
DETERMINISM = ("reference-edge", "three-edge", "none")


@dataclass(frozen=True)
class VolumeMethod(Method):
    """A shadow volume method; all have these options.

    Options
    -------
    counting
        `zpass` counts the faces between the eye and the sample, starting from the number of volumes that hold the eye;
        `zfail` those beyond the sample, and needs caps. `auto` takes `zpass` unless the eye is nearer to a face than
        rounding allows; asked for by name, `zpass` refuses there.
    counter
        `stencil` has 8 bits, wraps around, and counts by ones; `float` is a 32-bit float target with additive blending
        that takes any step. `auto` takes the stencil only where no sample can lie in 256 volumes or more.
    culling
        Whether objects whose shadow cannot be seen are left out (see `culling`). It changes no verdict.
    """

    counting: str = "auto"
    counter: str = "auto"
    culling: bool = True

    guarantee: ClassVar[Guarantee] = Guarantee.BANDED
    engine: ClassVar[str] = "OpenGL"
    accepts: ClassVar[tuple[str, ...]] = ("pictures",)

    def __post_init__(self) -> None:
        _one_of(self.counting, COUNTING, f"{self.name}: counting")
        _one_of(self.counter, COUNTER, f"{self.name}: counter")
        if not isinstance(self.culling, bool):
            raise OptionError(f"{self.name}: culling: wanted True or False, got {shown(self.culling)}")


@dataclass(frozen=True)
class SilhouetteMethod(VolumeMethod):
    """A method that finds silhouettes by multiplicity.

    Options
    -------
    determinism
        How the triangles' sides are kept consistent: `reference-edge` decides once for each triangle (Milet et al.),
        `three-edge` drops triangles whose three edges disagree (Peciva et al. 2013), `none` asks anew at each edge (Kim
        et al. 2008). The last two are here to be compared with; they promise nothing.
    """

    determinism: str = "reference-edge"

    def __post_init__(self) -> None:
        super().__post_init__()
        _one_of(self.determinism, DETERMINISM, f"{self.name}: determinism")


def _one_of(value: str, known: tuple[str, ...], name: str) -> None:
    if value not in known:
        raise OptionError(f"{name}: wanted one of {', '.join(known)}, got {shown(value)}")
