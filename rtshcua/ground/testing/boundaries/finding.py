"""All limits of what bears on one invocation, and those of them for which no situation was found.

Each comparison, zone and window of a condition should turn it somewhere. From the scene as it is, then from others in
which that part of the condition decides (`pivot`), each is looked for until what is decided turns too.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from typing import NamedTuple

from rtshcua.decision import tree
from rtshcua.decision.contracts import drains
from rtshcua.ground.analysis.space import Space
from rtshcua.ground.testing.boundaries.limits import Limit, shows, tried, turns, with_made
from rtshcua.ground.testing.boundaries.moments import in_time, moments
from rtshcua.ground.testing.boundaries.parts import Part, airspace_tree, questions
from rtshcua.ground.testing.boundaries.pivot import pivots
from rtshcua.ground.testing.boundaries.places import along_the_ground, in_height, in_space, zones_of
from rtshcua.ground.testing.boundaries.scene import Made, Scene, Variable
from rtshcua.ground.testing.boundaries.values import always
from rtshcua.ground.testing.coverage.universe import ENERGY

#: what has no limit, only sides: all of them are asked for in the scene as it is (`blocks`)
_WHOLE = (tree.Member, tree.Known, tree.Monitored, tree.InPhase)
#: the limit of what a skill needs, in words
_CHARGE = "the charge that is needed"


class Missed(NamedTuple):
    """A limit of a part, in words, on which nothing that is decided was seen to turn; `turned` says that the part was
    true and false on its sides.
    """

    part: Part
    about: str
    turned: bool = False


class Search(NamedTuple):
    """What was found of some parts, and what was not."""

    limits: tuple[Limit, ...]
    missed: tuple[Missed, ...]


class _Field(NamedTuple):
    """Where limits are looked for: all parts that bear on the invocation, the scene, what may be, what can be asked."""

    parts: Sequence[Part]
    scene: Scene
    space: Space
    fits: Callable[[Limit], bool]


class _Asked(NamedTuple):
    """A question of a part, its atom (of the charge there is none), and the part with the tree that the atom is of."""

    part: Part
    question: Part
    atom: tree.Atom | None
    whole: Part


def limits(parts: Sequence[Part], scene: Scene, space: Space) -> Iterator[Limit]:
    """The limits of all parts, as the scene has everything else; each part in its order."""
    yield from search(parts, parts, scene, space).limits


def search(
    chosen: Sequence[Part],
    parts: Sequence[Part],
    scene: Scene,
    space: Space,
    fits: Callable[[Limit], bool] = lambda _: True,
) -> Search:
    """The limits of the chosen ones of all parts that bear on an invocation; `fits` says whether one can be asked."""
    field = _Field(parts, scene, space, fits)
    found: list[Limit] = []
    missed: list[Missed] = []
    for part in chosen:
        for asked in _asked(part, scene):
            turned, left = _sides(asked, field)
            found += turned
            missed += left
    return Search(tuple(dict.fromkeys(found)), tuple(dict.fromkeys(missed)))


def _asked(part: Part, scene: Scene) -> Iterator[_Asked]:
    if part.airspace is None:
        for atom, question in questions(part, scene.invocation):
            yield _Asked(part, question, atom, part)
        return
    whole, zones = airspace_tree(part)
    for zone, (_, question) in zip(zones, questions(part, scene.invocation), strict=True):
        yield _Asked(part, question, zone, whole)


def _sides(asked: _Asked, field: _Field) -> tuple[list[Limit], list[Missed]]:
    """The limits of one question, looked for in one situation after the other as long as some are missing."""
    wanted = dict.fromkeys(_wanted(asked, field.scene), False)  # whether it was seen to turn the part
    shown: set[str] = set()
    found: list[Limit] = []
    reached = False
    for made in _situations(asked, field):
        reached = reached or not made or not isinstance(asked.atom, _WHOLE)
        done = frozenset(shown)
        for words, limit in _turned(asked, field.scene.with_all(made), hidden=bool(made)):
            known = _without(made, limit, asked.part, field.scene)
            if known is None or words in done or not field.fits(known):
                continue
            found.append(known)
            reached = True
            if words in wanted:
                wanted[words] = True
            if shows(known, field.scene):
                shown.add(words)
        if reached and shown >= wanted.keys():
            break
    if not reached:
        return found, [Missed(asked.part, f"where {_told(asked, field.scene)} decides")]
    return found, [Missed(asked.part, words, turned) for words, turned in wanted.items() if words not in shown]


def _situations(asked: _Asked, field: _Field) -> Iterator[Made]:
    """What is changed to look for limits, each once."""
    alone = asked.atom is None or asked.part.airspace is not None
    tries = iter(()) if asked.atom is None else pivots(asked.whole, asked.atom, field.parts, field.scene, field.space)
    seen: list[Made] = []
    for made in chain(({},) if alone else (), tries):
        if made not in seen:
            seen.append(made)
            yield made


def _told(asked: _Asked, scene: Scene) -> str:
    """A question that nothing was found for, in words."""
    match asked.atom:
        case tree.AtMost(terms, _) | tree.Equal(terms, _):
            return " and ".join(_number(term, scene) for term in terms) or "a number"
        case tree.Member(argument, at, _):
            return _number(Variable(argument, at), scene)
        case tree.Known(at):
            return _number(Variable(False, at), scene)
        case tree.Monitored():
            return "the condition over time"
        case tree.InPhase():
            return "the phase"
        case tree.InWindow() | tree.InWeek():
            return "the time"
        case _:
            return " and ".join(f"`{zone.name}`" for zone in zones_of(asked.question, scene.invocation)) or "the charge"


def _without(made: Made, limit: Limit, part: Part, scene: Scene) -> Limit | None:
    """The limit in what is changed besides what turns; None where it no longer turns without that."""
    rest = {variable: value for variable, value in made.items() if variable != limit.variable}
    if rest == made:
        return with_made(limit, made)
    again = tried(part, scene.with_all(rest), limit.variable, limit.holds, limit.fails)
    return None if again is None else with_made(again, rest)


def _wanted(asked: _Asked, scene: Scene) -> Iterator[str]:
    """The limits that a question should have, in words."""
    atom = asked.atom
    if asked.part.role == ENERGY:
        yield from () if scene.invocation.policy.policy.vehicle.battery == -1 else (_CHARGE,)
        return
    if isinstance(atom, tree.AtMost | tree.Equal):
        yield from (_number(term, scene) for term in atom.terms if term.factor)
    yield from in_space(asked.question, scene)
    yield from in_time(asked.question, scene)


def _number(term: tree.Term | Variable, scene: Scene) -> str:
    """What a comparison reads, by its name."""
    policy, contract = scene.invocation.policy.policy, scene.invocation.invocation.contract
    cells = {each.cell: each.name for each in contract.parameters}
    slots = {each.slot: each.name for each in policy.signals}
    return f"`{(cells if term.argument else slots).get(-1 if term.at is None else term.at, 'a number')}`"


def _turned(asked: _Asked, scene: Scene, *, hidden: bool) -> Iterator[tuple[str, Limit]]:
    """The limits of a question in one situation, each with the words for it; `hidden` ones are in no other."""
    atom, part, question = asked.atom, asked.part, asked.question
    if part.role == ENERGY:
        yield from ((_CHARGE, each) for each in _charge(part, scene))
        return
    if atom is not None:
        at = scene.environment()
        for variable, one, other in turns(atom, at, scene.invocation.policy.tables):
            found = tried(part, scene, variable, one, other)
            if found is not None:
                yield _number(variable, scene), found
    if hidden and isinstance(atom, tree.Member):
        yield from _members(atom, part, scene)
    yield from along_the_ground(question, part, scene)
    yield from in_height(question, part, scene)
    yield from moments(question, part, scene)


def _members(atom: tree.Member, part: Part, scene: Scene) -> Iterator[tuple[str, Limit]]:
    """One member for which a part holds, and one for which it does not."""
    variable = Variable(atom.argument, atom.at)
    members = [each for each in always(variable, scene.invocation) if isinstance(each, int)]
    present = scene.value(variable)
    for value in members:
        limit = None if present is None else tried(part, scene, variable, present, value)
        if limit is not None:
            yield _number(variable, scene), limit
            return


def _charge(part: Part, scene: Scene) -> Iterator[Limit]:
    """The charge that is needed from where the vehicle is."""
    invocation, slot = scene.invocation, scene.invocation.policy.policy.vehicle.battery
    slots, known = scene.environment().slots, invocation.policy.tables.known
    volume = invocation.planner.volume(slots, known)
    needed = invocation.energy.needed(volume.farthest[1], volume.height[:2], drains(slots[known.drain])[1])
    found = None if slot == -1 else tried(part, scene, Variable(False, slot), needed - 1, needed)
    if found is not None:
        yield found
