"""Where a condition turns in space: along the ground of the zones that it asks for, and at their floor and ceiling."""

from collections.abc import Iterator

from rtshcua.decision import tree
from rtshcua.decision.outline import rings
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import Truth
from rtshcua.ground.testing.boundaries.edges import Place, edge, ring_edges
from rtshcua.ground.testing.boundaries.limits import Limit, tried
from rtshcua.ground.testing.boundaries.parts import Part, atoms, truth
from rtshcua.ground.testing.boundaries.scene import Scene, Variable
from rtshcua.model.flat.contract import PLACE
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, MAX_COORDINATE, Zone


def zones_of(part: Part, invocation: PreparedInvocation) -> tuple[Zone, ...]:
    """The zones that a part asks for, of an argument the one that it is."""
    policy = invocation.policy.policy
    numbers: list[int] = []
    if part.airspace is not None:
        numbers += (zone.number for zone in (*part.airspace.inside, *part.airspace.outside))
    for atom in () if part.node is None else atoms(part.node):
        match atom:
            case tree.Inside(zone) | tree.PointInside(_, zone):
                numbers.append(zone)
            case tree.InsideArgument(cell, table):
                chosen = invocation.invocation.arguments[cell]
                if 0 <= chosen < len(policy.tables[table]):
                    numbers.append(policy.tables[table][chosen])
            case _:
                pass
    return tuple(policy.zones[number] for number in dict.fromkeys(numbers))


def along_the_ground(question: Part, part: Part, scene: Scene) -> Iterator[tuple[str, Limit]]:
    """The edges of one zone of a part, of each ring of its outline one, for the vehicle's place and for each argument
    that is a place: what is looked for is where the question turns, what counts whether the part does.
    """
    policy = scene.invocation.policy.policy
    for zone in zones_of(question, scene.invocation):
        for variable in _places(question, scene):
            start = scene.place(variable)

            def holds(place: Place, variable: Variable = variable) -> Truth:
                return truth(question, scene.put(variable, place))

            outline = _rings(zone)
            found = None if start is None else edge(policy, holds, start, (zone,))
            limit = None if found is None else tried(part, scene, variable, found.holds, found.fails)
            if limit is not None and len(outline) < 2:
                yield _edge(zone, variable, 0, scene), limit
                continue
            for number, ring in enumerate(outline):
                across = (
                    tried(part, scene, variable, each.holds, each.fails) for each in ring_edges(policy, holds, ring)
                )
                one = next((each for each in across if each is not None), None)
                if one is not None:
                    yield _edge(zone, variable, number, scene), one


def in_height(question: Part, part: Part, scene: Scene) -> Iterator[tuple[str, Limit]]:
    """The floor and the ceiling of the zones of a part, for the vehicle's height."""
    slot = scene.invocation.policy.policy.vehicle.height
    for zone in zones_of(question, scene.invocation) if slot != -1 and _asks_where(question) else ():
        for word, band in _bands(zone):
            for one in (band - 1, band):
                found = tried(part, scene, Variable(False, slot), one, one + 1)
                if found is not None:
                    yield f"the {word} of `{zone.name}`", found


def in_space(question: Part, scene: Scene) -> Iterator[str]:
    """The limits that a question should have in space, in words."""
    height = scene.invocation.policy.policy.vehicle.height != -1 and _asks_where(question)
    for zone in zones_of(question, scene.invocation):
        for variable in _places(question, scene):
            asked = isinstance(question.node, tree.PointInside) or not variable.argument
            for number in range(max(1, len(_rings(zone)))) if asked and not _everywhere(zone) else ():
                yield _edge(zone, variable, number, scene)
        if height:
            yield from (f"the {word} of `{zone.name}`" for word, _ in _bands(zone))
        elif isinstance(question.node, tree.PointInside):
            yield from (
                f"the {word} of `{zone.name}`, which counts for no place on the ground" for word, _ in _bands(zone)
            )


def _edge(zone: Zone, variable: Variable, ring: int, scene: Scene) -> str:
    policy, contract = scene.invocation.policy.policy, scene.invocation.invocation.contract
    if variable.argument:
        name = next(each.name for each in contract.parameters if each.cell == variable.at)
    else:
        name = next(each.name for each in policy.signals if each.slot == variable.at)
    which = "the edge" if len(_rings(zone)) < 2 else f"edge {ring + 1}"
    return f"{which} of `{zone.name}` for `{name}`"


def _rings(zone: Zone) -> list[tuple[Place, ...]]:
    """The outline of a zone; a circle has none of corners."""
    return [] if zone.shape == CIRCLE else list(rings(zone))


def _everywhere(zone: Zone) -> bool:
    """Whether a zone is a circle that has all places in it."""
    return zone.shape == CIRCLE and zone.data[2] >= MAX_COORDINATE * MAX_COORDINATE


def _bands(zone: Zone) -> Iterator[tuple[str, int]]:
    """The floor and the ceiling, as far as a zone has them."""
    for word, band in (("floor", zone.floor), ("ceiling", zone.ceiling)):
        if LOWEST < band < HIGHEST:
            yield word, band


def _asks_where(part: Part) -> bool:
    """Whether a part asks where the vehicle is."""
    return part.airspace is not None or isinstance(part.node, tree.Inside | tree.InsideArgument)


def _places(question: Part, scene: Scene) -> Iterator[Variable]:
    """The places that it may turn on: the vehicle's, and arguments, also where they are where the vehicle would fly."""
    policy, contract = scene.invocation.policy.policy, scene.invocation.invocation.contract
    if _asks_where(question) and policy.vehicle.position != -1:
        yield Variable(False, policy.vehicle.position)
    for parameter in contract.parameters:
        asked = isinstance(question.node, tree.PointInside) and question.node.cell == parameter.cell
        if parameter.kind == PLACE and (asked or question.airspace is not None):
            yield Variable(True, parameter.cell)
