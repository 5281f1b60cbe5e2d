"""Parameters of the autopilot that lower or raise its way home, and the values they need so that it flies at the proved
height (`decision.volume`). Sources: docs/flying/returns.md.
"""

from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.messages import Message
from rtshcua.adapters.vehicle.parameters import RETRIES, RETRY_US, VehicleParameters
from rtshcua.decision.volume import SHORT, STEEP, cone
from rtshcua.mavlink.quantise import quantise
from rtshcua.model.flat.policy import VehicleLimits

_METRE: Final = 1_000  # mm


class Need(NamedTuple):
    """The required range of a parameter: at least or at most this, in mm or mm/s; a slope in 1/1000."""

    least: int | None = None
    most: int | None = None


def near(vehicle: VehicleLimits) -> Need | None:
    """The greatest distance from home at which a return may be low, where a return height is declared."""
    return Need(most=cone(vehicle.return_altitude)) if vehicle.return_altitude else None


def slope(vehicle: VehicleLimits) -> Need | None:
    """The least slope of the cone with low returns; 0 for no cone."""
    return Need(least=STEEP * _METRE) if vehicle.return_altitude else None


def climb(vehicle: VehicleLimits) -> Need | None:
    """The greatest climb of a return above both its height and the vehicle's."""
    return Need(most=0) if vehicle.return_altitude else None


def corner(vehicle: VehicleLimits) -> Need | None:
    """The greatest distance from the turning point at which it turns, and so sets off for home below its height."""
    return Need(most=SHORT) if vehicle.return_altitude else None


def plain(vehicle: VehicleLimits) -> Need | None:
    """A choice of which only 0 is proved: heights above home, a return to home, no rally points."""
    return ONLY_ZERO if vehicle.return_altitude else None


ONLY_ZERO: Final = Need(0, 0)


class WrongSetting(NamedTuple):
    """A value that does not fit: the parameter, its value and the accepted one, in words and as a value to set."""

    parameter: str
    is_now: str
    accepted: str
    proved: str  # the property of the way home that it breaks

    @property
    def text(self) -> str:
        """What is wrong and what to do."""
        name = self.parameter
        return f"its way home would not be {self.proved} (`{name}` is {self.is_now}): set `{name}` to {self.accepted}"


class ReturnLimit(NamedTuple):
    """A parameter, the mm in one of its units (a choice or a count: 1), its required range, and whether 0 means "off"
    and is always accepted. A choice has `words` for its values. `proved` is the property that a wrong value breaks.
    """

    parameter: str
    mm: int
    need: Callable[[VehicleLimits], Need | None]
    may_be_off: bool = False
    words: Mapping[float, str] = {}
    proved: str = "at the proved height"

    def wrong(self, value: float, vehicle: VehicleLimits) -> WrongSetting | None:
        """What is wrong with its value for the vehicle of a policy."""
        need = self.need(vehicle)
        return None if need is None or (self.may_be_off and value == 0) else self.misfit(value, need)

    def misfit(self, value: float, need: Need) -> WrongSetting | None:
        """What is wrong with its value for this range."""
        has = quantise(value, self.mm, 1)
        least, most = need
        if has is not None and (least is None or has >= least) and (most is None or has <= most):
            return None
        if least == most:
            accepted = self._told((least or 0) / self.mm)
        else:
            accepted = f"at most {(most or 0) // self.mm}" if least is None else f"at least {-(-least // self.mm)}"
        return WrongSetting(self.parameter, self._told(value), accepted, self.proved)

    def _told(self, value: float) -> str:
        return f"{value:g}, {self.words[value]}" if value in self.words else f"{value:g}"


#: PX4 and ArduCopter: returns to a rally point, along a mission, or above the terrain
ELSEWHERE: Final = "to the proved place"
ABOVE_HOME: Final = "at the proved heights above home"
RETURNS_TO: Final[Mapping[float, str]] = {
    0: "home, or a rally point that is nearer", 1: "a rally point or a mission's landing", 2: "along the mission",
    3: "the shortest of rally point, mission and home", 4: "home or along the mission, whichever is shorter",
    5: "a rally point or a landing that is safe",
}  # fmt: skip
HEIGHTS_FROM: Final[Mapping[float, str]] = {0: "home", 1: "the terrain"}

