"""Finds the limits of a part of a policy: two adjacent writable values, one with a true part, one with a false part.

For numbers, the limit follows from the comparison in the condition's tree and `decision.nearest`, with the other terms
unchanged. In space, limits are the outlines, floors and ceilings of zones. In time, they are windows of the day or week
and the dates of zones. Each limit is verified by evaluating the part on both sides.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from rtshcua.decision import tree
from rtshcua.decision.decide import decide
from rtshcua.decision.evaluate import Environment, Tables, build, total
from rtshcua.decision.nearest import ChangeSearch, nearest_in
from rtshcua.decision.outline import rings
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.temporal import lasting
from rtshcua.decision.times import time_of_week
from rtshcua.decision.values import FALSE, TRUE, Truth
from rtshcua.ground.testing.boundaries.scene import (
    TIME,
    PolicyPart,
    Scene,
    SceneChanges,
    SceneVariable,
    Value,
    part_truth,
)
from rtshcua.ground.testing.boundaries.zone_edges import Place, ring_edges, zone_edge
from rtshcua.model.flat.contract import PLACE
from rtshcua.model.flat.limits import DAY, WEEK
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, MAX_COORDINATE, Zone
from rtshcua.model.outcome import Outcome, Reason


class ClauseLimit(NamedTuple):
    """A limit: the part is true if a variable is `holds`, and false if it is the adjacent value `fails`.

    `made` are the changes of other variables with which this limit matters.
    """

    part: PolicyPart
    variable: SceneVariable
    holds: Value
    fails: Value
    made: tuple[tuple[SceneVariable, Value], ...] = ()


def comparison_turns(atom: tree.Atom, at: Environment, tables: Tables) -> Iterator[tuple[SceneVariable, int, int]]:
    """Yield the limits of a comparison: a variable, and two adjacent values of it."""
    if not isinstance(atom, tree.AtMost | tree.Equal):
        return
    for term in atom.terms:
        if not term.factor:
            continue
        low, high, gap = total(tuple(other for other in atom.terms if other is not term), at)
        if gap or low != high:
            continue
        variable = SceneVariable(term.argument, term.at)
        if isinstance(atom, tree.Equal):
            value, rest = divmod(atom.value - low, term.factor)
            if not rest:
                yield variable, value - 1, value
                yield variable, value, value + 1
            continue
        alone = tree.AtMost((term,), atom.bound - low)
        present = build(alone, tables)(at)
        for change in ChangeSearch(at, tables).find(alone, present != TRUE) or ():
            turned = nearest_in(change, (at.arguments if term.argument else at.slots)[term.at])
            yield variable, turned, turned - 1 if turned == change.low else turned + 1


def limit_between(
    part: PolicyPart, scene: Scene, variable: SceneVariable, one: Value, other: Value
) -> ClauseLimit | None:
    """Return the limit between two values if the part is true at one and false at the other, else None."""
    found = {part_truth(part, scene.put(variable, value)): value for value in (one, other)}
    return ClauseLimit(part, variable, found[TRUE], found[FALSE]) if found.keys() == {TRUE, FALSE} else None


def changes_decision(limit: ClauseLimit, scene: Scene) -> bool:
    """Whether the decisions on the two sides of a limit differ; `scene` is the scene without its changes."""
    here = scene.with_all(dict(limit.made))
    return _expectable(here.put(limit.variable, limit.holds)) != _expectable(here.put(limit.variable, limit.fails))


def _expectable(scene: Scene) -> tuple[Outcome, Reason, int | None]:
    """The expectable parts of the decision, as if the state had lasted for long."""
    policy = scene.invocation.policy
    state = lasting(scene.state, policy, scene.now)
    found = decide(scene.invocation, state, policy, scene.context, scene.now)
    return found.outcome, found.reason, None if found.target is None else found.target.skill


def with_made(limit: ClauseLimit, made: SceneChanges) -> ClauseLimit:
    """The limit with changes of the scene."""
    return limit._replace(made=tuple(sorted(made.items(), key=lambda one: (one[0].argument, one[0].at or -1))))


def zones_of(part: PolicyPart, invocation: PreparedInvocation) -> tuple[Zone, ...]:
    """The zones that a part refers to; for an argument the present one."""
    policy = invocation.policy.policy
    numbers: list[int] = []
    if part.airspace is not None:
        numbers += (zone.number for zone in (*part.airspace.inside, *part.airspace.outside))
    for atom in part.atoms:
        match atom:
            case tree.InsideZone(zone) | tree.PointInside(_, zone):
                numbers.append(zone)
            case tree.InsideArgument(cell, table):
                chosen = invocation.invocation.arguments[cell]
                if 0 <= chosen < len(policy.tables[table]):
                    numbers.append(policy.tables[table][chosen])
            case _:
                pass
    return tuple(policy.zones[number] for number in dict.fromkeys(numbers))


def along_the_ground(question: PolicyPart, part: PolicyPart, scene: Scene) -> Iterator[tuple[str, ClauseLimit]]:
    """Yield the edges of a part's zones, one for each ring, for the vehicle's place and each argument that is a place.

    The search follows the `question`; a limit counts if the `part` changes there.
    """
    policy = scene.invocation.policy.policy
    for zone in zones_of(question, scene.invocation):
        for variable in _place_variables(question, scene):
            start = scene.place(variable)

            def holds(place: Place, variable: SceneVariable = variable) -> Truth:
                return part_truth(question, scene.put(variable, place))

            outline = _rings(zone)
            found = None if start is None else zone_edge(policy, holds, start, (zone,))
            limit = None if found is None else limit_between(part, scene, variable, found.holds, found.fails)
            if limit is not None and len(outline) < 2:
                yield _edge_words(zone, variable, 0, scene), limit
                continue
            for number, ring in enumerate(outline):
                across = (
                    limit_between(part, scene, variable, each.holds, each.fails)
                    for each in ring_edges(policy, holds, ring)
                )
                one = next((each for each in across if each is not None), None)
                if one is not None:
                    yield _edge_words(zone, variable, number, scene), one


def in_height(question: PolicyPart, part: PolicyPart, scene: Scene) -> Iterator[tuple[str, ClauseLimit]]:
    """Yield the limits at the floors and ceilings of a part's zones, for the vehicle's height."""
    slot = scene.invocation.policy.policy.vehicle.height
    for zone in zones_of(question, scene.invocation) if slot != -1 and _asks_where(question) else ():
        for word, band in _bands(zone):
            for one in (band - 1, band):
                found = limit_between(part, scene, SceneVariable(False, slot), one, one + 1)
                if found is not None:
                    yield f"the {word} of `{zone.name}`", found


def in_space(question: PolicyPart, scene: Scene) -> Iterator[str]:
    """Yield the names of the limits that a question should have in space."""
    height = scene.invocation.policy.policy.vehicle.height != -1 and _asks_where(question)
    for zone in zones_of(question, scene.invocation):
        for variable in _place_variables(question, scene):
            relevant = isinstance(question.node, tree.PointInside) or not variable.argument
            for number in range(max(1, len(_rings(zone)))) if relevant and not _everywhere(zone) else ():
                yield _edge_words(zone, variable, number, scene)
        if height:
            yield from (f"the {word} of `{zone.name}`" for word, _ in _bands(zone))
        elif isinstance(question.node, tree.PointInside):
            yield from (f"the {word} of `{zone.name}`, which a place on the ground ignores" for word, _ in _bands(zone))


def _edge_words(zone: Zone, variable: SceneVariable, ring: int, scene: Scene) -> str:
    policy, contract = scene.invocation.policy.policy, scene.invocation.invocation.contract
    if variable.argument:
        name = next(each.name for each in contract.parameters if each.cell == variable.at)
    else:
        name = next(each.name for each in policy.signals if each.slot == variable.at)
    which = "the edge" if len(_rings(zone)) < 2 else f"edge {ring + 1}"
    return f"{which} of `{zone.name}` for `{name}`"


def _rings(zone: Zone) -> list[tuple[Place, ...]]:
    """The rings of a zone's outline; empty for a circle."""
    return [] if zone.shape == CIRCLE else list(rings(zone))


