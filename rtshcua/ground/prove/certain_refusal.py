"""Decide whether a step is refused in every state of the vehicle.

Arguments, time and phase are known, or known to be in a set. Each part of a condition that depends only on the state is
assumed to favour the step,
and so is each part that depends on an unknown time (`TimeKnowledge`). A permit that no state
makes true does not permit, a forbid that every state makes true forbids, and a degrade that every state makes true
replaces the step.
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
    """What is known of the time: everything, so that zones exist on their dates; only the time of day; nothing."""

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
    """Yield situations in which a step is certainly refused, with the forbid or degrade, or None if no permit holds.

    There is at most one situation for each rule and each interval between two dates. The goals `given` hold in each.
    If the time is not fully known, the places in the space must be those of the invocation.
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
    """Return the rules that refuse a step if they hold: the forbids, and the degrades to another skill."""
    candidates = invocation.candidates
    return (*(each.rule for each in candidates.forbids), *(each.rule for each in candidates.degrades))


def deciding_rules(invocation: PreparedInvocation) -> tuple[Rule, ...]:
    """Return the permits of a step, and the rules that refuse it if they hold."""
    return (*(each.rule for each in invocation.candidates.permits), *refusing_rules(invocation))


class _Moment(NamedTuple):
    """The knowledge of the time with which a condition is simplified.

    `span` is an interval in which no zone begins or ceases to exist on a date. It is None if the time is not fully
    known; `arguments` are then those of the step that an unknown time is assumed to favour.
    """

    known: TimeKnowledge
    span: Span | None
    arguments: tuple[int, ...]

    def leaves_open(self, zone: Zone) -> bool:
        """Whether it is unknown if a zone exists."""
        return self.span is None and bool(
            zone.dates or ((zone.daily or zone.weekly) and self.known is TimeKnowledge.NOTHING)
        )


def _between_dates(proof: ProofContext, utc: tuple[Span, ...]) -> Iterator[Span]:
    """Split times into intervals in which no zone begins or ceases to exist on a date."""
    edges = {edge for zone in proof.policy.zones if zone.dates for edge in (zone.dates[0], zone.dates[1] + 1)}
    for low, high in utc:
        for start, end in pairwise([low, *sorted(edge for edge in edges if low < edge <= high), high + 1]):
            yield start, end - 1


def _optimistic_condition(proof: ProofContext, rule: Rule, hope: bool, time: _Moment) -> tree.Node | None:
    """Return a rule's condition with the parts about the time resolved as far as possible in favour of `hope`.

    Parts that depend on dates get their value. Parts that depend on an unknown time get the value `hope`, except that a
    known place outside a zone stays outside whenever the zone exists. The existence of a zone argument is encoded as
    being inside a zone that is everywhere on its dates.
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
