"""The judge's own supervision: simple and slow, based only on the signed policy and mission.

Written from docs/flying/supervision.md, speeds.md and returns.md. It imports nothing of `onboard` or `decision` (an
import contract enforces this), so that it does not repeat their defects. Geometry is in floating point: results within
`_SLACK_MM` of an edge or `_SLACK_CHARGE` of a charge are doubtful, and the judge draws no conclusion from them.

The value of a condition is a set of truths True, False and None (unknown): one truth for a single place, possibly
more for all places of a path. Kleene's `and` is the minimum in the order False, None, True.
"""

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from math import hypot, sqrt
from operator import eq, ge, gt, le, lt, ne
from typing import Final, NamedTuple

from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.contract import PLACE, Link, MotionKind
from rtshcua.model.flat.limits import DAY, FULL, MAX_GAP, MAX_SPEED, MAX_VALUE, WEEK
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Monitor, MonitorKind, Policy, Rule, RuleKind, Speeds
from rtshcua.model.flat.signal import DRAIN, NUMBER, POSITION
from rtshcua.model.flat.situation import Now
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, MAX_COORDINATE, Zone
from rtshcua.virtual.flight_record import HeardReadings, Turn
from rtshcua.virtual.zone_truth import Answers as Truths
from rtshcua.virtual.zone_truth import Edge, apart_mm, both, daily, edges, exists, is_timed, level_mm, shown

#: a number as a multiple of the height plus a constant; None: unknown
HeightTerm = tuple[int, int] | None
#: east and north of home, in mm
GroundPoint = tuple[float, float]
#: a half-open time interval, in us since the start
Span = tuple[int, int]

DURATION: Final = "maximum duration"
WAY_HOME: Final = "the reserve and the way home"
_TRUE: Final[Truths] = frozenset({True})
_FALSE: Final[Truths] = frozenset({False})
_UNKNOWN: Final[Truths] = frozenset({None})
#: mm and 1/10000: rounding errors of places and of charges
_SLACK_MM: Final = 10
_SLACK_CHARGE: Final = 2
#: s: the time of a return in addition to its path (docs/flying/speeds.md)
_BEGINS_S, _SETTLES_S, _OVER_HOME_S, _LANDED_S = 1, 4, 5, 8
#: mm: how far below its height a return may start, and how near home it may fly lower (docs/flying/returns.md)
_SHORT_MM, _NEAR_MM = 2_000, 10_000
_MOST_DRAIN: Final = 60 * FULL  # of a charge in a minute
_RELATIONS: Final[Mapping[int, Callable[[float, float], bool]]] = {
    Op.LT: lt,
    Op.LE: le,
    Op.GT: gt,
    Op.GE: ge,
    Op.EQ: eq,
    Op.NE: ne,
}


@cache
def _not(truths: Truths) -> Truths:
    return frozenset(None if each is None else not each for each in truths)


def everywhere(truths: Truths) -> bool | None:
    """Return the truth of "everywhere": False if any is False, otherwise None if any is None."""
    return False if False in truths else None if None in truths else True


class SweptPath(NamedTuple):
    """All places on a straight line, at all heights of an interval, in mm; widened by `error` horizontally.

    `start` is None if the place is unknown, `heights` if the height is unknown.
    """

    start: GroundPoint | None
    end: GroundPoint
    heights: tuple[float, float] | None
    error: int = 0


class ConditionQuery(NamedTuple):
    """The context of a condition: a skill's arguments, the index of the phase in the policy (-1: none), and either the
    current place or every place of a path at any time until `through_us` from now.
    """

    arguments: Sequence[int] = ()
    phase: int = -1
    path: SweptPath | None = None
    through_us: int = 0


class UnmetCondition(NamedTuple):
    """The text of a condition that does not hold; `truth` is False or None, `sure`: not doubtful."""

    text: str
    truth: bool | None
    sure: bool


class TruthInterval(NamedTuple):
    """A closed time interval in which a condition had one truth."""

    truth: bool | None
    doubtful: bool
    from_us: int
    to_us: int