def _everywhere(zone: Zone) -> bool:
    """Whether a zone is a circle that contains all places."""
    return zone.shape == CIRCLE and zone.data[2] >= MAX_COORDINATE * MAX_COORDINATE


def _bands(zone: Zone) -> Iterator[tuple[str, int]]:
    """Yield the floor and the ceiling of a zone, if it has them."""
    for word, band in (("floor", zone.floor), ("ceiling", zone.ceiling)):
        if LOWEST < band < HIGHEST:
            yield word, band


def _asks_where(part: PolicyPart) -> bool:
    """Whether a part depends on the position of the vehicle."""
    return part.airspace is not None or isinstance(part.node, tree.InsideZone | tree.InsideArgument)


def _place_variables(question: PolicyPart, scene: Scene) -> Iterator[SceneVariable]:
    """Yield the places on which a question may depend: the vehicle's position, and arguments."""
    policy, contract = scene.invocation.policy.policy, scene.invocation.invocation.contract
    if _asks_where(question) and policy.vehicle.position != -1:
        yield SceneVariable(False, policy.vehicle.position)
    for parameter in contract.parameters:
        named = isinstance(question.node, tree.PointInside) and question.node.cell == parameter.cell
        if parameter.kind == PLACE and (named or question.airspace is not None):  # the vehicle would fly there
            yield SceneVariable(True, parameter.cell)


