"""Whether a step is refused in every state of the vehicle: what only the state decides is taken to go the step's way.

Arguments, the time and the phase are known, or known to be in a set. A permit that no state makes true does not permit,
a forbid that every state makes true forbids, and a degrade that every state makes true flies in the step's place. What
is not known of the time (`TimeKnowledge`) is taken to go the step's way too.
"""

from collections.abc import Iterator
from enum import Enum
from itertools import pairwise
from typing import NamedTuple

from rtshcua.decision import tree
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN, Span
from rtshcua.decision.zones import NO_BOX
from rtshcua.ground.analysis.condition_trees import ALWAYS, NEVER, replace_atoms
from rtshcua.ground.analysis.solve import Goal, Yes, satisfiable
from rtshcua.ground.analysis.space import SituationSpace
from rtshcua.ground.analysis.witness import Witness
from rtshcua.ground.lower.zones import EVERYWHERE
from rtshcua.ground.prove.proof_context import ProofContext, optimistic
from rtshcua.model.flat.policy import Rule
from rtshcua.model.flat.zone import Zone


class TimeKnowledge(Enum):
    """What is known of the time: all of it, so zones exist on their dates; the time of day, and no date; nothing."""

    ALL = "all"
    DAYTIME = "daytime"
    NOTHING = "nothing"


def certain_refusals(
    proof: ProofContext,
    invocation: PreparedInvocation,
    space: SituationSpace,
    known: TimeKnowledge,
    given: tuple[Goal, ...] = (),
) -> Iterator[tuple[Witness, Rule | None]]:
    """Situations of a space in which a step is surely refused: by a forbid or degrade, or (None) for want of a permit.

    At most one of each, and time between two dates. `given` must hold in them. Where not all of the time is known, the
    places in the space are those of the invocation.
    """
    candidates = invocation.candidates
    for span in _between_dates(proof, space.utc) if known is TimeKnowledge.ALL else (None,):
        moments = space if span is None else space._replace(utc=(span,))
        time = _Moment(known, span, () if span else invocation.invocation.arguments)
        permits = [_optimistic_condition(proof, permit.rule, True, time) for permit in candidates.permits]
        if None not in permits:
            wanting: list[Goal] = [(node, FALSE | UNKNOWN) for node in permits if node is not None]
            answer = satisfiable([*given, *wanting], moments)
            if isinstance(answer, Yes):
                yield answer.witness, None
        for rule in refusing_rules(invocation):
            node = _optimistic_condition(proof, rule, False, time)
            answer = satisfiable([*given, (ALWAYS if node is None else node, TRUE)], moments)
            if isinstance(answer, Yes):
                yield answer.witness, rule


def refusing_rules(invocation: PreparedInvocation) -> tuple[Rule, ...]:
    """The rules that refuse a step where they hold: the forbids, and the degrades that fly something else."""
    candidates = invocation.candidates
    return (*(each.rule for each in candidates.forbids), *(each.rule for each in candidates.degrades))


def deciding_rules(invocation: PreparedInvocation) -> tuple[Rule, ...]:
    """The permits of a step, and the rules that refuse it where they hold."""
    return (*(each.rule for each in invocation.candidates.permits), *refusing_rules(invocation))


class _Moment(NamedTuple):
    """A time in which no zone begins or ceases to exist on a date, where all is known of it; else the arguments of a
    step, for which what is not known goes its way.
    """

    known: TimeKnowledge
    span: Span | None
    arguments: tuple[int, ...]

    def leaves_open(self, zone: Zone) -> bool:
        """Whether a zone may exist, or not, for all that is known."""
        return self.span is None and bool(
            zone.dates or ((zone.daily or zone.weekly) and self.known is TimeKnowledge.NOTHING)
        )


def _between_dates(proof: ProofContext, utc: tuple[Span, ...]) -> Iterator[Span]:
    """The moments in pieces, in each of which no zone begins or ceases to exist on a date."""
    edges = {edge for zone in proof.policy.zones if zone.dates for edge in (zone.dates[0], zone.dates[1] + 1)}
    for low, high in utc:
        for start, end in pairwise([low, *sorted(edge for edge in edges if low < edge <= high), high + 1]):
            yield start, end - 1


def _optimistic_condition(proof: ProofContext, rule: Rule, hope: bool, time: _Moment) -> tree.Node | None:
    """A rule's condition in the best case: what dates decide is decided, and what is not known of the time is what
    brings it nearest to `hope`; a place that is given is inside a zone, or not, while that exists.

    What says that a zone exists, of a zone that is an argument, is to be in a place that is everywhere on those dates.
    """
    key = (() if rule.when is None else rule.when.code, hope, time)
    if key in proof.hopes:
        return proof.hopes[key]
    zones = proof.policy.zones

    def best(atom: tree.Atom, hope: bool) -> tree.Node:
        holds = hope
        match atom:
            case tree.InWindow() | tree.InWeek() if time.known is TimeKnowledge.NOTHING:
                pass
            case tree.InsideZone(number) if time.span is not None and _only_dates(zones[number]):
                first, last = zones[number].dates
                holds = first <= time.span[0] <= last
            case tree.PointInside(cell, number) if time.leaves_open(zones[number]):
                place = time.arguments[cell : cell + 2]
                holds = hope and proof.prepared.tables.zones[number].along(place, NO_BOX) == TRUE
            case _:
                return atom
        return ALWAYS if holds else NEVER

    node = proof.prepared.compiler.when(rule)
    proof.hopes[key] = None if node is None else optimistic(replace_atoms(node, best, hope), hope)
    return proof.hopes[key]


def _only_dates(zone: Zone) -> bool:
    return bool(zone.dates) and (zone.shape, zone.data) == (EVERYWHERE.shape, EVERYWHERE.data)
