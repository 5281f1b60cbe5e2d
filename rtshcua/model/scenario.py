"""A scenario, lowered: which flight, what goes wrong in it and when, and what must come of it.

`ground` makes it of a `scenario` declaration, a campaign draws it by chance, `virtual` flies it. All times are in us.
"""

from dataclasses import dataclass

from rtshcua.model.faults import Fault
from rtshcua.model.flat.code import Clause

#: the kinds of autopilot that there are to fly on
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
    """So long after the start of the run; between the two, drawn by the seed, where they differ."""

    from_us: int
    to_us: int


@dataclass(frozen=True, slots=True)
class AfterStep:
    """So long after step `step` of the mission was sent to the vehicle; if it never is, never."""

    step: int
    from_us: int
    to_us: int


@dataclass(frozen=True, slots=True)
class OnCondition:
    """So long after a condition over the signals, as the runtime knows them, was true for the first time."""

    condition: Clause
    from_us: int
    to_us: int


When = AtTime | AfterStep | OnCondition


@dataclass(frozen=True, slots=True)
class Incident:
    """Something goes wrong. `text` is as it was written; the fault's `at_us` is 0, and set when its time has come."""

    when: When
    fault: Fault
    text: str


@dataclass(frozen=True, slots=True)
class Start:
    """How the vehicle, the air and the time are at the start; None: as the simulated vehicle comes, and a minute after
    the mission was issued. 1/10000, mm/s, degrees, us since the epoch.
    """

    battery: int | None = None
    wind_mm_s: int | None = None
    wind_from_deg: int = 0
    gust_mm_s: int = 0
    utc_us: int | None = None


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
    """This skill was sent to the vehicle, or was `never`."""

    skill: str
    never: bool = False


@dataclass(frozen=True, slots=True)
class ReactsWithin:
    """From the frame that broke a watched clause to the first frame of the fallback never longer than this."""

    most_us: int


@dataclass(frozen=True, slots=True)
class KeepsAway:
    """The vehicle is really never nearer than this to a zone of the policy, or to what stands around (`zone` None)."""

    zone: int | None
    least_mm: int


@dataclass(frozen=True, slots=True)
class EndsInside:
    """Where the vehicle really is at the end is inside this zone of the policy, seen from above."""

    zone: int


Expected = EndsWith | Decides | Flies | ReactsWithin | KeepsAway | EndsInside


@dataclass(frozen=True, slots=True)
class ScenarioExpectation:
    """What must come of it; `text` is as it was written, `start` and `end` where, in file `source`."""

    what: Expected
    text: str
    source: str
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Scenario:
    """Flights of one mission, one a seed and kind of autopilot (`px4`, `ardupilot`)."""

    name: str
    flavours: tuple[str, ...]
    first_seed: int
    last_seed: int
    start: Start
    incidents: tuple[Incident, ...]
    expectations: tuple[ScenarioExpectation, ...]
