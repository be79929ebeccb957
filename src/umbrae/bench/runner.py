"""What is timed: a method of Umbrae, or what it is compared with."""

from abc import ABC, abstractmethod
from typing import Any, Generic, TypeVar

from umbrae.clock import Clock
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods import METHODS, Caster, Method
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

Answer = TypeVar("Answer")


class Runner(ABC, Generic[Answer]):
    """One contestant. Only `prepare` and `shadow` are timed; what they read is handed over before."""

    name: str
    guarantee = Guarantee.NONE

    def unavailable(self) -> str | None:
        """Why it cannot run here, in one line; None when it can."""
        return None

    def options(self) -> dict[str, Any]:
        """Option values by name."""
        return {}

    @abstractmethod
    def set_geometry(self, scene: Scene) -> None:
        """Take new geometry, not timed; forgets what was made of the last."""

    @abstractmethod
    def set_samples(self, samples: ViewSamples) -> None:
        """Take new samples of the same geometry, not timed."""

    @abstractmethod
    def prepare(self, clock: Clock) -> None:
        """Do the work that depends on the geometry alone."""

    @abstractmethod
    def shadow(self, light: Light, clock: Clock) -> Answer:
        """Decide every covered sample."""

    @abstractmethod
    def mask(self, answer: Answer) -> ShadowMask:
        """What `shadow` answered as a mask, not timed."""


class MethodRunner(Runner[ShadowMask]):
    """A method of Umbrae: from raw arrays and view samples to the finished mask."""

    def __init__(self, method: Method) -> None:
        self.name, self.guarantee = method.name, method.guarantee
        self._method = method
        self._caster: Caster | None = None

    def options(self) -> dict[str, Any]:
        return self._method.options()

    def set_geometry(self, scene: Scene) -> None:
        self._scene, self._caster = scene, None

    def set_samples(self, samples: ViewSamples) -> None:
        self._samples = samples

    def prepare(self, clock: Clock) -> None:
        self._caster = self._method.prepare(self._scene, clock)

    def shadow(self, light: Light, clock: Clock) -> ShadowMask:
        assert self._caster is not None
        return self._caster.shadow(light, self._samples, clock)

    def mask(self, answer: ShadowMask) -> ShadowMask:
        return answer


def exact_methods() -> list[Runner[Any]]:
    """Every exact method on the CPU, as Embree is, with its default options; not the oracle, which is the judge."""
    exact = [method for method in METHODS.values() if method.guarantee is Guarantee.EXACT and method.engine == "CPU"]
    return [MethodRunner(method()) for method in exact if method.name != "oracle"]
