"""Whether a step can be permitted at all: what only the state of the vehicle decides is taken to go the step's way.

Arguments, the time and the phase are known, or known to be in a set; a permit that no state makes true does not permit,
a forbid that every state makes true forbids. That a zone exists on dates is known where the time of issue is; where it
is not, that too is taken to go the step's way.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from rtshcua.decision import tree
from rtshcua.decision.prepare import PreparedInvocation, PreparedRule
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN, Span
from rtshcua.decision.zones import NO_BOX
from rtshcua.ground.analysis.solve import Goal, Yes, satisfiable
from rtshcua.ground.analysis.space import Space
from rtshcua.ground.analysis.witness import Witness
from rtshcua.ground.compiler.proofs.best import ALWAYS, NEVER, hopeful
from rtshcua.ground.compiler.proofs.situation import Ground
from rtshcua.ground.compiler.zones import EVERYWHERE
from rtshcua.model.flat.policy import Rule
from rtshcua.model.flat.zone import Zone


def refused(
    ground: Ground,
    invocation: PreparedInvocation,
    space: Space,
    given: tuple[Goal, ...] = (),
    *,
    dated: bool | None = None,
) -> Iterator[tuple[Witness, Rule | None]]:
    """Situations of a space in which a step is surely refused: by a forbid, or (None) for want of a permit.

    At most one of each, and time between two dates. `given` must hold in them. `dated`: the time of issue is known, and
    zones exist on their dates; it is not (False), and the arguments are those of the invocation.
    """
    for span in _between_dates(ground, space.utc) if dated else (None,):
        moments = space if span is None else space._replace(utc=(span,))
        candidates = invocation.candidates
        at = None if dated is None else Dates(span, () if dated else invocation.invocation.arguments)
        permits = [_hoped(ground, permit, True, at) for permit in candidates.permits]
        if None not in permits:
            wanting: list[Goal] = [(node, FALSE | UNKNOWN) for node in permits if node is not None]
            answer = satisfiable([*given, *wanting], moments)
            if isinstance(answer, Yes):
                yield answer.witness, None
        for forbid in candidates.forbids:
            node = _hoped(ground, forbid, False, at)
            answer = satisfiable([*given, (ALWAYS if node is None else node, TRUE)], moments)
            if isinstance(answer, Yes):
                yield answer.witness, forbid.rule


class Dates(NamedTuple):
    """A time in which no zone begins or ceases to exist on a date; without it the arguments of a step, for which the
    dates go its way.
    """

    span: Span | None
    arguments: tuple[int, ...]


def _between_dates(ground: Ground, utc: tuple[Span, ...]) -> Iterator[Span]:
    """The moments in pieces, in each of which no zone begins or ceases to exist on a date."""
    edges = {edge for zone in ground.prepared.policy.zones if zone.dates for edge in (zone.dates[0], zone.dates[1] + 1)}
    for low, high in utc:
        for start, end in pairwise([low, *sorted(edge for edge in edges if low < edge <= high), high + 1]):
            yield start, end - 1


def _hoped(ground: Ground, rule: PreparedRule, hope: bool, dates: Dates | None) -> tree.Node | None:
    key = (rule.number, hope, dates)
    if key not in ground.hopes:
        node = ground.prepared.compiler.when(rule.rule)
        if node is not None and dates is not None:
            node = _on_dates(ground, node, hope, dates)
        ground.hopes[key] = None if node is None else hopeful(node, hope)
    return ground.hopes[key]


def _on_dates(ground: Ground, node: tree.Node, hope: bool, dates: Dates) -> tree.Node:
    """A condition in which what dates decide is decided.

    What says that a zone exists, of a zone that is an argument, is to be in a place that is everywhere on those dates.
    """
    policy = ground.prepared.policy
    match node:
        case tree.Both(left, right):
            return tree.Both(_on_dates(ground, left, hope, dates), _on_dates(ground, right, hope, dates))
        case tree.Either(left, right):
            return tree.Either(_on_dates(ground, left, hope, dates), _on_dates(ground, right, hope, dates))
        case tree.Not(operand):
            return tree.Not(_on_dates(ground, operand, not hope, dates))
        case tree.Inside(number) if dates.span is not None and _only_dates(policy.zones[number]):
            zone = policy.zones[number]
            return ALWAYS if zone.dates[0] <= dates.span[0] <= zone.dates[1] else NEVER
        case tree.PointInside(cell, number) if dates.span is None and policy.zones[number].dates:
            place = dates.arguments[cell : cell + 2]
            inside = ground.prepared.tables.zones[number].along(place, NO_BOX) == TRUE
            return ALWAYS if inside and hope else NEVER
        case _:
            return node


def _only_dates(zone: Zone) -> bool:
    return bool(zone.dates) and (zone.shape, zone.data) == (EVERYWHERE.shape, EVERYWHERE.data)
