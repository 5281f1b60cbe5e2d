"""All limits of what bears on one invocation, and those of them for which no situation was found.

Each comparison, zone and window of a condition should turn it somewhere. From the scene as it is, then from others in
which that part of the condition decides (`pivot`), each is looked for until what is decided turns too.
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

#: what has no limit, only sides: all of them are asked for in the scene as it is (`blocks`)
_WHOLE = (tree.Member, tree.SlotKnown, tree.MonitorSays, tree.PhaseIn)
#: the limit of what a skill needs, in words
_CHARGE = "the charge that is needed"


class MissedLimit(NamedTuple):
    """A limit of a part, in words, on which nothing that is decided was seen to turn; `turned` says that the part was
    true and false on its sides.
    """

    part: PolicyPart
    about: str
    turned: bool = False


class LimitSearch(NamedTuple):
    """What was found of some parts, and what was not."""

    limits: tuple[ClauseLimit, ...]
    missed: tuple[MissedLimit, ...]


class _Field(NamedTuple):
    """Where limits are looked for: all parts that bear on the invocation, the scene, what may be, what can be asked."""

    parts: Sequence[PolicyPart]
    scene: Scene
    space: SituationSpace
    fits: Callable[[ClauseLimit], bool]


class _Question(NamedTuple):
    """A question of a part, its atom (of the charge there is none), and the part with the tree that the atom is of."""

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
    """The limits of the chosen ones of all parts that bear on an invocation; `fits` says whether one can be asked."""
    field = _Field(parts, scene, space, fits)
    found: list[ClauseLimit] = []
    missed: list[MissedLimit] = []
    for part in chosen:
        for asked in _questions(part, scene):
            turned, left = _sides(asked, field)
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


def _sides(asked: _Question, field: _Field) -> tuple[list[ClauseLimit], list[MissedLimit]]:
    """The limits of one question, looked for in one situation after the other as long as some are missing."""
    wanted = dict.fromkeys(_wanted_limits(asked, field.scene), False)  # whether it was seen to turn the part
    shown: set[str] = set()
    found: list[ClauseLimit] = []
    reached = False
    for made in _situations(asked, field):
        reached = reached or not made or not isinstance(asked.atom, _WHOLE)
        done = frozenset(shown)
        for words, limit in _limits_here(asked, field.scene.with_all(made), hidden=bool(made)):
            known = _without_own(made, limit, asked.part, field.scene)
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
        return found, [MissedLimit(asked.part, f"where {_question_words(asked, field.scene)} decides")]
    return found, [MissedLimit(asked.part, words, turned) for words, turned in wanted.items() if words not in shown]


def _situations(asked: _Question, field: _Field) -> Iterator[SceneChanges]:
    """What is changed to look for limits, each once."""
    alone = asked.atom is None or asked.part.airspace is not None
    tries = iter(()) if asked.atom is None else pivots(asked.whole, asked.atom, field.parts, field.scene, field.space)
    seen: list[SceneChanges] = []
    for made in chain(({},) if alone else (), tries):
        if made not in seen:
            seen.append(made)
            yield made


def _question_words(asked: _Question, scene: Scene) -> str:
    """A question that nothing was found for, in words."""
    match asked.atom:
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
            return " and ".join(f"`{zone.name}`" for zone in zones_of(asked.question, scene.invocation)) or "the charge"


def _without_own(made: SceneChanges, limit: ClauseLimit, part: PolicyPart, scene: Scene) -> ClauseLimit | None:
    """The limit in what is changed besides what turns; None where it no longer turns without that."""
    rest = {variable: value for variable, value in made.items() if variable != limit.variable}
    if rest == made:
        return with_made(limit, made)
    again = limit_between(part, scene.with_all(rest), limit.variable, limit.holds, limit.fails)
    return None if again is None else with_made(again, rest)


def _wanted_limits(asked: _Question, scene: Scene) -> Iterator[str]:
    """The limits that a question should have, in words."""
    atom = asked.atom
    if asked.part.role == ENERGY:
        yield from () if scene.invocation.policy.policy.vehicle.battery == -1 else (_CHARGE,)
        return
    if isinstance(atom, tree.AtMost | tree.Equal):
        yield from (_number(term, scene) for term in atom.terms if term.factor)
    yield from in_space(asked.question, scene)
    yield from in_time(asked.question, scene)


def _number(term: tree.LinearTerm | SceneVariable, scene: Scene) -> str:
    """What a comparison reads, by its name."""
    policy, contract = scene.invocation.policy.policy, scene.invocation.invocation.contract
    cells = {each.cell: each.name for each in contract.parameters}
    slots = {each.slot: each.name for each in policy.signals}
    return f"`{(cells if term.argument else slots).get(-1 if term.at is None else term.at, 'a number')}`"


def _limits_here(asked: _Question, scene: Scene, *, hidden: bool) -> Iterator[tuple[str, ClauseLimit]]:
    """The limits of a question in one situation, each with the words for it; `hidden` ones are in no other."""
    atom, part, question = asked.atom, asked.part, asked.question
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
    """One member for which a part holds, and one for which it does not."""
    variable = SceneVariable(atom.argument, atom.at)
    members = [each for each in always_tested(variable, scene.invocation) if isinstance(each, int)]
    present = scene.value(variable)
    for value in members:
        limit = None if present is None else limit_between(part, scene, variable, present, value)
        if limit is not None:
            yield _number(variable, scene), limit
            return


def _charge(part: PolicyPart, scene: Scene) -> Iterator[ClauseLimit]:
    """The charge that is needed from where the vehicle is."""
    invocation, slot = scene.invocation, scene.invocation.policy.policy.vehicle.battery
    slots, known = scene.environment().slots, invocation.policy.tables.known
    volume = invocation.planner.volume(slots, known)
    needed = invocation.energy.needed(volume.farthest[1], volume.height[:2], drains(slots[known.drain])[1])
    found = None if slot == -1 else limit_between(part, scene, SceneVariable(False, slot), needed - 1, needed)
    if found is not None:
        yield found
