"""Checks a policy and a mission once, at load, and compiles them for many decisions.

A bundle may be damaged or come from the wrong people, so this module checks everything that deciding relies on. It
refuses a malformed bundle with a value that names the problem. `wire` verifies signatures, digests and bindings
before.
"""

from collections import defaultdict
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import msgspec

from rtshcua.decision.checks import mission as mission_checks
from rtshcua.decision.checks.policy import problems
from rtshcua.decision.contracts import Energy, first_cell, longest, misfit
from rtshcua.decision.evaluate import NO_PHASE, Condition, Environment, Tables, always, build, within
from rtshcua.decision.flying import slower
from rtshcua.decision.times import local_time
from rtshcua.decision.tree import Node, monitored, parse, scope_of, slots_read, where
from rtshcua.decision.values import AND, NOT, TRUE, Sets, Truth, Value, point
from rtshcua.decision.volume import Planner, flown_at, near_home
from rtshcua.decision.zones import PlaceSet, PreparedZone, WellKnown
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import PLACE, Contract, Link, MotionKind, Parameter
from rtshcua.model.flat.limits import MAX_COMPARED, MAX_DURATION, MAX_GAP, MAX_VALUE
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Airspace, Monitor, Policy, Rule, RuleKind
from rtshcua.model.flat.signal import DRAIN, NUMBER, POSITION
from rtshcua.model.flat.situation import Now, State
from rtshcua.model.flat.zone import MAX_COORDINATE
from rtshcua.model.step_number import step_words

#: a clause and its compiled function
Guards = tuple[tuple[Clause, Condition], ...]


class LinkChoice(msgspec.Struct, frozen=True):
    """A link and its index in the chain, or DEGRADE (`links`)."""

    index: int
    link: Link


class PreparedLink(NamedTuple):
    """A link with its argument values, its skill's `require`, its kind of motion and its planned volume."""

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
    """A `degrade` rule and the link that it flies."""

    rule: Rule
    condition: Condition
    target: PreparedLink


class Candidates(NamedTuple):
    """The rules for one skill, role and source, in the order of the policy. Their conditions are not evaluated yet.

    A rule that degrades to this same skill is left out, because it would refuse its own target.
    """

    forbids: tuple[PreparedRule, ...]
    permits: tuple[PreparedRule, ...]
    confirms: tuple[PreparedRule, ...]
    degrades: tuple[PreparedDegrade, ...]


class RuleIndex:
    """The rules that may apply to an invocation, found by skill and role without a look at the others.

    Rules for any skill or role are stored once and merged when a key is first requested. A rule lists at most four
    sources, so these are compared while merging. The merged result is cached: it never changes, and a loaded
    mission uses few keys.
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
        """The rules that name this skill, role and source, or any of them."""
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
    """Compiles checked clauses. It parses them again, which cannot fail any more."""

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self._scope = scope_of(policy)
        self._conditions: dict[int, Condition] = {}
        self._whens: dict[int, tuple[Rule, Node | None]] = {}
        self._requires: dict[int, Guards] = {}
        self._guards: dict[tuple[Clause, ...], Guards | None] = {
            clauses: None for of in policy.contracts for clauses in (of.require, of.assume, of.maintain)
        }
        local = local_time(policy.vehicle)
        self.tables = Tables(
            zones=tuple(PreparedZone(number, zone, local) for number, zone in enumerate(policy.zones)),
            tables=policy.tables,
            sets=tuple(frozenset(members) for members in policy.sets),
            known=_well_known(policy),
            local=local,
        )

    def node(self, clause: Clause, *contracts: Contract) -> Node:
        """The tree of a clause that may name the arguments of some contracts."""
        node = parse(clause.code, self._scope.about(*contracts))
        assert not isinstance(node, str), node
        return node

    def monitor_node(self, monitor: Monitor, number: int) -> Node:
        """The tree of the condition that the temporal monitor of this number observes."""
        node = parse(monitor.when.code, self._scope.inside_monitor(number))
        assert not isinstance(node, str), node
        return node

    def monitored(self, monitor: Monitor, number: int) -> Condition:
        """The condition that the temporal monitor of this number observes."""
        return build(self.monitor_node(monitor, number), self.tables)

    def guards(self, clauses: tuple[Clause, ...], contract: Contract) -> Guards:
        """The clauses of a contract. The policy's own clauses are compiled once, because most steps have no others."""
        found = self._guards.get(clauses)
        if found is None:
            found = tuple((clause, build(self.node(clause, contract), self.tables)) for clause in clauses)
            if clauses in self._guards:
                self._guards[clauses] = found
        return found

    def when(self, rule: Rule) -> Node | None:
        """The tree of a rule's condition, if it has one, made on first use."""
        known = self._whens.get(id(rule))
        if known is None or known[0] is not rule:
            contracts = self._policy.contracts
            node = None if rule.when is None else self.node(rule.when, *(contracts[skill] for skill in rule.skills))
            known = self._whens[id(rule)] = rule, node
        return known[1]

    def condition(self, rule: Rule, number: int) -> Condition:
        """The condition of a rule, compiled on first use."""
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
        vehicle = policy.vehicle
        planner = Planner(motion.kind, path, altitude, vehicle.position_error, near_home(vehicle))
        return PreparedLink(link, tuple(map(point, link.arguments)), require, motion.kind, planner)


