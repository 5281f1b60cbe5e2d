"""A situation whose variables can be changed, and the parts of a policy that decide in it."""

from collections.abc import Iterator
from dataclasses import replace as changed
from typing import NamedTuple, TypeAlias

from msgspec.structs import replace

from rtshcua.decision import tree
from rtshcua.decision.contracts import first_cell, misfit
from rtshcua.decision.evaluate import Condition, Environment, build
from rtshcua.decision.prepare import PreparedAirspace, PreparedInvocation
from rtshcua.decision.situation import environment, ranging, situation
from rtshcua.decision.values import EVERYWHERE, Truth, point
from rtshcua.decision.volume import Planner, flown_at, near_home
from rtshcua.ground.analysis.condition_trees import signed_atoms
from rtshcua.ground.testing.coverage_goals import AIRSPACE, ENERGY, ENERGY_TEXT, clauses_of
from rtshcua.model.decision import Decisive
from rtshcua.model.flat.contract import PLACE, MotionKind
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Rule
from rtshcua.model.flat.situation import Context, Now, State

#: a value of a variable: one integer, the two of a place (local mm), or None for a signal that is missing
Value: TypeAlias = int | tuple[int, int] | None


class SceneVariable(NamedTuple):
    """An argument cell or a state slot (the first of two for a place), or the time (`at` is None), as in `Change`."""

    argument: bool
    at: int | None


TIME = SceneVariable(False, None)
SceneChanges: TypeAlias = dict[SceneVariable, Value]


class Scene(NamedTuple):
    """The input of a decision."""

    invocation: PreparedInvocation
    state: State
    context: Context
    now: Now

    def environment(self) -> Environment:
        """The environment in which conditions are evaluated."""
        invocation = self.invocation
        sets = situation(self.state, invocation.policy, self.now)
        return environment(sets, invocation.policy, invocation.arguments, invocation.phase)

    def value(self, variable: SceneVariable) -> int | None:
        """The present value of a variable that is one integer."""
        if variable.at is None:
            return self.now.utc_us
        if variable.argument:
            return self.invocation.invocation.arguments[variable.at]
        return self.state.values[variable.at]

    def place(self, variable: SceneVariable) -> tuple[int, int] | None:
        """The present value of a variable that is a place."""
        assert variable.at is not None
        cells = self.invocation.invocation.arguments if variable.argument else self.state.values
        x, y = cells[variable.at : variable.at + 2]
        return None if x is None or y is None else (x, y)

    def put(self, variable: SceneVariable, value: Value) -> "Scene":
        """Return the scene with another value. The age of the mission and the release stay the same."""
        if variable.at is None:
            assert isinstance(value, int)
            flat = self.invocation.invocation
            issued = flat.issued_at_us + value - self.now.utc_us
            moved = changed(self.invocation, invocation=replace(flat, issued_at_us=issued))
            return self._replace(invocation=moved, now=replace(self.now, utc_us=value))
        new: tuple[int | None, ...] = value if isinstance(value, tuple) else (value,)
        if variable.argument:
            cells = list(self.invocation.invocation.arguments)
            cells[variable.at : variable.at + len(new)] = [each for each in new if each is not None]
            return self._replace(invocation=replanned(self.invocation, tuple(cells)))
        values = list(self.state.values)
        if value is None and variable.at == self.invocation.policy.policy.vehicle.position:
            new = (None, None)
        values[variable.at : variable.at + len(new)] = new
        return self._replace(state=replace(self.state, values=tuple(values)))

    def with_all(self, made: SceneChanges) -> "Scene":
        """Return the scene with other values."""
        scene = self
        for variable, value in made.items():
            scene = scene.put(variable, value)
        return scene


def replanned(invocation: PreparedInvocation, arguments: tuple[int, ...]) -> PreparedInvocation:
    """Return the invocation with other arguments and their plan. The path of a survey is not planned again."""
    flat, vehicle = invocation.invocation, invocation.policy.policy.vehicle
    contract = flat.contract
    motion, plan = contract.motion, flat.plan
    path = plan.path
    if motion.kind == MotionKind.FLY:
        cell = first_cell(contract, PLACE)
        path = arguments[cell : cell + 2]
    altitude = plan.altitude if motion.altitude == -1 else arguments[motion.altitude]
    speed = plan.speed if motion.speed == -1 else arguments[motion.speed]
    lowest = altitude if motion.lowest == -1 else arguments[motion.lowest]
    heights = tuple(min(max(height, lowest), altitude) for height in plan.heights)
    plan = replace(plan, path=path, altitude=altitude, speed=speed, heights=heights)
    planned: Invocation = replace(flat, arguments=arguments, plan=plan)
    flown = flown_at(motion, altitude, vehicle)
    planner = Planner(plan.kind, path, flown, vehicle.position_error, near_home(vehicle), heights)
    return changed(
        invocation,
        invocation=planned,
        arguments=tuple(map(point, arguments)),
        misfit=misfit(arguments, contract),
        planner=planner,
    )


