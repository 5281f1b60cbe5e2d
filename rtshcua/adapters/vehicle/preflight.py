"""Checks and settings on the ground before a vehicle counts as ready: its position, its return altitude, its fence. A
vehicle that flies already is left alone.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final

from rtshcua.adapters.vehicle import bounds, messages
from rtshcua.adapters.vehicle.fence import HEEDED as FENCE_HEEDED
from rtshcua.adapters.vehicle.fence import Fencing, fence_of
from rtshcua.adapters.vehicle.flavour import AutopilotFlavour, ReturnAltitude
from rtshcua.adapters.vehicle.messages import Message
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.adapters.vehicle.parameters import RETRIES, RETRY_US, VehicleParameters
from rtshcua.adapters.vehicle.returns import RallyPoints, ReturnLimits
from rtshcua.mavlink.quantise import hypot_mm, quantise
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import Projection, project

#: The tolerance of the return altitude in mm: it is a 32-bit float, or whole centimetres.
SAME_MM: Final = 10
#: How often the vehicle is asked why it would not arm; ArduPilot reports it by itself each 30 s.
CHECK_US: Final = 10_000_000
#: The margin in m, above the required radius, of the radius that is advised.
ADVISED_ROOM_M: Final = 2
#: The messages that `take` uses.
HEEDED: Final = (*FENCE_HEEDED, "PARAM_VALUE")


class Preflight:
    """Compares position and return altitude with the policy, sets the fence, and asks why the vehicle would not arm.

    `notes` collects texts for the operator. `fence` False leaves the vehicle's fence unchanged; with `judges` it is
    judged all the same. `steps` are the mission's: the autopilot's own bounds must leave room for them. `meant` holds
    values that replace those of parameters. `slack` multiplies each timeout, as in `Driver`.
    """

    def __init__(
        self, policy: Policy, flavour: AutopilotFlavour, seen: ObservedVehicle, steps: Sequence[Invocation] = (),
        *, fence: bool, slack: int = 1, judges: bool = False, meant: Mapping[str, float] = MappingProxyType({}),
    ) -> None:  # fmt: skip
        self._flavour = flavour
        self._seen = seen
        self._projection, self._home_within = policy.projection, policy.vehicle.home_within
        self._wanted_mm = policy.vehicle.return_altitude
        self._limits = ReturnLimits(flavour.limits, policy.vehicle)
        self._rally = RallyPoints(wanted=flavour.counts_rally_points and bool(self._wanted_mm), slack=slack)
        self._parameters = VehicleParameters(bytewise=flavour.bytewise, slack=slack)
        self._fencing = Fencing(policy, flavour, self._parameters, wanted=fence, slack=slack)
        self._policy, self._steps = policy, steps
        self._arms = (fence or judges) and bool(flavour.fence.switches and fence_of(policy, flavour.fence).items)
        self._meant = meant
        self._told = self._rally_told = False
        self._missed: set[str] = set()  # unanswered limits of the way home that were reported already
        self._advised = 0  # the last advised radius of its circle
        self._reached: tuple[tuple[int, int], bounds.FlightReach] | None = None  # a position and the reach from there
        self._checked_us: int | None = None
        self.notes: list[str] = []

    def due(self, system: int, now_us: int) -> list[Message]:
        """The messages to send now."""
        if self._wanted_mm and self._found is None:
            for each in self._flavour.returns:
                self._parameters.read(each.parameter)
        self._limits.ask(self._parameters)
        for name in self._flavour.own_fence.names if self._steps else ():
            if name not in self._parameters.values:
                self._parameters.read(name)
        out = [*self._parameters.due(system, now_us), *self._rally.due(system, now_us)]
        if self._seen.prearm_fails and (self._checked_us is None or now_us - self._checked_us >= CHECK_US):
            self._checked_us = now_us
            out.append(messages.command(system, messages.RUN_PREARM_CHECKS))
        if not (self.unplaced or self.astray or self.unread):  # a fence is computed for one position
            out += self._fencing.due(system, now_us)
        self._note_results()
        return out

    def _note_results(self) -> None:
        """Note each result once."""
        for names in self.silent:
            if names not in self._missed:
                self._missed.add(names)
                self.notes.append(
                    f"{names} was not answered within {RETRIES * RETRY_US // 1_000_000} s, so the vehicle counts as "
                    "one without it; if it has the parameter, its way home may differ from the proved one"
                )
        if self._rally.silent and not self._rally_told:
            self._rally_told = True
            self.notes.append(
                f"the number of rally points was not reported within {(RETRIES + 1) * RETRY_US // 1_000_000} s, so the "
                "vehicle counts as one without; if it has any, its way home may differ from the proved one"
            )
        if not self._told and self._fencing.unready is None:
            self._told = True
            self.notes.append(self._fencing.note)
            self.notes += self._narrower_than_airspace()

    def take(self, name: str, message: Any, system: int, now_us: int) -> list[Message]:
        """Take in a message of the autopilot; return the answer."""
        if name == "PARAM_VALUE":
            self._parameters.take(message)
            return []
        return self._rally.take(name, message, system) + self._fencing.take(name, message, system, now_us)

    def _narrower_than_airspace(self) -> list[str]:
        """The parts of the airspace that its own fence excludes although the mission does not need them."""
        if not self._steps:
            return []
        found = bounds.narrower(
            self._flavour.own_fence, self._values, bounds.airspace_reach(self._policy), 0, armed=self._arms
        )
        return [
            f"the vehicle's own fence is narrower than the airspace: `{each.parameter}` is {each.value:g}, and the "
            f"airspace goes {each.needed} m {each.about}"
            for each in found
        ]

    @property
    def fencing(self) -> Fencing:
        """The procedure that sets its fence."""
        return self._fencing

    @property
    def silent(self) -> list[str]:
        """The unanswered parameters that would limit its way home."""
        return self._limits.silent(self._parameters)

    @property
    def unready(self) -> str | None:
        """What is not settled yet, in words."""
        return self.unplaced or self.astray or self.unread or self._fencing.unready

    @property
    def astray(self) -> str | None:
        """What contradicts the policy, in words."""
        returns = None if self._found is None else self._returns_at(self._found)
        wrong = self._limits.wrong(self._values) or self._rally.wrong
        return self._far_from_home() or returns or wrong or self._bounded()

    @property
    def unfit(self) -> str | None:
        """Which parameter contradicts the policy or the mission, in words: waiting does not help."""
        returns = None if self._found is None else self._returns_at(self._found)
        return returns or self._limits.wrong(self._values) or self._rally.wrong or self._bounded()

    @property
    def unplaced(self) -> str | None:
        """That its position is not known, in words."""
        return None if self._seen.located else "the vehicle does not report its position"

    @property
    def unread(self) -> str | None:
        """That its return altitude is not known, in words."""
        if not self._wanted_mm or self._found is not None:
            return self._limits.unread(self._parameters) or self._rally.unread or self._bounds_unread()
        names = [each.parameter for each in self._flavour.returns]
        quoted = " or ".join(f"`{name}`" for name in names)
        if all(map(self._parameters.is_absent, names)):
            return f"the vehicle does not report its return altitude ({quoted})"
        return f"the vehicle's return altitude ({quoted}) was not read yet"

    def _bounds_unread(self) -> str | None:
        """That the bounds of its own fence are not known, in words. A bound that the vehicle lacks limits nothing."""
        own, parameters = self._flavour.own_fence, self._parameters
        if not self._steps:
            return None
        if not all(name in parameters.values or parameters.is_absent(name) for name in own.names):
            return "the bounds of the vehicle's own fence were not read yet"
        missing = bounds.unknown(own, self._values, armed=self._arms)
        if missing is None or missing == own.types:
            return None
        return f"the vehicle does not report a bound of its own fence (`{missing}`)"

    def _bounded(self) -> str | None:
        """That its own fence excludes places that the mission goes to."""
        if not self._steps or not self._seen.located or self._bounds_unread() is not None:
            return None
        own, values = self._flavour.own_fence, self._values
        found = next(
            bounds.narrower(own, values, self._reach(), self._policy.vehicle.position_error, armed=self._arms), None
        )
        if found is None:
            return None
        least = "most" if found.bit == bounds.FLOOR_BIT else "least"
        off = "" if own.types is None else f", or take {found.bit} out of `{own.types}`, which is {values[own.types]:g}"
        return (
            f"the vehicle's own fence ends {found.value:g} m {found.about} (`{found.parameter}`), and the mission has "
            f"targets beyond it, which are ignored: set `{found.parameter}` to at {least} {self._advice(found)}{off}"
        )

    def _reach(self) -> bounds.FlightReach:
        """How far the mission goes from its position; cached, because the position rarely changes."""
        place = self._seen.latitude, self._seen.longitude
        if self._reached is None or self._reached[0] != place:
            home = project(self._projection, *place)
            self._reached = place, bounds.reach_of(self._steps, self._policy, home)
        return self._reached[1]

    def _advice(self, found: bounds.Narrow) -> int:
        """The value to set a bound to. Its position, and so the required radius, is known to some decimetres: the
        advice has a margin, and is repeated while it suffices.
        """
        if found.bit != bounds.CIRCLE_BIT:
            return found.needed
        if self._advised < found.needed:
            self._advised = found.needed + ADVISED_ROOM_M
        return self._advised

    def _far_from_home(self) -> str | None:
        """That it is too far from the policy's home. Its position becomes its home, and the policy is laid out around
        home.
        """
        if not self._seen.located:
            return None
        away = distance_from_home(self._projection, self._seen.latitude, self._seen.longitude)
        if away <= self._home_within:
            return None
        return f"the vehicle is {away // 1_000} m from the policy's home, more than {self._home_within // 1_000} m"

    @property
    def _values(self) -> Mapping[str, float]:
        """Its parameters, or their values in a flight."""
        values, meant = self._parameters.values, self._meant
        return {name: meant.get(name, value) for name, value in values.items()} if meant else values

    @property
    def _found(self) -> ReturnAltitude | None:
        values = self._parameters.values
        return next((each for each in self._flavour.returns if each.parameter in values), None)

    def _returns_at(self, found: ReturnAltitude) -> str | None:
        if not self._wanted_mm:
            return None
        height = quantise(self._values[found.parameter], found.mm, 1)
        if height is not None and abs(height - self._wanted_mm) <= SAME_MM:
            return None
        has = "no number" if height is None else f"{height / 1_000:g} m"
        should = quantise(self._wanted_mm, 1, found.mm)
        return (
            f"the vehicle returns at {has} (`{found.parameter}`), and the policy says {self._wanted_mm / 1_000:g} m: "
            f"set `{found.parameter}` to {should} (for one flight: `--set {found.parameter}={should}`), "
            "or change `return at`"
        )


def distance_from_home(projection: Projection, latitude: int, longitude: int) -> int:
    """Distance in mm of a place (1e-7 degree) from the declared home."""
    return hypot_mm(*project(projection, latitude, longitude))