def _well_known(policy: Policy) -> WellKnown:
    """A slot without a signal is the one after the last, which is always missing."""
    vehicle, absent = policy.vehicle, policy.slots
    x, y = (absent, absent) if vehicle.position == -1 else (vehicle.position, vehicle.position + 1)
    others = (vehicle.height, vehicle.battery, vehicle.north, vehicle.east, vehicle.down)
    measured = next((each.slot for each in policy.signals if each.name == DRAIN and each.kind == NUMBER), absent)
    height, battery, north, east, down = (absent if slot == -1 else slot for slot in others)
    return WellKnown(x, y, height, battery, north, east, down, measured)


class PreparedAirspace(NamedTuple):
    """The airspace: inside every zone of the one list, outside every zone of the other."""

    airspace: Airspace
    inside: tuple[PreparedZone, ...]
    outside: tuple[PreparedZone, ...]

    def keeps(self, place: PlaceSet, at: Environment, through: int) -> Truth:
        """Whether a place stays in the airspace at every moment from now to `through` us from now."""
        truth = TRUE
        for zone in self.inside:
            truth = AND[truth][place.inside(zone) if zone.times is None else within(place, zone, at, through)]
        for zone in self.outside:
            truth = AND[truth][NOT[place.inside(zone) if zone.times is None else within(place, zone, at, through)]]
        return truth


class SlotLimit(NamedTuple):
    """The limits of a state slot: the greatest age is `stale_us`, the greatest magnitude `most`."""

    stale_us: int
    most: int


class PreparedMonitor(NamedTuple):
    """A temporal monitor: its kind, how far back it looks, and the condition that it observes."""

    kind: int
    window_us: int
    condition: Condition


class SeenSituation(NamedTuple):
    """A single situation as sets of values, and as conditions read it, by arguments and phase. It also caches results
    for the situation: which links may fly, by phase, and the chosen link for an invocation, by the index of the
    link before.
    """

    state: State
    now: Now
    sets: Sets
    environments: list[Environment]
    links: list[tuple[PreparedLink, int, Truth]]
    choices: list[tuple["PreparedInvocation", int, LinkChoice | None]]


@dataclass(slots=True, eq=False)
class PreparedPolicy:
    """A policy that was checked and compiled. `limits` has one entry for each slot; `bounds` is the same by column:
    the stale ages, the least and the greatest values. `monitors` are in order.

    `seen` caches the last single situation, as planners cache their last start and zones their last box. No answer
    depends on it, and nothing else in a prepared policy ever changes.
    """

    policy: Policy
    compiler: Compiler
    tables: Tables
    limits: tuple[SlotLimit, ...]
    bounds: tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...]]
    rules: RuleIndex
    airspace: PreparedAirspace | None
    contingency: tuple[PreparedLink, ...]
    still: Planner  # plans without motion: the present place with its error
    monitors: tuple[PreparedMonitor, ...]
    seen: SeenSituation | None = None