#: the role of clauses that must hold in the whole planned volume
MAINTAIN = "maintain"


class PolicyPart(NamedTuple):
    """A condition of a policy: its role, its clause, and its tree (None for airspace and energy)."""

    role: str
    clause: Decisive
    node: tree.Node | None = None
    condition: Condition | None = None
    airspace: PreparedAirspace | None = None

    @property
    def text(self) -> str:
        """The text of the clause on one line."""
        return ENERGY_TEXT if self.clause is None else " ".join(self.clause.text.split())

    @property
    def atoms(self) -> list[tree.Atom]:
        """The atoms of the condition, from left to right."""
        return [] if self.node is None else [atom for atom, _ in signed_atoms(self.node)]


def parts_of(invocation: PreparedInvocation) -> Iterator[PolicyPart]:
    """Yield the parts that may decide on an invocation, in the order of design 4.1, without unconditional rules."""
    policy, candidates = invocation.policy, invocation.candidates
    for role, rules in (
        ("forbid", candidates.forbids),
        ("permit", candidates.permits),
        ("confirm", candidates.confirms),
    ):
        for rule in rules:
            yield from _rule_part(role, rule.rule, rule.condition, policy.compiler.when(rule.rule))
    contract = invocation.invocation.contract
    for role, clause in clauses_of(contract):
        node = policy.compiler.node(clause, contract)
        yield PolicyPart(role, clause, node, build(node, policy.tables))
    if policy.airspace is not None:
        yield PolicyPart(AIRSPACE, policy.airspace.airspace, airspace=policy.airspace)
    yield PolicyPart(ENERGY, None)
    for degrade in candidates.degrades:
        yield from _rule_part("degrade", degrade.rule, degrade.condition, policy.compiler.when(degrade.rule))


def _rule_part(role: str, rule: Rule, condition: Condition, node: tree.Node | None) -> Iterator[PolicyPart]:
    if node is not None:
        yield PolicyPart(role, rule, node, condition)


def questions(part: PolicyPart, invocation: PreparedInvocation) -> Iterator[tuple[tree.Atom | None, PolicyPart]]:
    """Yield the elements of a part as parts: the atoms of its condition, or the zones of an airspace, or the charge."""
    if part.node is not None:
        for atom in part.atoms:
            yield atom, part._replace(node=atom, condition=build(atom, invocation.policy.tables))
    elif part.airspace is not None:
        for zone in part.airspace.inside:
            yield None, part._replace(airspace=part.airspace._replace(inside=(zone,), outside=()))
        for zone in part.airspace.outside:
            yield None, part._replace(airspace=part.airspace._replace(inside=(), outside=(zone,)))
    else:
        yield None, part


def airspace_tree(part: PolicyPart) -> tuple[PolicyPart, tuple[tree.Atom, ...]]:
    """Return an airspace as a condition on the vehicle's place, and its zones in the order of `questions`."""
    assert part.airspace is not None
    inside = [tree.InsideZone(zone.number) for zone in part.airspace.inside]
    outside = [tree.InsideZone(zone.number) for zone in part.airspace.outside]
    nodes: list[tree.Node] = [*inside, *(tree.Negation(zone) for zone in outside)]
    whole = nodes[0]
    for node in nodes[1:]:
        whole = tree.Both(whole, node)
    return part._replace(node=whole), (*inside, *outside)


def part_truth(part: PolicyPart, scene: Scene) -> Truth:
    """The truth of a part in the step of the decision that evaluates it."""
    invocation, at = scene.invocation, scene.environment()
    policy = invocation.policy
    known = policy.tables.known
    if part.condition is not None and part.role != MAINTAIN:
        return part.condition(at)
    volume = invocation.planner.volume(at.slots, known)
    if part.condition is not None:
        return EVERYWHERE[part.condition(ranging(at, volume, known.height, invocation.lasts_us))]
    if part.airspace is not None:
        return EVERYWHERE[part.airspace.keeps(volume.place, at, invocation.lasts_us)]
    return EVERYWHERE[invocation.energy.suffices(at.slots[known.battery], volume, at.slots[known.drain])]
