"""Draw the faults of a campaign's flights: number, kinds, times and parameters, by chance and coverage.

The same campaign, number and tally give the same scenario in any process and on any machine.

- Number: 1 to 6, with the probabilities of `HOW_MANY` in percent.
- Kind: in half of the cases a group by its weight in `GROUPS`, then one of its kinds with equal probability; otherwise
  the least tried of `CANDIDATES` such pairs of a kind and a state change.
- Time: in a quarter of the cases close to the previous fault, because faults may only fail in combination; otherwise in
  a fifth of the cases anywhere in the flight, and else from `BEFORE_US` before to `AFTER_US` after an observed state
  change, more likely near it.
- Parameters: by `RANGES`, uniform or uniform in the logarithm, in round steps.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from math import exp, log
from random import Random
from typing import Any, Final

from rtshcua.campaign.scenario_source import incident_text
from rtshcua.model import faults
from rtshcua.model.faults import CameraCounter, Direction, Fault, FlightMode, Voice
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.scenario import AfterStep, AtTime, Incident, Scenario, Start, When
from rtshcua.wire.approval import confirms

S: Final = 1_000_000
FLAVOURS: Final = ("px4", "ardupilot")
#: the percentage of flights with 1, 2, ... faults
HOW_MANY: Final = (35, 25, 18, 12, 7, 3)
CANDIDATES: Final = 8
BEFORE_US: Final = 3 * S
AFTER_US: Final = 6 * S
_LATER: Final = 1.5  # exponent of the distance: prefers near times
#: the probability that a fault is close to the previous one
TOGETHER: Final = 0.25

#: the weight and the kinds of each group
GROUPS: Final[tuple[tuple[int, tuple[type[Fault], ...]], ...]] = (
    (
        20,
        (
            faults.LinkDelay, faults.LinkJitter, faults.LinkReorder, faults.LinkLoss, faults.LinkSilence,
            faults.LinkSilence, faults.LinkQuality, faults.SecondVoice,
        ),
    ),
    (
        15,
        (
            faults.Freeze, faults.StaleSource, faults.MessageStuck, faults.MessageSilence, faults.Stall,
            faults.EstimatorUnhealthy, faults.Reboot,
        ),
    ),
    (11, (faults.GpsLoss, faults.GpsJump, faults.GpsDrift, faults.GpsGlitch)),
    (11, (faults.WindStep, faults.BatteryLevel, faults.BatteryCell, faults.BatteryVoltage)),
    (7, (faults.Obstacle, faults.Pillar)),
    (
        4,
        (faults.CameraLoss, faults.CameraSlow, faults.CameraFull, faults.CameraReboot, faults.GimbalStuck),
    ),
    (
        12,
        (
            faults.PilotMode, faults.PilotPause, faults.PilotGoto, faults.PilotVelocity, faults.PilotSpeed,
            faults.PilotSticks, faults.Kill,
        ),
    ),
    (
        12,
        (
            faults.RuntimeKilled, faults.BoundaryKilled, faults.HostStall, faults.DiskFull, faults.DiskStall,
            faults.ClockStep,
        ),
    ),
    (12, (faults.Approval, faults.Disapproval, faults.Recall, faults.Replacement, faults.Babble)),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class DrawnRange:
    """Integers from `low` to `high` in steps of `step`; `by_ratio`: uniform in the logarithm."""

    low: int
    high: int
    step: int
    by_ratio: bool = False

    def draw(self, chance: Random) -> int:
        """Draw one integer."""
        if not self.by_ratio:
            return self.low + self.step * chance.randrange((self.high - self.low) // self.step + 1)
        drawn = exp(chance.uniform(log(self.low), log(self.high)))
        return min(self.high, max(self.low, round(drawn / self.step) * self.step))


_LASTS = DrawnRange(200_000, 45 * S, 100_000, by_ratio=True)
_SOMEWHERE = DrawnRange(-60_000, 60_000, 1_000)
#: the range of a parameter, by kind and name; kind None: the default for all kinds with this parameter
RANGES: Final[Mapping[tuple[type[Fault] | None, str], DrawnRange]] = {
    (None, "for_us"): _LASTS,
    (None, "each_us"): DrawnRange(50_000, 5 * S, 50_000, by_ratio=True),
    (None, "delay_us"): DrawnRange(50_000, 5 * S, 50_000, by_ratio=True),
    (None, "jitter_us"): DrawnRange(20_000, 2 * S, 20_000, by_ratio=True),
    (None, "part"): DrawnRange(100, 5_000, 100),
    (None, "loss"): DrawnRange(500, 9_500, 500),
    (None, "quality"): DrawnRange(0, 10_000, 500),
    (None, "level"): DrawnRange(200, 6_000, 100),
    (None, "drop_mv"): DrawnRange(300, 3_700, 100),
    (None, "voltage_mv"): DrawnRange(12_000, 25_000, 500),
    (None, "speed_mm_s"): DrawnRange(0, 18_000, 500),
    (None, "gust_mm_s"): DrawnRange(0, 4_000, 500),
    (None, "from_deg"): DrawnRange(0, 350, 10),
    (None, "towards_deg"): DrawnRange(0, 350, 10),
    (None, "north_mm"): _SOMEWHERE,
    (None, "east_mm"): _SOMEWHERE,
    (None, "up_mm"): DrawnRange(2_000, 40_000, 1_000),
    (None, "north_mm_s"): DrawnRange(-1_500, 1_500, 100),
    (None, "east_mm_s"): DrawnRange(-1_500, 1_500, 100),
    (None, "distance_mm"): DrawnRange(500, 30_000, 500, by_ratio=True),
    (None, "radius_mm"): DrawnRange(500, 3_000, 500),
    (None, "height_mm"): DrawnRange(5_000, 60_000, 1_000),
    (None, "copies"): DrawnRange(1, 3, 1),
    (None, "shuffle"): DrawnRange(0, 1_000, 1),
    (None, "by_us"): DrawnRange(-3_600 * S, 3_600 * S, 10 * S),
    (faults.GpsJump, "north_mm"): DrawnRange(-15_000, 15_000, 500),
    (faults.GpsJump, "east_mm"): DrawnRange(-15_000, 15_000, 500),
    (faults.GpsGlitch, "north_mm"): DrawnRange(-40_000, 40_000, 1_000),
    (faults.GpsGlitch, "east_mm"): DrawnRange(-40_000, 40_000, 1_000),
    (faults.PilotVelocity, "north_mm_s"): DrawnRange(-4_000, 4_000, 500),
    (faults.PilotVelocity, "east_mm_s"): DrawnRange(-4_000, 4_000, 500),
    (faults.PilotSpeed, "speed_mm_s"): DrawnRange(500, 10_000, 500),
    (faults.Pillar, "speed_mm_s"): DrawnRange(0, 2_000, 500),
    (faults.RuntimeKilled, "for_us"): DrawnRange(500_000, 20 * S, 500_000, by_ratio=True),
    (faults.HostStall, "for_us"): DrawnRange(100_000, 8 * S, 100_000, by_ratio=True),
    (faults.DiskStall, "for_us"): DrawnRange(100_000, 20 * S, 100_000, by_ratio=True),
    (faults.Stall, "for_us"): DrawnRange(200_000, 20 * S, 100_000, by_ratio=True),
    (faults.StaleSource, "delay_us"): DrawnRange(200_000, 8 * S, 100_000, by_ratio=True),
    (faults.Babble, "copies"): DrawnRange(5, 200, 5, by_ratio=True),
}
#: messages that may be silenced or stuck
MESSAGES: Final = (
    "GLOBAL_POSITION_INT", "HEARTBEAT", "SYS_STATUS", "BATTERY_STATUS", "GPS_RAW_INT", "EXTENDED_SYS_STATE",
    "POSITION_TARGET_GLOBAL_INT", "DISTANCE_SENSOR", "RADIO_STATUS", "COMMAND_ACK", "TIMESYNC", "ATTITUDE",
)  # fmt: skip
_MODES: Final = tuple(FlightMode)
_LASTS_FOR_GOOD: Final = 0.15  # the probability that a fault without end is drawn, where allowed


@dataclass(frozen=True, slots=True)
class Moment:
    """An observed state change of a flight: its label, without numbers, and its time."""

    label: str
    at_us: int


@dataclass
class CampaignTally:
    """The observations of a campaign that guide the next round.

    `moments` are the state changes of flights, by flavour; `tried` counts pairs of a fault kind and the state change
    near it.
    """

    moments: dict[str, list[Moment]] = field(default_factory=dict)
    tried: dict[tuple[str, str], int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class FaultSpace:
    """The space that a campaign draws from: the skills of the mission's steps, its duration by flavour, the roles."""

    skills: tuple[str, ...]
    lasts_us: Mapping[str, int]
    roles: tuple[str, ...] = ()
    flavours: tuple[str, ...] = FLAVOURS
    kinds: frozenset[type[Fault]] = frozenset(faults.KINDS.values())
    read: tuple[str, ...] = ()
    """The messages of the policy's signals: half of the silenced or stuck messages are drawn from these."""
    answers: tuple[Incident, ...] = ()
    """The approvals of every flight, in addition to the drawn faults: `answers_of`."""