def moments(question: PolicyPart, part: PolicyPart, scene: Scene) -> Iterator[tuple[str, ClauseLimit]]:
    """Yield the limits in time, to the microsecond: on the scene's day, and at the dates of zones.

    The search follows the `question`; a limit counts if the `part` changes there.
    """
    times = sorted(set(_change_times(question, scene)))
    samples = sorted({scene.now.utc_us, *times, *((one + other) // 2 for one, other in pairwise(times))})
    known = [(moment, part_truth(question, scene.put(TIME, moment))) for moment in samples if moment >= 0]
    for (one, before), (other, after) in pairwise(known):
        if {before, after} == {TRUE, FALSE}:
            low, high = one, other
            while high - low > 1:
                half = (low + high) // 2
                low, high = (half, high) if part_truth(question, scene.put(TIME, half)) == before else (low, half)
            found = limit_between(part, scene, TIME, low, high)
            if found is not None:
                yield _moment_words(question, scene, low, opens=after == TRUE), found


def in_time(question: PolicyPart, scene: Scene) -> Iterator[str]:
    """Yield the names of the limits that a question should have in time."""
    windows = isinstance(question.node, tree.InWindow | tree.InWeek) or any(
        len(set(zone.daily)) == 2 or zone.weekly for zone in zones_of(question, scene.invocation)
    )
    if windows:
        yield from ("the start of its hours", "the end of its hours")
    if any(zone.dates for zone in zones_of(question, scene.invocation)):
        yield from ("its first moment", "its last moment")


def _moment_words(question: PolicyPart, scene: Scene, moment: int, *, opens: bool) -> str:
    """The name of a limit in time. A limit may come earlier than a date by the duration of the step."""
    early = scene.invocation.lasts_us + 2
    outside = question.airspace is not None and not question.airspace.inside
    dates = [date for zone in zones_of(question, scene.invocation) for date in zone.dates]
    if any(abs(moment - date) <= early for date in dates):
        return "its first moment" if opens != outside else "its last moment"
    return "the start of its hours" if opens != outside else "the end of its hours"


def _change_times(part: PolicyPart, scene: Scene) -> Iterator[int]:
    """Yield times such that between two consecutive ones there is at most one limit."""
    local = scene.now.utc_us + scene.invocation.policy.tables.local.offset(scene.now.utc_us)
    midnight, monday = scene.now.utc_us - local % DAY, scene.now.utc_us - time_of_week(local)
    daily: list[int] = []
    weekly: list[int] = []
    for atom in part.atoms:
        if isinstance(atom, tree.InWindow):
            daily += (atom.start, atom.end)
        elif isinstance(atom, tree.InWeek):
            weekly += atom.windows
    for zone in zones_of(part, scene.invocation):
        daily += zone.daily
        weekly += zone.weekly
        yield from (date + late for date in zone.dates for late in (-DAY // 2, -1, 0, 1, DAY // 2))
    if daily:
        yield from (midnight + time + late for time in (0, *daily, DAY - 1) for late in (-1, 0, 1))
    if weekly:
        yield from (monday + time + late for time in (0, *weekly, WEEK - 1) for late in (-1, 0, 1))
