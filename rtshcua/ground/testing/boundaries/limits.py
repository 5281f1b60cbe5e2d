"""Where a condition turns, along one number: two integers next to each other, at one of which it is true.

The comparison is read off the condition's own tree, what else it sums up being as it is, and the value where it turns
is asked of `decision.nearest`, which finds the nearest values that pass for whoever was refused. Each limit is tried
before it is believed.
"""

from collections.abc import Iterator
from typing import NamedTuple

from rtshcua.decision import tree
from rtshcua.decision.decide import decide
from rtshcua.decision.evaluate import Environment, Tables, build, total
from rtshcua.decision.nearest import Changes, nearest_in
from rtshcua.decision.temporal import lasting
from rtshcua.decision.values import FALSE, TRUE
from rtshcua.ground.testing.boundaries.parts import Part, truth
from rtshcua.ground.testing.boundaries.scene import Made, Scene, Value, Variable
from rtshcua.model.outcome import Outcome, Reason


class Limit(NamedTuple):
    """A part is true where a variable is `holds`, and false where it is `fails`, which is as near as can be written;
    `made` are the other values that are changed so that this part turns on it.
    """

    part: Part
    variable: Variable
    holds: Value
    fails: Value
    made: tuple[tuple[Variable, Value], ...] = ()


def turns(atom: tree.Atom, at: Environment, tables: Tables) -> Iterator[tuple[Variable, int, int]]:
    """Where a comparison turns: a variable, and two values of it that are next to each other."""
    if not isinstance(atom, tree.AtMost | tree.Equal):
        return
    for term in atom.terms:
        if not term.factor:
            continue
        low, high, gap = total(tuple(other for other in atom.terms if other is not term), at)
        if gap or low != high:
            continue
        variable = Variable(term.argument, term.at)
        if isinstance(atom, tree.Equal):
            value, rest = divmod(atom.value - low, term.factor)
            if not rest:
                yield variable, value - 1, value
                yield variable, value, value + 1
            continue
        alone = tree.AtMost((term,), atom.bound - low)
        present = build(alone, tables)(at)
        for change in Changes(at, tables).find(alone, present != TRUE) or ():
            turned = nearest_in(change, (at.arguments if term.argument else at.slots)[term.at])
            yield variable, turned, turned - 1 if turned == change.low else turned + 1


def tried(part: Part, scene: Scene, variable: Variable, one: Value, other: Value) -> Limit | None:
    """The limit between two values, if the part is true at one and false at the other."""
    found = {truth(part, scene.put(variable, value)): value for value in (one, other)}
    return Limit(part, variable, found[TRUE], found[FALSE]) if found.keys() == {TRUE, FALSE} else None


def shows(limit: Limit, scene: Scene) -> bool:
    """Whether what is decided is otherwise on the two sides of a limit, in the scene that it is changed from."""
    here = scene.with_all(dict(limit.made))
    return _decided(here.put(limit.variable, limit.holds)) != _decided(here.put(limit.variable, limit.fails))


def _decided(scene: Scene) -> tuple[Outcome, Reason, int | None]:
    """What a test can expect, as if it had been so for long."""
    policy = scene.invocation.policy
    state = lasting(scene.state, policy, scene.now)
    found = decide(scene.invocation, state, policy, scene.context, scene.now)
    return found.outcome, found.reason, None if found.target is None else found.target.skill


def with_made(limit: Limit, made: Made) -> Limit:
    """The limit in a scene that was changed so."""
    return limit._replace(made=tuple(sorted(made.items(), key=lambda one: (one[0].argument, one[0].at or -1))))