RTL_TYPE: Final = ReturnLimit("RTL_TYPE", 1, plain, words=RETURNS_TO, proved=ELSEWHERE)
RTL_ALT_TYPE: Final = ReturnLimit("RTL_ALT_TYPE", 1, plain, words=HEIGHTS_FROM, proved=ABOVE_HOME)
RALLY_TOTAL: Final = ReturnLimit("RALLY_TOTAL", 1, plain, words={0: "none"}, proved=ELSEWHERE)


class ReturnLimits:
    """The limits of one vehicle, as far as it reports its parameters. `limits` holds groups of alternative names, of
    which it has one.
    """

    def __init__(self, limits: tuple[tuple[ReturnLimit, ...], ...], vehicle: VehicleLimits) -> None:
        self._limits = limits if vehicle.return_altitude else ()
        self._vehicle = vehicle

    def ask(self, parameters: VehicleParameters) -> None:
        """Request the unknown parameters."""
        for group in self._limits:
            if not any(each.parameter in parameters.values for each in group):
                for each in group:
                    parameters.read(each.parameter)

    def unread(self, parameters: VehicleParameters) -> str | None:
        """That a limit was not read yet, in words. A parameter that the vehicle lacks limits nothing."""
        for group in self._limits:
            names = [each.parameter for each in group]
            if not any(name in parameters.values for name in names) and not all(map(parameters.is_absent, names)):
                return f"the limit of the way home (`{names[0]}`) was not read yet"
        return None

    def wrong(self, values: Mapping[str, float]) -> str | None:
        """The first limit that leads its way home elsewhere than proved, in words."""
        every = (each for group in self._limits for each in group if each.parameter in values)
        found = (each.wrong(values[each.parameter], self._vehicle) for each in every)
        return next((wrong.text for wrong in found if wrong is not None), None)

    def silent(self, parameters: VehicleParameters) -> list[str]:
        """The groups of parameters without an answer: a missing parameter limits nothing, but an existing one that was
        not answered may.
        """
        groups = [[each.parameter for each in group] for group in self._limits]
        return [" or ".join(f"`{name}`" for name in group) for group in groups if all(map(parameters.is_absent, group))]


_UNSUPPORTED: Final = 3  # MAV_MISSION_RESULT


class RallyPoints:
    """The number of rally points, to which a return may lead if they are nearer than home: requested by the mission
    protocol where no parameter holds it. A vehicle that does not answer counts as one without, with a note.
    """

    def __init__(self, *, wanted: bool, slack: int = 1) -> None:
        self._wanted = wanted
        self._retry_us = RETRY_US * slack
        self._asked_us: int | None = None
        self._asked, self._silent = 0, False
        self._count: int | None = None

    def due(self, system: int, now_us: int) -> list[Message]:
        """The request, if due."""
        early = self._asked_us is not None and now_us - self._asked_us < self._retry_us
        if not self._wanted or self._count is not None or early:
            return []
        if self._asked > RETRIES:
            self._silent = True
            return []
        self._asked_us, self._asked = now_us, self._asked + 1
        return [messages.rally_list(system)]

    def take(self, name: str, message: Any, system: int) -> list[Message]:
        """Take in a mission message; return the answer."""
        if not self._wanted or message.mission_type != messages.RALLY:
            return []
        if name == "MISSION_COUNT":
            self._count = message.count
            return [messages.rally_received(system)] if message.count else []
        if name == "MISSION_ACK" and message.type == _UNSUPPORTED:
            self._count = 0
        return []

    @property
    def silent(self) -> bool:
        """Whether it was asked often enough without an answer."""
        return self._silent and self._count is None

    @property
    def unread(self) -> str | None:
        """That the number is not known yet, in words."""
        waits = self._wanted and self._count is None and not self.silent
        return "the vehicle's rally points were not counted yet" if waits else None

    @property
    def wrong(self) -> str | None:
        """That there are rally points, in words."""
        if not self._count:
            return None
        many = "1 rally point" if self._count == 1 else f"{self._count} rally points"
        return f"its way home would not be {ELSEWHERE} (it has {many}): clear them and upload none"
