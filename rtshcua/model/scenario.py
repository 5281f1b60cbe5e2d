"""A lowered scenario: the flight, its faults with their times, and the expected results.

`ground` lowers it from a `scenario` declaration, a campaign draws it at random, `virtual` flies it. All times are
in us.
"""

from dataclasses import dataclass

from rtshcua.model.faults import Fault, GimbalStuck, PayloadFault
from rtshcua.model.flat.code import Clause

#: the available autopilots
FLAVOURS = ("px4", "ardupilot")
#: the ways in which a run ends (`onboard.ports.Ending`); sources write `_` for `-`
ENDINGS = (
    "completed",
    "aborted",
    "refused",
    "recalled",
    "cancelled",
    "stood-down",
    "crashed",
    "link-lost",
    "interrupted",
    "evidence-lost",
)
#: how many seeds one scenario may have
MAX_SEEDS = 100_000


@dataclass(frozen=True, slots=True)
class AtTime:
    """A time after the start of the run; drawn from the seed between the two bounds if they differ."""

    from_us: int
    to_us: int


@dataclass(frozen=True, slots=True)
class AfterStep:
    """A time after step `step` of the mission was sent to the vehicle; never, if it is not sent."""

    step: int
    from_us: int
    to_us: int


@dataclass(frozen=True, slots=True)
class OnCondition:
    """A time after a condition over the signals, as the runtime knows them, was first true."""

    condition: Clause
    from_us: int
    to_us: int


When = AtTime | AfterStep | OnCondition


@dataclass(frozen=True, slots=True)
class Incident:
    """A fault with its time. `text` is as written; the fault's `at_us` is 0, and set when its time has come."""

    when: When
    fault: Fault
    text: str


@dataclass(frozen=True, slots=True)
class Start:
    """The vehicle, the air and the time at the start; None: the default of the simulated vehicle, and a minute after
    the issue of the mission; for `camera` and `gimbal`, what the policy's contracts command. 1/10000, mm/s, degrees, us
    since the epoch.
    """

    battery: int | None = None
    wind_mm_s: int | None = None
    wind_from_deg: int = 0
    gust_mm_s: int = 0
    utc_us: int | None = None
    camera: bool | None = None
    gimbal: bool | None = None


@dataclass(frozen=True, slots=True)
class EndsWith:
    """The run ends in one of these ways (`onboard.ports.Ending`)."""

    endings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Decides:
    """Some decision of the run has this outcome and, where given, flies this skill, for this reason, by this clause."""

    outcome: str
    target: str | None = None
    reason: str | None = None
    clause: str | None = None


@dataclass(frozen=True, slots=True)
class Flies:
    """This skill was sent to the vehicle, or `never`."""

    skill: str
    never: bool = False


@dataclass(frozen=True, slots=True)
class ReactsWithin:
    """The reaction, from the frame that broke a watched clause to the first frame of the fallback, never takes
    longer.
    """

    most_us: int


@dataclass(frozen=True, slots=True)
class KeepsAway:
    """The true distance of the vehicle from a zone of the policy, or from obstacles (`zone` None), is never smaller."""

    zone: int | None
    least_mm: int


@dataclass(frozen=True, slots=True)
class EndsInside:
    """The true position of the vehicle at the end is inside this zone of the policy, seen from above."""

    zone: int


Expected = EndsWith | Decides | Flies | ReactsWithin | KeepsAway | EndsInside


@dataclass(frozen=True, slots=True)
class ScenarioExpectation:
    """An expected result; `text` is as written, `start` and `end` its position in file `source`."""

    what: Expected
    text: str
    source: str
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Scenario:
    """Flights of one mission, one for each seed and kind of autopilot (`px4`, `ardupilot`)."""

    name: str
    flavours: tuple[str, ...]
    first_seed: int
    last_seed: int
    start: Start
    incidents: tuple[Incident, ...]
    expectations: tuple[ScenarioExpectation, ...]

    @property
    def has_camera(self) -> bool | None:
        """Whether its vehicle has a camera: as the start says, or if one fails. None: if its policy commands one."""
        fails = any(isinstance(each.fault, PayloadFault) for each in self.incidents)
        return True if fails and self.start.camera is None else self.start.camera

    @property
    def has_gimbal(self) -> bool | None:
        """The same of a gimbal."""
        fails = any(isinstance(each.fault, GimbalStuck) for each in self.incidents)
        return True if fails and self.start.gimbal is None else self.start.gimbal