@dataclass(frozen=True, slots=True, eq=False)
class PreparedInvocation:
    """An invocation that was checked and compiled under `policy`.

    `misfit` is the first parameter whose argument is out of range. `reads` are the slots that a decision may read,
    each with the age in us at which it becomes stale. `phase` is the index of its mission phase among the policy's
    phase names, -1 if it is not among them. `rests_us` is how long the observation behind a decision stays valid;
    `lasts_us` is the longest flight of the invocation (`lasting.longest`).
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


def prepare(policy: Policy) -> PreparedPolicy | Refusal:
    """The compiled policy, or the reason why it is refused."""
    problem = next(problems(policy), None)
    if problem is not None:
        return Refusal("malformed", problem)
    compiler, limits = Compiler(policy), _limits(policy)
    stale, most = tuple(limit.stale_us for limit in limits), tuple(limit.most for limit in limits)
    return PreparedPolicy(
        policy=policy,
        compiler=compiler,
        tables=compiler.tables,
        limits=limits,
        bounds=(stale, tuple(-each for each in most), most),
        rules=RuleIndex(policy.rules, compiler),
        airspace=None if policy.airspace is None else _airspace(policy.airspace, compiler),
        contingency=tuple(map(compiler.link, policy.contingency)),
        still=Planner(MotionKind.HOLD, (), None, policy.vehicle.position_error),
        monitors=tuple(
            PreparedMonitor(monitor.kind, monitor.window_us, compiler.monitored(monitor, number))
            for number, monitor in enumerate(policy.monitors)
        ),
    )


def prepare_mission(mission: Mission, policy: PreparedPolicy) -> tuple[PreparedInvocation, ...] | Refusal:
    """The compiled invocations of a mission in order, or the reason why it is refused."""
    problem = next(mission_checks.mission(mission, policy.policy), None)
    if problem is not None:
        return Refusal("malformed", problem)
    refused = paths_fit(mission, policy)
    if refused is not None:
        return refused
    prepared: list[PreparedInvocation] = []
    slowest = 0
    for step, invocation in enumerate(mission.invocations):
        found = prepare_invocation(invocation, policy, mission.phases)
        if isinstance(found, Refusal):
            return Refusal("malformed", f"{step_words(step)}: {found.text}")
        prepared.append(at_slowest(found, slowest))
        slowest = slower(slowest, invocation.plan.speed)
    return tuple(prepared)


def paths_fit(mission: Mission, policy: PreparedPolicy) -> Refusal | None:
    """The refusal of a mission whose paths take longer to decide than a request may; None if they do not."""
    error = policy.policy.vehicle.position_error
    box, compared = (-error, -error, error, error), 0
    for step, invocation in enumerate(mission.invocations):
        for y0, y1 in pairwise(invocation.plan.path[1::2]):
            compared += sum(1 + zone.shape.compared(y0, y1, box) for zone in policy.tables.zones)
            if compared > MAX_COMPARED:
                text = f"the legs of its paths would be compared with more than {MAX_COMPARED:,} edges of zones"
                return Refusal("malformed", f"{step_words(step)}: {text}", "reduce the points of its paths or zones")
    return None


def at_slowest(prepared: PreparedInvocation, slowest: int) -> PreparedInvocation:
    """The invocation, for a mission whose earlier steps request a speed as slow as this, mm/s; 0 if none does."""
    plan, contract = prepared.invocation.plan, prepared.invocation.contract
    asked = slower(slowest, plan.speed)
    if asked == plan.speed:
        return prepared
    return replace(prepared, energy=Energy(contract, prepared.policy.policy.vehicle, asked))


def prepare_invocation(
    invocation: Invocation, policy: PreparedPolicy, phases: tuple[str, ...]
) -> PreparedInvocation | Refusal:
    """The compiled invocation of a mission with these phases, or the reason why it is refused. `decide` refuses
    arguments that are out of range.
    """
    problem = next(mission_checks.invocation(invocation, policy.policy, policy.tables.zones), None)
    if problem is not None:
        return Refusal("malformed", problem)
    compiler, contract, plan = policy.compiler, invocation.contract, invocation.plan
    candidates = policy.rules.candidates(invocation.skill, invocation.role, invocation.source)
    clauses = [*contract.require, *contract.assume, *contract.maintain]
    clauses += [rule.rule.when for rules in candidates for rule in rules if rule.rule.when is not None]
    return PreparedInvocation(
        invocation=invocation,
        policy=policy,
        arguments=tuple(map(point, invocation.arguments)),
        misfit=misfit(invocation.arguments, contract),
        require=compiler.guards(contract.require, contract),
        assume=compiler.guards(contract.assume, contract),
        maintain=compiler.guards(contract.maintain, contract),
        chain=tuple(map(compiler.link, contract.fallback)),
        candidates=candidates,
        planner=Planner(
            plan.kind,
            plan.path,
            flown_at(contract.motion, plan.altitude, policy.policy.vehicle),
            policy.policy.vehicle.position_error,
            near_home(policy.policy.vehicle),
            plan.heights,
        ),
        energy=Energy(contract, policy.policy.vehicle, plan.speed),
        reads=tuple((slot, policy.limits[slot].stale_us) for slot in _reads(clauses, policy.policy)),
        phase=_phase(invocation, policy.policy, phases),
        rests_us=MAX_GAP if monitored(clauses) else MAX_DURATION,
        lasts_us=longest(contract, policy.policy.vehicle),
    )


def _airspace(airspace: Airspace, compiler: Compiler) -> PreparedAirspace:
    zones = compiler.tables.zones
    return PreparedAirspace(
        airspace, tuple(zones[zone] for zone in airspace.inside), tuple(zones[zone] for zone in airspace.outside)
    )


def _limits(policy: Policy) -> tuple[SlotLimit, ...]:
    limits = [SlotLimit(0, 0)] * policy.slots
    for signal in policy.signals:
        if signal.kind == POSITION:
            limits[signal.slot] = limits[signal.slot + 1] = SlotLimit(signal.stale_us, MAX_COORDINATE)
        else:
            limits[signal.slot] = SlotLimit(signal.stale_us, MAX_VALUE)
    return tuple(limits)


def _reads(clauses: list[Clause], policy: Policy) -> tuple[int, ...]:
    """The slots that a decision on these clauses may read. Their ages limit how long the decision is valid."""
    vehicle = policy.vehicle
    battery = () if vehicle.battery == -1 else (vehicle.battery,)
    return tuple(sorted({*slots_read(clauses, vehicle, policy.monitors), *where(vehicle), *battery}))


def _phase(invocation: Invocation, policy: Policy, phases: tuple[str, ...]) -> int:
    """The index of the invocation's phase among the policy's names. A phase that no condition names has no effect."""
    name = phases[invocation.phase] if 0 <= invocation.phase < len(phases) else None
    return policy.phases.index(name) if name in policy.phases else NO_PHASE
