"""Contradictory contracts and airspaces (E1101), and clauses that cannot fail (E1102).

The clauses that a skill requires, assumes and maintains must be able to hold together when a step begins, and together
with the airspace. This is proved for each skill over the ranges of its arguments, and for each step of a mission with
its own arguments. The airspace does not count for a skill that no permit names: it need not fly under this policy. The
zones of an airspace must leave a place for the vehicle.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import NamedTuple

from rtshcua.decision import tree
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.analysis.condition_trees import minimal_conflict
from rtshcua.ground.analysis.solve import Goal, No, Undecided, Yes, satisfiable
from rtshcua.ground.analysis.space import SituationSpace
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.step_times import MissionStep
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.policy import RuleKind

_AIRSPACE = "this is the airspace"


class Conjunct(NamedTuple):
    """A condition that must hold: its label, where it is written, and its tree; of a clause also the code."""

    label: str
    span: Span
    node: tree.Node
    code: tuple[int, ...] = ()


def prove_contracts(proof: ProofContext) -> None:
    """Report every skill whose clauses contradict each other, and every clause that cannot fail."""
    permitted = {skill for rule in proof.policy.rules if rule.kind == RuleKind.PERMIT for skill in rule.skills}
    _nowhere(proof)
    for number, contract in enumerate(proof.policy.contracts):
        parts = list(_clauses(proof, contract))
        _vacuous(proof, number, contract, parts)
        name = proof.skills[contract.name].name.span
        parts = [*(_airspace(proof) if number in permitted else ()), *parts]
        conflict = _conflict(proof, parts, proof.questions.space(number), ("skill", number), name)
        if conflict:
            proof.impossible.add(number)
            alone = f"this condition of `{contract.name}` can never hold"
            several = f"these conditions of `{contract.name}` can never hold together"
            *others, main = conflict
            _report(proof, main.span, several if others else alone, others, [(name, "the skill")])


def _nowhere(proof: ProofContext) -> None:
    """Report an airspace that is empty at all times."""
    declared, space = proof.lowered.declaration.airspace, proof.questions.space(0)
    if declared is None:
        return
    parts: list[Conjunct] = []
    for side, names in (("inside", declared.inside), ("outside", declared.outside)):
        for name in names:
            smaller = side == "inside"
            inside = tree.InsideZone(proof.lowered.zones.zone(name.text, 0, smaller=smaller, span=name.span))
            parts.append(Conjunct(side, name.span, inside if smaller else tree.Negation(inside)))
    if not isinstance(proof.questions.ask(("airspace",), partial(_goals, parts), space), No):
        return
    proof.report.add(
        codes.CONTRADICTION,
        declared.span,
        "the airspace is empty: no place satisfies all of its zones",
        help="the airspace lies inside every zone after `inside` and outside every zone after `outside`: remove one of "
        "the marked zones, or use their union",
        labels=[(part.span, f"the vehicle must be {part.label} this zone") for part in _minimal(parts, space)],
    )


def prove_step_contract(proof: ProofContext, step: MissionStep) -> None:
    """Report a step whose contract contradicts itself or the airspace with the arguments of the step."""
    flat = step.flat
    if isinstance(proof.questions.known(("skill", flat.skill)), No):
        return  # already reported for the skill
    parts = list(_clauses(proof, flat.contract))
    key = ("step", flat.skill, step.prepared.arguments, tuple(part.code for part in parts))
    if isinstance(proof.questions.known(key), Yes):
        return
    if step.overrides is not None:
        known = {part.span for part in _clauses(proof, proof.policy.contracts[flat.skill])}
        _vacuous(proof, flat.skill, flat.contract, [part for part in parts if part.span not in known])
    space = proof.questions.space(flat.skill)._replace(arguments=step.prepared.arguments)
    conflict = _conflict(proof, [*parts, *_airspace(proof)], space, key, step.span)
    if conflict:
        reason = "a condition cannot hold" if len(conflict) == 1 else "its conditions cannot hold together"
        message = f"`{flat.contract.name}` can never begin with these arguments: {reason}"
        _report(proof, step.span, message, conflict, [])


def _clauses(proof: ProofContext, contract: Contract) -> Iterator[Conjunct]:
    for label, clauses in (
        ("this is required", contract.require),
        ("this is assumed", contract.assume),
        ("this is maintained", contract.maintain),
    ):
        for clause in clauses:
            yield Conjunct(label, proof.span(clause), proof.prepared.compiler.node(clause, contract), clause.code)


def _airspace(proof: ProofContext) -> Iterator[Conjunct]:
    airspace = proof.policy.airspace
    if airspace is None:
        return
    for zone in airspace.inside:
        yield Conjunct(_AIRSPACE, proof.span(airspace), tree.InsideZone(zone))
    for zone in airspace.outside:
        yield Conjunct(_AIRSPACE, proof.span(airspace), tree.Negation(tree.InsideZone(zone)))


def _conflict(
    proof: ProofContext, parts: Sequence[Conjunct], space: SituationSpace, key: tuple[object, ...], span: Span
) -> list[Conjunct]:
    """Return a minimal set of conditions that cannot hold together; empty if all can. Reports an undecided question."""
    answer = proof.questions.ask(key, partial(_goals, parts), space)
    if isinstance(answer, Undecided):
        message = "the proof could not decide whether these conditions can hold together"
        proof.report.add(codes.UNDECIDED, span, message, help=answer.why)
    found = _minimal(parts, space) if isinstance(answer, No) else []
    # an empty airspace is reported once, not for each skill
    return [] if all(part.label == _AIRSPACE for part in found) else found


def _goals(parts: Sequence[Conjunct]) -> list[Goal]:
    return [(part.node, TRUE) for part in parts]


def _minimal(parts: Sequence[Conjunct], space: SituationSpace) -> list[Conjunct]:
    return minimal_conflict(parts, lambda some: isinstance(satisfiable(_goals(some), space), No))


def _report(
    proof: ProofContext, span: Span, message: str, conflict: Sequence[Conjunct], labels: list[tuple[Span, str]]
) -> None:
    proof.report.add(
        codes.CONTRADICTION,
        span,
        message,
        help="change one of the conditions, so that a state of the vehicle satisfies all of them",
        labels=dict.fromkeys([*((part.span, part.label) for part in conflict), *labels]),
    )


def _vacuous(proof: ProofContext, skill: int, contract: Contract, parts: Sequence[Conjunct]) -> None:
    space = proof.questions.space(skill)
    for part in parts:
        goal = (part.node, FALSE | UNKNOWN)
        if isinstance(proof.questions.ask(("fails", skill, part.code), partial(list, (goal,)), space), No):
            proof.report.add(
                codes.ALWAYS_HOLDS,
                part.span,
                f"this condition cannot fail for any arguments of `{contract.name}`",
                help="remove it, or correct it",
            )
