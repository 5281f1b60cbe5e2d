"""Finds situations in which one comparison decides its condition, and the condition the decision.

In `(area inside bridge_a or area inside bridge_b) and altitude <= 30 m` the height only matters over a bridge. The
analysis of the compiler's proofs finds a situation in which the condition is true if the comparison is replaced by
true, and false if it is replaced by false, and no other rule decides first. The situation differs from the scene as
little as possible.
"""

from collections.abc import Iterator, Sequence

from rtshcua.decision import tree
from rtshcua.decision.evaluate import build
from rtshcua.decision.values import FALSE, MISSING, TRUE, UNKNOWN, Value, point
from rtshcua.ground.analysis.condition_trees import ALWAYS, NEVER, replace_atoms, signed_atoms
from rtshcua.ground.analysis.solve import Goal, Yes, satisfiable
from rtshcua.ground.analysis.space import SituationSpace, reads_days
from rtshcua.ground.analysis.witness import Witness
from rtshcua.ground.testing.boundaries.scene import PolicyPart, Scene, SceneChanges, SceneVariable
from rtshcua.model.flat.contract import PLACE
from rtshcua.model.flat.limits import DAY
from rtshcua.model.flat.signal import Signal
from rtshcua.model.quantity import Dimension

#: the most boxes that the analysis examines for one answer
_BUDGET = 400
#: 100 m, 100 m/s: the largest value of a signal that is preferred
_LARGEST = 100_000
#: the largest raw value of a voltage, whose field holds 16 bits
_MOST_RAW = 60_000
#: the truth with which a part lets later steps decide
_PASSED = {"forbid": FALSE, "permit": TRUE, "confirm": FALSE, "degrade": FALSE}


def matters(part: PolicyPart, atom: tree.Atom) -> list[Goal]:
    """Return the goals with which an atom decides its condition: the condition is true if the atom is true (false under
    a `not`), and the reverse. The atom is compared by identity.
    """
    node = part.node
    assert node is not None

    def taken(value: tree.Node) -> tree.Node:
        return replace_atoms(node, lambda each, _: value if each is atom else each)

    positive = all(sign for each, sign in signed_atoms(node) if each is atom)
    return [(taken(ALWAYS), TRUE if positive else FALSE), (taken(NEVER), FALSE if positive else TRUE)]


def before(part: PolicyPart, parts: Sequence[PolicyPart], scene: Scene) -> list[Goal]:
    """Return the goals for the other conditions of this and of earlier steps, so that this one decides."""
    goals: list[Goal] = []
    for other in parts:
        if other.node is None or (other.role == part.role and other.clause is part.clause):
            continue
        if other.role == "permit" and part.role == "permit":
            goals.append((other.node, FALSE | UNKNOWN))
        elif other.role in ("forbid", "confirm", "degrade") or other.role not in _PASSED:
            goals.append((other.node, _PASSED.get(other.role, TRUE)))
    if part.role != "permit":
        goals += permitted(parts, scene)
    return goals


def permitted(parts: Sequence[PolicyPart], scene: Scene) -> Iterator[Goal]:
    """Yield the goal that some permit is true. An unconditional permit always is, so there is no goal then."""
    permits = [part.node for part in parts if part.role == "permit" and part.node is not None]
    if permits and all(rule.rule.when is not None for rule in scene.invocation.candidates.permits):
        some = permits[0]
        for other in permits[1:]:
            some = tree.Either(some, other)
        yield some, TRUE


def pivots(
    part: PolicyPart, atom: tree.Atom, parts: Sequence[PolicyPart], scene: Scene, space: SituationSpace
) -> Iterator[SceneChanges]:
    """Yield changes of a scene with which an atom decides, the smallest first: an empty one if it decides already.

    An atom with several limits, such as a zone, shows some of them only where it is true, others where it is false.
    """
    goals, tables, at = matters(part, atom), scene.invocation.policy.tables, scene.environment()
    others = before(part, parts, scene)
    if all(build(node, tables)(at) & truths for node, truths in (*goals, *others)):
        yield {}
    holding: list[list[Goal]] = [[], [(atom, TRUE)], [(atom, FALSE)]]
    for so in holding:
        for wanted in ([*goals, *others], goals):
            found = settled([*wanted, *so], space, scene)
            if found is not None:
                yield found
                break


