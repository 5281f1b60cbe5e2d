"""E1101, E1102: what a skill requires, assumes and maintains cannot all hold at once; nor all zones of an airspace; a
clause that cannot fail.

Of each skill for all arguments that it may be given, and of each step of a mission with the arguments that it has. The
airspace counts too, but not for a skill that no permit names: it need not be one that flies there. The clauses and the
airspace hold together at the moment at which a step begins.
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
    """Something that must hold: in words, where it is written, its condition; of a clause, what that comes from."""

    words: str
    span: Span
    node: tree.Node
    code: tuple[int, ...] = ()


def prove_contracts(proof: ProofContext) -> None:
    """Report every skill whose clauses contradict each other, and every clause of one that cannot fail."""
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
            alone = f"this part of `{contract.name}` can never hold"
            several = f"these parts of `{contract.name}` never hold together"
            *others, main = conflict
            _report(proof, main.span, several if others else alone, others, [(name, "the skill")])


def _nowhere(proof: ProofContext) -> None:
    """Report an airspace in which a vehicle can be nowhere, at no time."""
    declared, space = proof.lowered.declaration.airspace, proof.questions.space(0)
    if declared is None:
        return
    parts: list[Conjunct] = []
    for words, names in (("inside", declared.inside), ("outside", declared.outside)):
        for name in names:
            smaller = words == "inside"
            inside = tree.InsideZone(proof.lowered.zones.zone(name.text, 0, smaller=smaller, span=name.span))
            parts.append(Conjunct(words, name.span, inside if smaller else tree.Negation(inside)))
    if not isinstance(proof.questions.ask(("airspace",), partial(_goals, parts), space), No):
        return
    proof.report.add(
        codes.CONTRADICTION,
        declared.span,
        "nothing is left of the airspace: the vehicle can be nowhere in it",
        help="it is inside of all zones after `inside`, and outside of all after `outside`: leave one out of those "
        "marked, or take their union",
        labels=[(part.span, f"it must be {part.words} of this") for part in _minimal(parts, space)],
    )


def prove_step_contract(proof: ProofContext, step: MissionStep) -> None:
    """Report a step whose contract contradicts itself, or the airspace, with the arguments that it has."""
    flat = step.flat
    if isinstance(proof.questions.known(("skill", flat.skill)), No):
        return  # said of the skill
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
        message = "this cannot hold" if len(conflict) == 1 else "this never holds together"
        _report(
            proof, step.span, f"`{flat.contract.name}` can never begin with these arguments: {message}", conflict, []
        )


def _clauses(proof: ProofContext, contract: Contract) -> Iterator[Conjunct]:
    for words, clauses in (
        ("this is required", contract.require),
        ("this is assumed", contract.assume),
        ("this is maintained", contract.maintain),
    ):
        for clause in clauses:
            yield Conjunct(words, proof.span(clause), proof.prepared.compiler.node(clause, contract), clause.code)


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
    """Conjuncts that cannot hold together; none where all can, or where that is undecided, which is reported."""
    answer = proof.questions.ask(key, partial(_goals, parts), space)
    if isinstance(answer, Undecided):
        proof.report.add(
            codes.UNDECIDED, span, "it could not be decided whether its conditions can hold together", help=answer.why
        )
    found = _minimal(parts, space) if isinstance(answer, No) else []
    # the airspace alone is empty: no fault of what flies in it
    return [] if all(part.words == _AIRSPACE for part in found) else found


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
        help="no state of the vehicle meets it; change one of the conditions",
        labels=dict.fromkeys([*((part.span, part.words) for part in conflict), *labels]),
    )


def _vacuous(proof: ProofContext, skill: int, contract: Contract, parts: Sequence[Conjunct]) -> None:
    space = proof.questions.space(skill)
    for part in parts:
        goal = (part.node, FALSE | UNKNOWN)
        if isinstance(proof.questions.ask(("fails", skill, part.code), partial(list, (goal,)), space), No):
            proof.report.add(
                codes.ALWAYS_HOLDS,
                part.span,
                f"this cannot fail for any arguments that `{contract.name}` may be given",
                help="leave it out, or say what was meant",
            )