class TruthHistory:
    """The truth of a temporal monitor's condition over time. Between two observations the first truth holds; it is
    unknown if they are more than `MAX_GAP` apart.
    """

    def __init__(self, monitor: Monitor) -> None:
        self.monitor = monitor
        self.doubtful = False
        """Whether its last result depends on a doubtful truth."""
        self._stretches: list[TruthInterval] = []
        self._last: tuple[bool | None, bool, int] | None = None

    def observed(self, truth: bool | None, doubtful: bool, at_us: int) -> bool | None:
        """Return the monitor's truth when its condition has this truth."""
        before, doubted, since_us = self._last or (None, False, -(1 << 62))
        known = self._last is not None and at_us - since_us <= MAX_GAP
        self._add(TruthInterval(before if known else None, known and doubted, since_us + 1, at_us - 1))
        self._add(TruthInterval(truth, doubtful, at_us, at_us))
        self._last = truth, doubtful, at_us
        kind, from_us = self.monitor.kind, at_us - self.monitor.window_us
        if kind in (MonitorKind.RISING, MonitorKind.FALLING):
            self.doubtful = doubtful or doubted
            was, now = frozenset({before}), frozenset({truth})
            return everywhere(both(_not(was), now) if kind == MonitorKind.RISING else both(was, _not(now)))
        self._stretches = [each for each in self._stretches if each.to_us >= from_us]
        self.doubtful = any(each.doubtful for each in self._stretches)
        seen = frozenset(each.truth for each in self._stretches)
        if kind == MonitorKind.FOR_LAST:
            return everywhere(seen)
        return True if True in seen else None if None in seen else False

    def _add(self, stretch: TruthInterval) -> None:
        if stretch.from_us <= stretch.to_us:
            if self._stretches and self._stretches[-1][:2] == stretch[:2]:
                stretch = stretch._replace(from_us=self._stretches.pop().from_us)
            self._stretches.append(stretch)


class HeardState:
    """The received state of the vehicle, and the truths of the policy's temporal monitors."""

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self._values: list[int | None] = [None] * policy.slots
        self._measured_us: list[int | None] = [None] * policy.slots
        self._new: set[int] = set()  # slots whose value was not evaluated yet
        self._histories = [TruthHistory(monitor) for monitor in policy.monitors]
        self._says: list[bool | None] = [None] * len(policy.monitors)

    def hear(self, heard: HeardReadings) -> None:
        """Store the readings of a frame, except those older than the stored ones."""
        for slot, value in heard.values:
            before_us = self._measured_us[slot]
            if before_us is None or before_us <= heard.measured_us:
                self._measured_us[slot], self._values[slot] = heard.measured_us, value
                self._new.add(slot)

    def hides(self, heard: HeardReadings) -> bool:
        """Return whether this replaces a value that was not evaluated yet."""
        return any(slot in self._new for slot, _ in heard.values)

    def look(self, now: Now) -> "JudgedState":
        """Return the known state at a moment."""
        self._new.clear()
        ages = [0 if each is None else max(0, now.monotonic_us - each) for each in self._measured_us]
        doubts = [history.doubtful for history in self._histories]
        return JudgedState(self._policy, self._values, ages, self._says, now, doubts)

    def observe(self, now: Now) -> None:
        """Update the temporal monitors, once a turn; a monitor may use earlier ones."""
        self._new.clear()
        says: list[bool | None] = []
        for history in self._histories:
            situation = self.look(now)
            situation.monitors = says
            truth = everywhere(situation.truths(history.monitor.when.code, ConditionQuery()))
            says.append(history.observed(truth, situation.doubtful, now.monotonic_us))
        self._says = says