@dataclass(frozen=True, slots=True)
class Drawn:
    """A scenario with one seed and flavour, and the pairs that it tries."""

    scenario: Scenario
    tries: tuple[tuple[str, str], ...]


#: the label of a time drawn from the whole flight
ANYWHERE: Final = "anywhere"


def draw(campaign: int, number: int, space: FaultSpace, tally: CampaignTally) -> Drawn:
    """Draw flight `number` of the campaign with this seed."""
    chance = Random(f"campaign {campaign} flight {number}")
    flavour = space.flavours[number % len(space.flavours)]
    seed = chance.randrange(1, 1 << 31)
    many = chance.choices(range(1, len(HOW_MANY) + 1), HOW_MANY)[0]
    incidents: list[Incident] = []
    tries: list[tuple[str, str]] = []
    while len(incidents) < many:
        kind, moment = _pair(chance, space, tally.moments.get(flavour, []), tally)
        fault = _fault(chance, kind, space)
        when = _close(chance, incidents[-1].when) if incidents else None
        when = when or _when(chance, space, flavour, moment)
        incidents.append(Incident(when, fault, incident_text(when, fault, space.skills)))
        tries.append((kind.__name__, ANYWHERE if moment is None else moment.label))
    start = Start(
        battery=chance.choice((10_000, 10_000, 9_000, 8_000)),
        wind_mm_s=chance.choice((0, 2_000, 3_000, 5_000)),
        wind_from_deg=10 * chance.randrange(36),
        gust_mm_s=chance.choice((0, 500, 1_000)),
    )
    name = f"flight {number} of campaign {campaign}"
    scenario = Scenario(name, (flavour,), seed, seed, start, (*incidents, *space.answers), ())
    return Drawn(scenario, tuple(tries))