def settled(goals: Sequence[Goal], space: SituationSpace, scene: Scene) -> SceneChanges | None:
    """Return changes of a scene that reach the goals, or None. One variable after the other is kept if possible."""
    invocation = scene.invocation
    preferred = dict(_present(scene))
    kept: dict[SceneVariable, Value | tuple[Value, Value]] = {}
    space = space._replace(phases=frozenset({invocation.phase}), monitors=scene.state.monitors or space.monitors)
    plain = _plain(space, scene.invocation.policy.policy.signals)
    answer = satisfiable(goals, plain, _BUDGET)
    if isinstance(answer, Yes):
        space = plain
    else:
        answer = satisfiable(goals, space, _BUDGET)
    if not isinstance(answer, Yes):
        return None
    for variable, value in preferred.items():
        narrowed = satisfiable(goals, _narrowed(space, {**kept, variable: value}, scene), _BUDGET)
        if isinstance(narrowed, Yes):
            kept[variable], answer = value, narrowed
    return {
        variable: value
        for variable in preferred
        if variable not in kept
        for value in [_of(answer.witness, variable, scene)]
        if value is not None
    }


def _plain(space: SituationSpace, signals: Sequence[Signal]) -> SituationSpace:
    """The space without numbers that a vehicle hardly reports."""
    most = {
        each.slot: min(_MOST_RAW * source.numerator // source.denominator for source in each.sources)
        for each in signals
        if each.dimension == Dimension.VOLTAGE.value and each.sources
    }
    slots = (
        (max(low, -largest), min(high, largest), gap, members) if members is None and high > largest else value
        for slot, value in enumerate(space.slots)
        for low, high, gap, members in (value,)
        for largest in (most.get(slot, _LARGEST),)
    )
    where = {space.tables.known.x, space.tables.known.y}
    return space._replace(
        slots=tuple(space.slots[slot] if slot in where else value for slot, value in enumerate(slots))
    )


def _present(scene: Scene) -> Iterator[tuple[SceneVariable, Value | tuple[Value, Value]]]:
    """Yield the present value of each variable: arguments first, then the time, then signals."""
    invocation, at = scene.invocation, scene.environment()
    policy, contract = invocation.policy.policy, invocation.invocation.contract
    for parameter in contract.parameters:
        cell = parameter.cell
        one = at.arguments[cell]
        yield SceneVariable(True, cell), ((one, at.arguments[cell + 1]) if parameter.kind == PLACE else one)
    yield SceneVariable(False, None), point(scene.now.utc_us)
    for signal in policy.signals:
        slot = signal.slot
        one = at.slots[slot]
        yield SceneVariable(False, slot), ((one, at.slots[slot + 1]) if slot == policy.vehicle.position else one)


def _narrowed(
    space: SituationSpace, kept: dict[SceneVariable, Value | tuple[Value, Value]], scene: Scene
) -> SituationSpace:
    arguments, slots = list(space.arguments), list(space.slots)
    utc = space.utc
    for variable, value in kept.items():
        if variable.at is None:
            utc = ((scene.now.utc_us, scene.now.utc_us),)
            continue
        cells = arguments if variable.argument else slots
        values: tuple[Value, ...] = (value[0], value[1]) if isinstance(value[0], tuple) else (value,)
        cells[variable.at : variable.at + len(values)] = values
    return space._replace(arguments=tuple(arguments), slots=tuple(slots), utc=utc)


def _of(witness: Witness, variable: SceneVariable, scene: Scene) -> int | tuple[int, int] | None:
    """The value of a variable in a witness; None if it is missing.

    If no condition depends on dates or weekdays, and the UTC offset is fixed, the time is moved to the scene's day.
    """
    invocation, policy = scene.invocation, scene.invocation.policy.policy
    if variable.at is None:
        moment, now = witness.at.utc[0][0], scene.now.utc_us
        contract, local = invocation.invocation.contract, invocation.policy.tables.local
        bound = any(zone.dates for zone in policy.zones) or reads_days(policy, contract) or not local.fixed
        return moment if bound else now - now % DAY + moment % DAY
    cells = witness.at.arguments if variable.argument else witness.at.slots
    one = cells[variable.at]
    if one == MISSING:
        return None
    place = any(each.kind == PLACE and each.cell == variable.at for each in invocation.invocation.contract.parameters)
    if (place and variable.argument) or (not variable.argument and variable.at == policy.vehicle.position):
        other = cells[variable.at + 1]
        return None if other == MISSING else (one[0], other[0])
    return one[0]
