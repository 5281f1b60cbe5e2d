"""Finds the limits of all parts of a policy that apply to one invocation, and lists those that were not found.

Each comparison, zone and window of a condition should have a limit. The search begins with the present scene, and goes
on with scenes in which the comparison matters (`pivot`), until the decision changes at the limit too.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from typing import NamedTuple

from rtshcua.decision import tree
from rtshcua.decision.contracts import drains
from rtshcua.ground.analysis.space import SituationSpace
from rtshcua.ground.testing.boundaries.case_values import always_tested
from rtshcua.ground.testing.boundaries.clause_limits import (
    ClauseLimit,
    along_the_ground,
    changes_decision,
    comparison_turns,
    in_height,
    in_space,
    in_time,
    limit_between,
    moments,
    with_made,
    zones_of,
)
from rtshcua.ground.testing.boundaries.pivot import pivots
from rtshcua.ground.testing.boundaries.scene import (
    PolicyPart,
    Scene,
    SceneChanges,
    SceneVariable,
    airspace_tree,
    questions,
)
from rtshcua.ground.testing.coverage_goals import ENERGY

#: atoms without a limit: `blocks` tests all their values in the present scene
_WHOLE = (tree.Member, tree.SlotKnown, tree.MonitorSays, tree.PhaseIn)
#: the name of the limit of the charge
_CHARGE = "the charge that is needed"


class MissedLimit(NamedTuple):
    """The name of a limit of a part at which no decision changes; `turned` means that the part itself changes there."""

    part: PolicyPart
    about: str
    turned: bool = False


class LimitSearch(NamedTuple):
    """The limits that were found, and those that were missed."""

    limits: tuple[ClauseLimit, ...]
    missed: tuple[MissedLimit, ...]


class _Field(NamedTuple):
    """The input of a search: all parts that apply to the invocation, the scene, the possible situations, and a filter
    for limits that a test can write.
    """

    parts: Sequence[PolicyPart]
    scene: Scene
    space: SituationSpace
    fits: Callable[[ClauseLimit], bool]


class _Question(NamedTuple):
    """A question of a part, its atom (None for the charge), and the part with the tree of the atom."""

    part: PolicyPart
    question: PolicyPart
    atom: tree.Atom | None
    whole: PolicyPart


def search(
    chosen: Sequence[PolicyPart],
    parts: Sequence[PolicyPart],
    scene: Scene,
    space: SituationSpace,
    fits: Callable[[ClauseLimit], bool] = lambda _: True,
) -> LimitSearch:
    """Find the limits of the `chosen` ones of all `parts` that apply to an invocation; `fits` filters limits."""
    field = _Field(parts, scene, space, fits)
    found: list[ClauseLimit] = []
    missed: list[MissedLimit] = []
    for part in chosen:
        for item in _questions(part, scene):
            turned, left = _sides(item, field)
            found += turned
            missed += left
    return LimitSearch(tuple(dict.fromkeys(found)), tuple(dict.fromkeys(missed)))


def _questions(part: PolicyPart, scene: Scene) -> Iterator[_Question]:
    if part.airspace is None:
        for atom, question in questions(part, scene.invocation):
            yield _Question(part, question, atom, part)
        return
    whole, zones = airspace_tree(part)
    for zone, (_, question) in zip(zones, questions(part, scene.invocation), strict=True):
        yield _Question(part, question, zone, whole)


def _sides(item: _Question, field: _Field) -> tuple[list[ClauseLimit], list[MissedLimit]]:
    """Find the limits of one question, in one situation after the other until none is missing."""
    wanted = dict.fromkeys(_wanted_limits(item, field.scene), False)  # whether the part changes at the limit
    shown: set[str] = set()
    found: list[ClauseLimit] = []
    reached = False
    for made in _situations(item, field):
        reached = reached or not made or not isinstance(item.atom, _WHOLE)
        done = frozenset(shown)
        for words, limit in _limits_here(item, field.scene.with_all(made), hidden=bool(made)):
            known = _without_own(made, limit, item.part, field.scene)
            if known is None or words in done or not field.fits(known):
                continue
            found.append(known)
            reached = True
            if words in wanted:
                wanted[words] = True
            if changes_decision(known, field.scene):
                shown.add(words)
        if reached and shown >= wanted.keys():
            break
    if not reached:
        return found, [MissedLimit(item.part, f"where {_question_words(item, field.scene)} decides")]
    return found, [MissedLimit(item.part, words, turned) for words, turned in wanted.items() if words not in shown]


def _situations(item: _Question, field: _Field) -> Iterator[SceneChanges]:
    """Yield the distinct changes of the scene in which to look for limits."""
    alone = item.atom is None or item.part.airspace is not None
    tries = iter(()) if item.atom is None else pivots(item.whole, item.atom, field.parts, field.scene, field.space)
    seen: list[SceneChanges] = []
    for made in chain(({},) if alone else (), tries):
        if made not in seen:
            seen.append(made)
            yield made


def _question_words(item: _Question, scene: Scene) -> str:
    """The name of a question."""
    match item.atom:
        case tree.AtMost(terms, _) | tree.Equal(terms, _):
            return " and ".join(_number(term, scene) for term in terms) or "a number"
        case tree.Member(argument, at, _):
            return _number(SceneVariable(argument, at), scene)
        case tree.SlotKnown(at):
            return _number(SceneVariable(False, at), scene)
        case tree.MonitorSays():
            return "the condition over time"
        case tree.PhaseIn():
            return "the phase"
        case tree.InWindow() | tree.InWeek():
            return "the time"
        case _:
            return " and ".join(f"`{zone.name}`" for zone in zones_of(item.question, scene.invocation)) or "the charge"


def _without_own(made: SceneChanges, limit: ClauseLimit, part: PolicyPart, scene: Scene) -> ClauseLimit | None:
    """Return the limit without the change of its own variable; None if it needs that change."""
    rest = {variable: value for variable, value in made.items() if variable != limit.variable}
    if rest == made:
        return with_made(limit, made)
    again = limit_between(part, scene.with_all(rest), limit.variable, limit.holds, limit.fails)
    return None if again is None else with_made(again, rest)


def _wanted_limits(item: _Question, scene: Scene) -> Iterator[str]:
    """Yield the names of the limits that a question should have."""
    atom = item.atom
    if item.part.role == ENERGY:
        yield from () if scene.invocation.policy.policy.vehicle.battery == -1 else (_CHARGE,)
        return
    if isinstance(atom, tree.AtMost | tree.Equal):
        yield from (_number(term, scene) for term in atom.terms if term.factor)
    yield from in_space(item.question, scene)
    yield from in_time(item.question, scene)


def _number(term: tree.LinearTerm | SceneVariable, scene: Scene) -> str:
    """The name of the variable that a comparison reads."""
    policy, contract = scene.invocation.policy.policy, scene.invocation.invocation.contract
    cells = {each.cell: each.name for each in contract.parameters}
    slots = {each.slot: each.name for each in policy.signals}
    return f"`{(cells if term.argument else slots).get(-1 if term.at is None else term.at, 'a number')}`"


def _limits_here(item: _Question, scene: Scene, *, hidden: bool) -> Iterator[tuple[str, ClauseLimit]]:
    """Yield the limits of a question in one situation with their names; `hidden` means a changed situation."""
    atom, part, question = item.atom, item.part, item.question
    if part.role == ENERGY:
        yield from ((_CHARGE, each) for each in _charge(part, scene))
        return
    if atom is not None:
        at = scene.environment()
        for variable, one, other in comparison_turns(atom, at, scene.invocation.policy.tables):
            found = limit_between(part, scene, variable, one, other)
            if found is not None:
                yield _number(variable, scene), found
    if hidden and isinstance(atom, tree.Member):
        yield from _members(atom, part, scene)
    yield from along_the_ground(question, part, scene)
    yield from in_height(question, part, scene)
    yield from moments(question, part, scene)


def _members(atom: tree.Member, part: PolicyPart, scene: Scene) -> Iterator[tuple[str, ClauseLimit]]:
    """Yield a limit between the present member and one with another truth, if there is one."""
    variable = SceneVariable(atom.argument, atom.at)
    members = [each for each in always_tested(variable, scene.invocation) if isinstance(each, int)]
    present = scene.value(variable)
    for value in members:
        limit = None if present is None else limit_between(part, scene, variable, present, value)
        if limit is not None:
            yield _number(variable, scene), limit
            return


def _charge(part: PolicyPart, scene: Scene) -> Iterator[ClauseLimit]:
    """Yield the limit of the charge that the skill needs from the vehicle's place."""
    invocation, slot = scene.invocation, scene.invocation.policy.policy.vehicle.battery
    slots, known = scene.environment().slots, invocation.policy.tables.known
    volume = invocation.planner.volume(slots, known)
    needed = invocation.energy.needed(volume.farthest[1], volume.height[:2], drains(slots[known.drain])[1])
    found = None if slot == -1 else limit_between(part, scene, SceneVariable(False, slot), needed - 1, needed)
    if found is not None:
        yield found