#: us: when an approval is given, after the previous step was sent (or the start of the run)
ANSWERS_US: Final = (1 * S, 5 * S)


def answers_of(policy: Policy, mission: Mission) -> Iterator[Incident]:
    """Yield an approval for every step and every role that a `confirm` rule may require."""
    skills = tuple(policy.contracts[each.skill].name for each in mission.invocations)
    for step, invocation in enumerate(mission.invocations):
        for number, role in enumerate(policy.roles):
            if confirms(policy, invocation, number):
                when = AfterStep(step - 1, *ANSWERS_US) if step else AtTime(*ANSWERS_US)
                fault = faults.Approval(0, role)
                yield Incident(when, fault, incident_text(when, fault, skills))


def _pair(
    chance: Random, space: FaultSpace, moments: Sequence[Moment], tally: CampaignTally
) -> tuple[type[Fault], Moment | None]:
    guided = bool(moments) and chance.random() < 0.5
    pairs = [(_kind(chance, space), _moment(chance, moments)) for _ in range(CANDIDATES if guided else 1)]
    return min(pairs, key=lambda pair: tally.tried.get((pair[0].__name__, pair[1].label if pair[1] else ANYWHERE), 0))


def _kind(chance: Random, space: FaultSpace) -> type[Fault]:
    groups = [(weight, [kind for kind in kinds if kind in space.kinds]) for weight, kinds in GROUPS]
    groups = [(weight, kinds) for weight, kinds in groups if kinds]
    return chance.choice(chance.choices([kinds for _, kinds in groups], [weight for weight, _ in groups])[0])


def _moment(chance: Random, moments: Sequence[Moment]) -> Moment | None:
    if not moments or chance.random() < 0.2:
        return None
    label = chance.choice(sorted({each.label for each in moments}))
    return chance.choice([each for each in moments if each.label == label])


def _when(chance: Random, space: FaultSpace, flavour: str, moment: Moment | None) -> AtTime | AfterStep:
    if moment is None:
        if chance.random() < 0.5:
            after = DrawnRange(0, 20 * S, 100_000).draw(chance)
            return AfterStep(chance.randrange(len(space.skills)), after, after)
        at = DrawnRange(0, max(space.lasts_us[flavour], S), 100_000).draw(chance)
        return AtTime(at, at)
    at = max(moment.at_us + _away(chance), 0)
    return AtTime(at, at)


def _close(chance: Random, before: When) -> AtTime | AfterStep | None:
    """Return a time close to that of the previous fault, or None."""
    if chance.random() >= TOGETHER:
        return None
    at = max(before.from_us + _away(chance), 0)
    return AfterStep(before.step, at, at) if isinstance(before, AfterStep) else AtTime(at, at)


def _away(chance: Random) -> int:
    far: float = chance.random() ** _LATER
    return round((AFTER_US if chance.random() < 0.6 else -BEFORE_US) * far / 20_000) * 20_000


def _fault(chance: Random, kind: type[Fault], space: FaultSpace) -> Fault:
    values: dict[str, Any] = {"at_us": 0}
    for each in fields(kind):
        if each.name == "at_us":
            continue
        optional = each.default is None
        if optional and chance.random() < _LASTS_FOR_GOOD:
            values[each.name] = None
            continue
        values[each.name] = _value(chance, kind, each.name, space)
    made = kind(**values)
    if isinstance(made, faults.LinkSilence) and made.for_us is None:
        return replace(made, held=False)  # frames that are held forever are lost
    return made


def _value(chance: Random, kind: type[Fault], name: str, space: FaultSpace) -> object:
    if name == "way":
        return chance.choice((Direction.BOTH, Direction.BOTH, Direction.UP, Direction.DOWN))
    if name == "held":
        return chance.random() < 0.25
    if name == "says":
        return chance.choice(tuple(Voice))
    if name == "counter":
        return chance.choice(tuple(CameraCounter))
    if name == "mode":
        return chance.choice(_MODES)
    if name == "message":
        return chance.choice(space.read if space.read and chance.random() < 0.5 else MESSAGES)
    if name == "role":
        return chance.choice(space.roles or ("supervisor",))
    span = RANGES.get((kind, name)) or RANGES[None, name]
    return span.draw(chance)
