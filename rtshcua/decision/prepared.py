"""A policy and an invocation as they are held between `prepare` and the decisions on them, and the compiler that makes
them from the flat form.
"""

from collections import defaultdict
from dataclasses import dataclass
from typing import NamedTuple

import msgspec

from rtshcua.decision.contracts import Energy, first_cell
from rtshcua.decision.evaluate import Condition, Environment, Tables, always, build, within
from rtshcua.decision.tree import Node, parse, scope_of
from rtshcua.decision.values import AND, NOT, TRUE, Sets, Truth, Value, point
from rtshcua.decision.volume import Planner, flown_at
from rtshcua.decision.zones import Place, PreparedZone, WellKnown
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import PLACE, Contract, Link, MotionKind, Parameter
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Airspace, Monitor, Policy, Rule, RuleKind
from rtshcua.model.flat.situation import Now, State

#: a clause, and the function that evaluates it
Guards = tuple[tuple[Clause, Condition], ...]


class Choice(msgspec.Struct, frozen=True):
    """A link and its index in the chain, or DEGRADE (`links`)."""

    index: int
    link: Link


class PreparedLink(NamedTuple):
    """A link, its arguments as values, its skill's `require`, its kind of motion and what it may fly through."""

    link: Link
    arguments: tuple[Value, ...]
    require: Guards
    motion: int
    planner: Planner


ANY = -1  # no skill and no role has this index


class PreparedRule(NamedTuple):
    """A rule, its number in the policy, and its condition."""

    rule: Rule
    number: int
    condition: Condition


class PreparedDegrade(NamedTuple):
    """A degrade rule, and the link that it flies."""

    rule: Rule
    condition: Condition
    target: PreparedLink


class Candidates(NamedTuple):
    """The rules for one skill, role and source, in the order of the policy. Their conditions remain to be evaluated.

    A rule that degrades to the skill itself is not among them: it would refuse what it asks for.
    """

    forbids: tuple[PreparedRule, ...]
    permits: tuple[PreparedRule, ...]
    confirms: tuple[PreparedRule, ...]
    degrades: tuple[PreparedDegrade, ...]


class RuleIndex:
    """The rules that may speak of an invocation, found by skill and role without looking at any other.

    Rules for any skill or role are kept once, and merged in for a key that is asked for. A rule lists at most four
    sources, so these are compared when merging. What was merged is remembered: asking again gives the same answer, and
    a loaded mission asks for few keys.
    """

    __slots__ = ("_buckets", "_compiler", "_known", "_rules")

    def __init__(self, rules: tuple[Rule, ...], compiler: "Compiler") -> None:
        self._rules, self._compiler = rules, compiler
        self._known: dict[tuple[int, int, int], Candidates] = {}
        self._buckets: dict[tuple[int, int], list[int]] = {}
        for number, rule in enumerate(rules):
            for skill in rule.skills or (ANY,):
                for role in rule.roles or (ANY,):
                    self._buckets.setdefault((skill, role), []).append(number)

    def candidates(self, skill: int, role: int, source: int) -> Candidates:
        """The rules that name this skill, role and source, or any."""
        key = (skill, role, source)
        found = self._known.get(key)
        if found is None:
            found = self._known[key] = self._merged(skill, role, source)
        return found

    def _merged(self, skill: int, role: int, source: int) -> Candidates:
        keys = ((skill, role), (skill, ANY), (ANY, role), (ANY, ANY))
        numbers = sorted(number for key in keys for number in self._buckets.get(key, ()))
        kinds = defaultdict[int, list[PreparedRule]](list)
        for number in numbers:
            rule = self._rules[number]
            if source in (rule.sources or (source,)):
                kinds[rule.kind].append(PreparedRule(rule, number, self._compiler.condition(rule, number)))
        degrades = tuple(
            PreparedDegrade(rule, condition, self._compiler.link(rule.target))
            for rule, _, condition in kinds[RuleKind.DEGRADE]
            if rule.target is not None and rule.target.skill != skill
        )
        forbids, permits, confirms = kinds[RuleKind.FORBID], kinds[RuleKind.PERMIT], kinds[RuleKind.CONFIRM]
        return Candidates(tuple(forbids), tuple(permits), tuple(confirms), degrades)


