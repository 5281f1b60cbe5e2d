"""Parameters of the autopilot that lower or lift its way home, and what they have to be for it to fly as high as is
proved (`decision.volume`): docs/flying/returns.md has the sources.
"""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from rtshcua.adapters.vehicle.parameters import VehicleParameters
from rtshcua.decision.volume import SHORT, STEEP, cone
from rtshcua.mavlink.quantise import quantise
from rtshcua.model.flat.policy import Vehicle

_METRE: Final = 1_000  # mm


class Need(NamedTuple):
    """What is needed of a parameter: at least or at most so much, in mm or mm/s; a slope in 1/1000."""

    least: int | None = None
    most: int | None = None


def near(vehicle: Vehicle) -> Need | None:
    """How far from home a return may be low at most, where the height of a return is declared."""
    return Need(most=cone(vehicle.return_altitude)) if vehicle.return_altitude else None


def slope(vehicle: Vehicle) -> Need | None:
    """How steep the cone is at least in which a return is low; 0 is none."""
    return Need(least=STEEP * _METRE) if vehicle.return_altitude else None


def climb(vehicle: Vehicle) -> Need | None:
    """How much a return climbs at most above both its height and the vehicle's."""
    return Need(most=0) if vehicle.return_altitude else None


def corner(vehicle: Vehicle) -> Need | None:
    """How far at most from where it is told to turn it turns, and so below its height sets off for home."""
    return Need(most=SHORT) if vehicle.return_altitude else None


class ReturnLimit(NamedTuple):
    """A parameter, the mm in one of its units, what is needed of it, and whether 0 is none and always good."""

    parameter: str
    mm: int
    need: Callable[[Vehicle], Need | None]
    may_be_off: bool = False

    def wrong(self, value: float, vehicle: Vehicle) -> str | None:
        """What is wrong with its value, and what to set it to, in words."""
        need, has = self.need(vehicle), quantise(value, self.mm, 1)
        if need is None or (self.may_be_off and value == 0):
            return None
        least, most = need
        if has is not None and (least is None or has >= least) and (most is None or has <= most):
            return None
        wanted = f"at most {(most or 0) // self.mm}" if least is None else f"at least {-(-least // self.mm)}"
        return (
            f"its way home would not be at the height that is proved (`{self.parameter}` is {value:g}): set "
            f"`{self.parameter}` to {wanted}"
        )


class ReturnLimits:
    """Of one vehicle, as far as its parameters tell. `limits` are groups of names of the same, of which it has one."""

    def __init__(self, limits: tuple[tuple[ReturnLimit, ...], ...], vehicle: Vehicle) -> None:
        self._limits = limits if vehicle.return_altitude else ()
        self._vehicle = vehicle

    def ask(self, parameters: VehicleParameters) -> None:
        """Ask for what is not known yet."""
        for group in self._limits:
            if not any(each.parameter in parameters.values for each in group):
                for each in group:
                    parameters.read(each.parameter)

    def unread(self, parameters: VehicleParameters) -> str | None:
        """That one was not read yet, in words. What the vehicle does not have limits nothing."""
        for group in self._limits:
            names = [each.parameter for each in group]
            if not any(name in parameters.values for name in names) and not all(map(parameters.is_absent, names)):
                return f"what limits its way home (`{names[0]}`) was not read yet"
        return None

    def wrong(self, values: Mapping[str, float]) -> str | None:
        """The first that leads its way home elsewhere than was proved, in words."""
        every = (each for group in self._limits for each in group if each.parameter in values)
        return next((words for each in every if (words := each.wrong(values[each.parameter], self._vehicle))), None)