class JudgedState:
    """The known state at one moment, and the truths of conditions in it."""

    def __init__(
        self,
        policy: Policy,
        values: Sequence[int | None],
        ages: Sequence[int],
        monitors: Sequence[bool | None],
        now: Now,
        doubts: Sequence[bool] = (),
    ) -> None:
        self.monitors, self._doubts = monitors, doubts
        self.doubtful = False
        """Whether a truth was doubtful since this was last reset."""
        self._policy, self._ages, self._now = policy, ages, now
        self._slots: list[int | None] = [None] * policy.slots
        for signal in policy.signals:
            most = MAX_COORDINATE if signal.kind == POSITION else MAX_VALUE
            for slot in signal.slots:
                value = values[slot]
                if value is not None and ages[slot] <= signal.stale_us and abs(value) <= most:
                    self._slots[slot] = value
        vehicle = policy.vehicle
        x, y = self._known(vehicle.position), self._known(vehicle.position + 1) if vehicle.position >= 0 else None
        height = self._known(vehicle.height)
        self._place = None if x is None or y is None else (x, y)
        self._height = None if height is None else (height, height)
        self._here = SweptPath(self._place, self._place or (0, 0), self._height)

    def _known(self, slot: int) -> int | None:
        return None if slot < 0 else self._slots[slot]

    # -------------------------------------------------------- conditions

    def truths(self, code: Sequence[int], query: "ConditionQuery") -> Truths:
        """Return the possible truths of a condition."""
        numbers: list[HeightTerm] = []
        found: list[Truths] = []
        for op, a, b in zip(code[::3], code[1::3], code[2::3], strict=True):
            if op in (Op.CONST, Op.SIGNAL, Op.ARGUMENT):
                numbers.append(self._number(op, a, query))
            elif op == Op.SCALE:
                number = numbers.pop()
                numbers.append(None if number is None else (number[0] * a, number[1] * a))
            elif op in (Op.ADD, Op.SUB):
                right, left = numbers.pop(), numbers.pop()
                numbers.append(_sum(left, right, 1 if op == Op.ADD else -1))
            elif op in _RELATIONS:
                right, left = numbers.pop(), numbers.pop()
                found.append(_compared(op, _sum(left, right, -1), query.path and query.path.heights))
            elif op == Op.NOT:
                found.append(_not(found.pop()))
            elif op == Op.AND:
                found.append(both(found.pop(), found.pop()))
            elif op == Op.OR:
                found.append(_not(both(_not(found.pop()), _not(found.pop()))))
            else:
                found.append(self._atom(op, a, b, query))
        return found.pop()

    def _number(self, op: int, a: int, query: "ConditionQuery") -> HeightTerm:
        if op == Op.CONST:
            return 0, a
        if op == Op.ARGUMENT:
            return 0, query.arguments[a]
        if query.path is not None and a == self._policy.vehicle.height:
            return None if query.path.heights is None else (1, 0)
        value = self._slots[a]
        return None if value is None else (0, value)

    def _atom(self, op: int, a: int, b: int, query: "ConditionQuery") -> Truths:
        policy, arguments, through_us = self._policy, query.arguments, query.through_us
        match op:
            case Op.POSITION_IN_ARGUMENT if not 0 <= arguments[a] < len(policy.tables[b]):
                return _UNKNOWN  # an argument out of range names no zone
            case Op.POSITION_IN | Op.POSITION_IN_ARGUMENT:
                zone = a if op == Op.POSITION_IN else policy.tables[b][arguments[a]]
                return self.inside(policy.zones[zone], query.path or self._here, through_us)
            case Op.ARGUMENT_POINT_IN:
                point = arguments[a], arguments[a + 1]
                return self.inside(policy.zones[b], SweptPath(point, point, None), through_us, flat=True)
            case Op.ARGUMENT_IN:
                return frozenset({arguments[a] in policy.sets[b]})
            case Op.PHASE_IN:
                return frozenset({query.phase in policy.sets[b]})
            case Op.MONITOR:
                self.doubtful = self.doubtful or (bool(self._doubts) and self._doubts[a])
                return frozenset({self.monitors[a]})
            case Op.TIME_IN:
                return frozenset({_one(shown(daily(a, b), DAY, policy.vehicle, *self._clock()))})
            case Op.WEEK_IN:
                return frozenset({_one(shown(policy.sets[a], WEEK, policy.vehicle, *self._clock()))})
        value = self._slots[a]  # KNOWN, SIGNAL_IN
        return _UNKNOWN if value is None else frozenset({op == Op.KNOWN or value in policy.sets[b]})

    def _clock(self, later_us: int = 0) -> tuple[int, int]:
        """Return the earliest and latest possible UTC."""
        at_us, error_us = self._now.utc_us + later_us, max(0, self._now.utc_error_us)
        return at_us - error_us, at_us + error_us

    # -------------------------------------------------------- places

    def inside(self, zone: Zone, path: SweptPath, through_us: int, *, flat: bool = False) -> Truths:
        """Return whether the places of a path are inside a zone, at any time until `through_us` from now."""
        level = None if path.start is None else level_mm(zone, *path.start)
        wide, narrow = (_covers(zone, path, level, by, flat=flat) for by in (_SLACK_MM, -_SLACK_MM))
        self.doubtful = self.doubtful or wide != narrow
        if not is_timed(zone) or wide == _FALSE:
            return wide
        vehicle, (first_us, last_us) = self._policy.vehicle, self._clock()
        now = _one(exists(zone, vehicle, first_us, last_us))
        later = exists(zone, vehicle, first_us, last_us + through_us) if through_us else frozenset({now})
        self.doubtful = self.doubtful or len(later) > 1
        return both(wide, later | {now})

    def in_airspace(self, path: SweptPath, through_us: int) -> bool | None:
        """Return whether all of a path is in the airspace."""
        airspace, zones = self._policy.airspace, self._policy.zones
        if airspace is None:
            return True
        found = [self.inside(zones[each], path, through_us) for each in airspace.inside]
        found += [_not(self.inside(zones[each], path, through_us)) for each in airspace.outside]
        return everywhere(frozenset().union(*found))

    def ahead(self) -> tuple[SweptPath, int]:
        """Return all places that the vehicle may reach before it can stop, and the longest time to stop, in us."""
        vehicle, place = self._policy.vehicle, self._place
        error = vehicle.position_error
        nowhere = SweptPath(None, (0, 0), None, error), 0
        if place is None:
            return nowhere
        if not vehicle.braking:
            return SweptPath(place, place, self._height, error), 0
        north, east, down = (self._known(slot) for slot in (vehicle.north, vehicle.east, vehicle.down))
        if north is None or east is None or down is None:
            return nowhere
        speed = sqrt(north * north + east * east + down * down)
        if speed > MAX_SPEED:
            return nowhere
        slots = [vehicle.position, vehicle.position + 1, vehicle.north, vehicle.east, vehicle.down]
        slots += [] if self._height is None else [vehicle.height]
        measured_s = max(self._ages[slot] for slot in slots) / 1e6
        reaction_s, brakes_s = vehicle.reaction_us / 1e6, speed / vehicle.braking
        goes_s = measured_s + reaction_s + brakes_s / 2
        end = place[0] + east * goes_s, place[1] + north * goes_s
        heights = None
        if self._height is not None:
            to = self._height[0] - down * goes_s
            heights = min(self._height[0], to), max(self._height[0], to)
        return SweptPath(place, end, heights, error), round((reaction_s + brakes_s) * 1e6)

    # -------------------------------------------------------- conditions of a running step

    def broken(self, step: "WatchedStep") -> Iterator[UnmetCondition]:
        """Yield the conditions of a step that do not hold."""
        contract = step.invocation.contract
        for clause in contract.assume:
            yield from self._broken(clause.text, self.truths(clause.code, step.query))
        for rule in step.degrades:
            yield from self._broken(rule.text, _not(self._matches(rule, step)))
        path, lasts_us = self.ahead()
        for clause in contract.maintain:
            yield from self._broken(clause.text, self._maintained(clause, step, path, lasts_us))
        if self._policy.airspace is not None:
            yield from self._broken(self._policy.airspace.text, frozenset({self.in_airspace(path, lasts_us)}))
        if contract.motion.kind not in (MotionKind.HOME, MotionKind.LAND):
            yield from self._broken(WAY_HOME, frozenset({self._way_home(step, path)}))

    def _broken(self, text: str, truths: Truths) -> Iterator[UnmetCondition]:
        truth, sure, self.doubtful = everywhere(truths), not self.doubtful, False
        if truth is not True:
            yield UnmetCondition(text, truth, sure)

    def _matches(self, rule: Rule, step: "WatchedStep") -> Truths:
        if rule.when is None:
            return _TRUE
        return self.truths(rule.when.code, step.query)

    def _maintained(self, clause: Clause, step: "WatchedStep", path: SweptPath, lasts_us: int) -> Truths:
        """Return the truths over the whole path; a condition that is False at the current place is False."""
        over = self.truths(clause.code, step.query._replace(path=path, through_us=lasts_us))
        if everywhere(over) is None:
            over |= self.truths(clause.code, step.query)
        return over

    def _way_home(self, step: "WatchedStep", path: SweptPath) -> bool | None:
        """Return whether the charge covers the reserve and the way home from the farthest place of a path."""
        vehicle, battery = self._policy.vehicle, self._known(self._policy.vehicle.battery)
        if battery is None or path.start is None or (vehicle.speeds is not None and path.heights is None):
            return None
        away_mm = max(hypot(*path.start), hypot(*path.end))
        drain = next((self._slots[e.slot] for e in self._policy.signals if (e.name, e.kind) == (DRAIN, NUMBER)), None)
        if vehicle.speeds is None:
            home_s, full_s = away_mm / vehicle.speed, vehicle.endurance_us / 1e6
        else:
            assert path.heights is not None
            home_s = step.home_s(vehicle.speeds, away_mm, path.heights)
            full_s = vehicle.speeds.flight_us / 1e6
        taken = max(FULL / full_s, min(max(drain or 0, 0), _MOST_DRAIN) / 60) * home_s
        left = battery - vehicle.reserve - taken
        self.doubtful = self.doubtful or abs(left) <= _SLACK_CHARGE
        return left >= 0

    # -------------------------------------------------------- links

    def first_link(self, step: "WatchedStep") -> int | None:
        """Return the first link of a step's fallback: -1 for the target of a degrade rule; None: no link can fly."""
        for rule in step.degrades:
            target = rule.target if everywhere(self._matches(rule, step)) is True else None
            if target is not None and self._may_fly(target, step.query.phase):
                return -1
        chain = step.invocation.contract.fallback
        return next((number for number, link in enumerate(chain) if self._may_fly(link, step.query.phase)), None)

    def _may_fly(self, link: Link, phase: int) -> bool:
        """Return whether a link can fly: its requirements hold and it stays in the airspace. From outside, a return
        home is always allowed.
        """
        contract, vehicle = self._policy.contracts[link.skill], self._policy.vehicle
        for clause in contract.require:
            if everywhere(self.truths(clause.code, ConditionQuery(link.arguments, phase))) is not True:
                return False
        kind, motion = contract.motion.kind, contract.motion
        if kind in (MotionKind.HOLD, MotionKind.LAND):
            return True
        here = self._here._replace(error=vehicle.position_error)
        if kind == MotionKind.HOME:
            if self.in_airspace(here, 0) is False:
                return True
            paths = self._home(here)
        else:
            altitude = None if motion.altitude < 0 else link.arguments[motion.altitude]
            to = here.end
            if kind == MotionKind.FLY:
                cell = next(each.cell for each in contract.parameters if each.kind == PLACE)
                to = link.arguments[cell], link.arguments[cell + 1]
            paths = [here._replace(end=to, heights=_reaching(here.heights, altitude))]
        longest_us = link.limit_us or contract.duration_us or vehicle.endurance_us
        return everywhere(frozenset(self.in_airspace(path, longest_us) for path in paths)) is True

    def _home(self, here: SweptPath) -> list[SweptPath]:
        """Return the paths of a return: up, across to home, and down."""
        vehicle, heights = self._policy.vehicle, here.heights
        returns = vehicle.return_altitude
        up = _reaching(heights, returns if heights is not None and returns > heights[0] else None)
        down = _reaching(up, 0 if heights is not None and heights[0] > 0 else None)
        near_mm = max(_NEAR_MM, -(-returns // 3)) + vehicle.home_within + vehicle.position_error
        across = up
        if up is not None and returns and self._place is not None and hypot(*self._place) > near_mm:
            across = max(up[0], returns - _SHORT_MM), up[1]
        home = SweptPath(here.start and (0, 0), (0, 0), down, here.error)
        return [here._replace(heights=up), here._replace(end=(0, 0), heights=across), home]


class WatchedStep:
    """A step of a mission, with its contract and the rules that degrade it."""

    def __init__(self, policy: Policy, mission: Mission, step: int) -> None:
        self.invocation: Invocation = mission.invocations[step]
        of, name = self.invocation, mission.phases[self.invocation.phase]
        self.query = ConditionQuery(of.arguments, policy.phases.index(name) if name in policy.phases else -1)
        self.degrades = [
            rule
            for rule in policy.rules
            if rule.kind == RuleKind.DEGRADE
            and of.skill in (rule.skills or (of.skill,))
            and of.role in (rule.roles or (of.role,))
            and of.source in (rule.sources or (of.source,))
            and (rule.target is None or rule.target.skill != of.skill)
        ]
        asked = [each.plan.speed for each in mission.invocations[: step + 1] if each.plan.speed]
        self._slowest = min(asked, default=0)
        self._vehicle = policy.vehicle

    def home_s(self, speeds: Speeds, away_mm: float, heights: tuple[float, float]) -> float:
        """Return the time of the way home and the landing, by the table of docs/flying/speeds.md."""
        vehicle, (low, high) = self._vehicle, heights
        asked = min(self._slowest or speeds.homeward, speeds.homeward)
        speed = max(1, min(asked, speeds.air - speeds.wind))
        top = max(high, vehicle.return_altitude)
        slow = min(max(top, 0), speeds.landing_below)
        return (
            _BEGINS_S + _leg_s(vehicle.return_altitude - low, speeds.climb, speeds.acceleration)
            + _leg_s(away_mm + vehicle.home_within, speed, speeds.acceleration) + _SETTLES_S + _OVER_HOME_S
            + _leg_s(top - slow, speeds.descent, speeds.acceleration) + slow / speeds.landing + _LANDED_S
        )  # fmt: skip


class RunningStep(WatchedStep):
    """A step that flies from `since_us` until `until_us` (None: it did not end), in us since the start.

    `sure`: the first time at which it should have been aborted, and the text of the condition; `doubtful`: the same if
    a doubtful truth counts. Nothing is judged in the `silences`: they do not count for the grace or the duration.
    """

    def __init__(
        self, policy: Policy, mission: Mission, step: int, times: tuple[int, int | None], silences: Sequence[Span]
    ) -> None:
        super().__init__(policy, mission, step)
        self.since_us, self.until_us = times
        self.sure: tuple[int, str] | None = None
        self.doubtful: tuple[int, str] | None = None
        self.looked_us = -1
        self._silences = silences
        self._unknown: dict[str, int] = {}  # since when a condition is unknown, without silences

    def is_silent(self, at_us: int) -> bool:
        """Return whether a time is in a silence."""
        return any(start <= at_us < end for start, end in self._silences)

    def look(self, situation: "JudgedState", at_us: int) -> None:
        """Judge the known state at a time."""
        if self.sure is not None:
            return
        self.looked_us = at_us
        contract = self.invocation.contract
        away_us = sum(max(0, min(at_us, end) - max(self.since_us, start)) for start, end in self._silences)
        if 0 < contract.duration_us < at_us - self.since_us - away_us:
            excluded = f", excluding {away_us // 1_000} ms without a link" if away_us else ""
            self.sure = self.doubtful = at_us, DURATION + excluded
            return
        unknown: dict[str, int] = {}
        for text, truth, sure in situation.broken(self):
            unknown[text] = self._unknown.get(text, at_us - away_us)
            over = truth is False or at_us - away_us - unknown[text] > contract.grace_us
            if (over or not sure) and self.doubtful is None:
                self.doubtful = at_us, text
            if over and sure:
                grace = f": unknown for longer than its grace of {contract.grace_us // 1_000} ms"
                self.sure = at_us, text if truth is False else text + grace
                return
        self._unknown = unknown


def supervise(policy: Policy, steps: Sequence[RunningStep], turns: Sequence[Turn], clock: Callable[[int], Now]) -> None:
    """Judge the steps in their order, at each turn of the loop and at each of several frames in a turn. `clock`
    converts simulation time to a moment.
    """
    memory, left = HeardState(policy), deque(steps)
    for turn in turns:
        at_us = turn.at_us
        while left and (until_us := left[0].until_us) is not None and until_us < at_us:
            left.popleft()
        step = left[0] if left and left[0].since_us < at_us and not left[0].is_silent(at_us) else None
        now = clock(at_us)
        for heard in turn.heard:
            if step is not None and memory.hides(heard):
                step.look(memory.look(now), at_us)
            memory.hear(heard)
        memory.observe(now)
        if step is not None:
            step.look(memory.look(now), at_us)


def _leg_s(length_mm: float, speed_mm_s: float, gains_mm_s2: float) -> float:
    """Return the time of a leg from rest to rest."""
    if length_mm <= 0:
        return 0
    if length_mm * gains_mm_s2 < speed_mm_s**2:
        return 2 * sqrt(length_mm / gains_mm_s2)
    return length_mm / speed_mm_s + speed_mm_s / gains_mm_s2


def _one(answers: Truths) -> bool | None:
    """Return the only truth, or None if there are several."""
    return next(iter(answers)) if len(answers) == 1 else None


def _reaching(heights: tuple[float, float] | None, to: int | None) -> tuple[float, float] | None:
    return heights if heights is None or to is None else (min(heights[0], to), max(heights[1], to))


def _sum(left: HeightTerm, right: HeightTerm, sign: int) -> HeightTerm:
    return None if left is None or right is None else (left[0] + sign * right[0], left[1] + sign * right[1])


def _compared(op: int, difference: HeightTerm, heights: tuple[float, float] | None) -> Truths:
    """Return the truths of comparing a difference with 0, over an interval of heights."""
    if difference is None:
        return _UNKNOWN
    times, more = difference
    ends = [times * height + more for height in heights or (0, 0)]
    ends += [0] if min(ends) < 0 < max(ends) else []
    return frozenset(_RELATIONS[op](each, 0) for each in ends)


def _covers(zone: Zone, path: SweptPath, level: float | None, by: int, *, flat: bool) -> Truths:
    """Return whether the places of a path, widened by `by`, are inside a zone while the zone exists. The start of the
    path is `level` mm inside horizontally.
    """
    if flat or (zone.floor, zone.ceiling) == (LOWEST, HIGHEST):
        upright = _TRUE
    elif path.heights is None:
        upright = _UNKNOWN
    else:
        low, high = path.heights[0] - by, path.heights[1] + by
        low, high = (low, high) if low <= high else ((low + high) / 2,) * 2
        whole, none = zone.floor < low and high < zone.ceiling, high <= zone.floor or low >= zone.ceiling
        upright = _TRUE if whole else _FALSE if none else _TRUE | _FALSE
    if upright == _FALSE or level is None or path.start is None:
        return both(upright, _UNKNOWN)
    return both(upright, _level(zone, path.start, path.end, level, path.error + by, by))


def _level(zone: Zone, start: GroundPoint, end: GroundPoint, inside: float, error: int, by: int) -> Truths:
    """Return the same horizontally. Edges out of reach from the start are skipped."""
    away = error * sqrt(2)
    if abs(inside) > hypot(end[0] - start[0], end[1] - start[1]) + away:
        return _TRUE if inside > 0 else _FALSE
    if zone.shape != CIRCLE:
        met = any(_touches(start, end, error, edge) for edge in edges(zone))
    else:
        x, y, square = zone.data
        reach = max(error, 0)
        corners = [
            (cx + dx - x, cy + dy - y) for cx, cy in (start, end) for dx in (-reach, reach) for dy in (-reach, reach)
        ]
        # the position error is a box: whether its corners count is doubtful
        gap = apart_mm(x, y, *start, *end) - sqrt(square) - (away if by > 0 else error)
        met = gap <= 0 and max(hypot(*corner) for corner in corners) >= sqrt(square)
    return _TRUE | _FALSE if met else _TRUE if inside > 0 else _FALSE


def _touches(start: GroundPoint, end: GroundPoint, error: int, edge: Edge) -> bool:
    """Return whether an edge intersects a line widened by a box (separating axis test)."""
    ax, ay, bx, by = edge
    across = ((1, 0), (0, 1), (end[1] - start[1], start[0] - end[0]), (by - ay, ax - bx))
    for nx, ny in across:
        way = [nx * x + ny * y for x, y in (start, end)]
        line = [nx * ax + ny * ay, nx * bx + ny * by]
        reach = error * (abs(nx) + abs(ny))
        if max(way) + reach < min(line) or max(line) < min(way) - reach:
            return False
    return True