class Compiler:
    """Compiles what was checked: a clause is read again here, and cannot fail any more."""

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self._scope = scope_of(policy)
        self._conditions: dict[int, Condition] = {}
        self._requires: dict[int, Guards] = {}
        self.tables = Tables(
            zones=tuple(
                PreparedZone(number, zone, policy.vehicle.utc_offset_us) for number, zone in enumerate(policy.zones)
            ),
            tables=policy.tables,
            sets=tuple(frozenset(members) for members in policy.sets),
            known=_well_known(policy),
            utc_offset_us=policy.vehicle.utc_offset_us,
        )

    def node(self, clause: Clause, *contracts: Contract) -> Node:
        """The tree of a clause that may name the arguments of some contracts."""
        node = parse(clause.code, self._scope.about(*contracts))
        assert not isinstance(node, str), node
        return node

    def monitored(self, monitor: Monitor, number: int) -> Condition:
        """The condition that the temporal monitor of this number looks at."""
        node = parse(monitor.when.code, self._scope.inside_monitor(number))
        assert not isinstance(node, str), node
        return build(node, self.tables)

    def guards(self, clauses: tuple[Clause, ...], contract: Contract) -> Guards:
        """The clauses of a contract."""
        return tuple((clause, build(self.node(clause, contract), self.tables)) for clause in clauses)

    def when(self, rule: Rule) -> Node | None:
        """The tree of a rule's condition, if it has one."""
        if rule.when is None:
            return None
        return self.node(rule.when, *(self._policy.contracts[skill] for skill in rule.skills))

    def condition(self, rule: Rule, number: int) -> Condition:
        """The condition of a rule, compiled when it is first asked for."""
        found = self._conditions.get(number)
        if found is None:
            node = self.when(rule)
            found = self._conditions[number] = always if node is None else build(node, self.tables)
        return found

    def link(self, link: Link) -> PreparedLink:
        """A link with its skill's `require`."""
        contract, policy = self._policy.contracts[link.skill], self._policy
        require = self._requires.get(link.skill)
        if require is None:
            require = self._requires[link.skill] = self.guards(contract.require, contract)
        motion = contract.motion
        path: tuple[int, ...] = ()
        if motion.kind == MotionKind.FLY:
            cell = first_cell(contract, PLACE)
            path = link.arguments[cell : cell + 2]
        altitude = flown_at(motion, 0 if motion.altitude == -1 else link.arguments[motion.altitude], policy.vehicle)
        planner = Planner(motion.kind, path, altitude, policy.vehicle.position_error)
        return PreparedLink(link, tuple(map(point, link.arguments)), require, motion.kind, planner)

    def links(self, links: tuple[Link, ...]) -> tuple[PreparedLink, ...]:
        """The links of a chain."""
        return tuple(map(self.link, links))


def _well_known(policy: Policy) -> WellKnown:
    """A slot that no signal owns is the one after the last, which is always missing."""
    vehicle, absent = policy.vehicle, policy.slots
    x, y = (absent, absent) if vehicle.position == -1 else (vehicle.position, vehicle.position + 1)
    others = (vehicle.height, vehicle.battery, vehicle.north, vehicle.east, vehicle.down)
    return WellKnown(x, y, *(absent if slot == -1 else slot for slot in others))


class PreparedAirspace(NamedTuple):
    """The airspace: inside every zone of the one list, outside every zone of the other."""

    airspace: Airspace
    inside: tuple[PreparedZone, ...]
    outside: tuple[PreparedZone, ...]

    def keeps(self, place: Place, at: Environment, through: int) -> Truth:
        """Whether a place is in the airspace at every moment from now to `through` us from now."""
        truth = TRUE
        for zone in self.inside:
            truth = AND[truth][place.inside(zone) if zone.times is None else within(place, zone, at, through)]
        for zone in self.outside:
            truth = AND[truth][NOT[place.inside(zone) if zone.times is None else within(place, zone, at, through)]]
        return truth


class Limit(NamedTuple):
    """What a state slot may hold: no older than `stale_us`, no further from 0 than `most`."""

    stale_us: int
    most: int


class PreparedMonitor(NamedTuple):
    """A temporal monitor: its kind, how far back it looks, and the condition that it looks at."""

    kind: int
    window_us: int
    condition: Condition


class Seen(NamedTuple):
    """A single situation, as sets of values, and as conditions read it, by arguments and phase; and what was found in
    it: which links may fly, by their phase, and which would be chosen for an invocation, after the link of which index.
    """

    state: State
    now: Now
    sets: Sets
    environments: list[Environment]
    links: list[tuple[PreparedLink, int, Truth]]
    choices: list[tuple["PreparedInvocation", int, Choice | None]]


@dataclass(slots=True, eq=False)
class PreparedPolicy:
    """A policy that was found well-formed, compiled. `limits` has one entry a slot; `monitors` are in order.

    `seen` is the last single situation that was asked about, remembered to be quick: no answer depends on it, and
    nothing else is ever changed.
    """

    policy: Policy
    compiler: Compiler
    tables: Tables
    limits: tuple[Limit, ...]
    rules: RuleIndex
    airspace: PreparedAirspace | None
    contingency: tuple[PreparedLink, ...]
    still: Planner  # plans to stay: the present place with its error
    monitors: tuple[PreparedMonitor, ...]
    seen: Seen | None = None


@dataclass(frozen=True, slots=True, eq=False)
class PreparedInvocation:
    """An invocation that was found well-formed, compiled under `policy`.

    `misfit` is the first parameter whose argument is out of range; `reads` are the slots that a decision may read, each
    with the age in us at which it is stale. `phase` is the number of its mission phase among the policy's phase names,
    -1 if it is none of them; `rests_us` how long the observation that a decision rests on stands for the moments after;
    `lasts_us` the longest that it may fly (`lasting.longest`).
    """

    invocation: Invocation
    policy: PreparedPolicy
    arguments: tuple[Value, ...]
    misfit: Parameter | None
    require: Guards
    assume: Guards
    maintain: Guards
    chain: tuple[PreparedLink, ...]
    candidates: Candidates
    planner: Planner
    energy: Energy
    reads: tuple[tuple[int, int], ...]
    phase: int
    rests_us: int
    lasts_us: int
