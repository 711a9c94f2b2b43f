"""The base of all methods: checked settings, and steppers made from a method's recipe."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar

from deli.errors import InputError
from deli.integrators.recipe import Recipe

if TYPE_CHECKING:
    from deli.integrators.stepper import Stepper
    from deli.mechanics.scene import Scene

Choices = Mapping[str, tuple[Any, ...]]
Ranges = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Integrator(ABC):
    """A method; its subclasses are frozen dataclasses of settings, each a choice, a number in a range, or a flag.

    Attributes
    ----------
    CHOICES : mapping
        Allowed values, by setting.
    RANGES : mapping
        Smallest and largest allowed number, by setting.
    MEMORY : tuple of str
        Names of the arrays of dof numbers that the method carries from step to step besides q and p; they are recorded,
        and described in `deli.recording.schema`.
    """

    CHOICES: ClassVar[Choices] = {}
    RANGES: ClassVar[Ranges] = {}
    MEMORY: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        for field in fields(self):
            self._check(field.name, getattr(self, field.name))

    @abstractmethod
    def recipe(self) -> Recipe:
        """Return the recipe of a step of the method."""

    def stepper(
        self,
        scene: "Scene",
        step_size: float,
        solvers: object = "auto",
        skip: bool = True,
        contact_tolerance: float = 1e-8,
    ) -> "Stepper":
        """Bind the method to a scene; see `deli.integrators.stepper.Stepper`."""
        from deli.integrators.stepper import Stepper  # numba takes half a second to import

        return Stepper(scene, step_size, self.recipe(), solvers, skip, contact_tolerance)

    def _check(self, key: str, value: object) -> None:
        """Refuse a value that a setting cannot have."""
        name = type(self).__name__
        if key in self.CHOICES:
            if value not in self.CHOICES[key]:
                allowed = ", ".join(map(str, self.CHOICES[key]))
                raise InputError(f"{name}: {key} {value!r} is unknown; allowed: {allowed}.")
        elif key in self.RANGES:
            least, most = self.RANGES[key]
            if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
                raise InputError(f"{name}: {key} is {value!r}; allowed: a number from {least:g} to {most:g}.")
        elif not isinstance(value, bool):
            raise InputError(f"{name}: {key} is {value!r}; allowed: true or false.")
