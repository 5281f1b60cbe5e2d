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
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.analysis.solve import Goal, No, Undecided, Yes, satisfiable
from rtshcua.ground.analysis.space import SituationSpace
from rtshcua.ground.prove.conjuncts import minimal_conflict
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.policy import RuleKind
from rtshcua.model.ir.missions import Step


class Conjunct(NamedTuple):
    """Something that must hold: what it is, where it is written, its condition; of a clause, what that comes from."""

    words: str
    span: Span
    node: tree.Node
    code: tuple[int, ...] = ()


def prove_contracts(proof: ProofContext) -> None:
    """Report every skill whose clauses contradict each other, and every clause of one that cannot fail."""
    permitted = {skill for rule in proof.policy.rules if rule.kind == RuleKind.PERMIT for skill in rule.skills}
    _nowhere(proof)
    for number, contract in enumerate(proof.policy.contracts):
        space = proof.questions.space(number)
        parts = list(_clauses(proof, contract))
        _vacuous(proof, number, contract, parts)
        name = proof.context.symbols.skills[contract.name].name.span
        together = (
            f"this part of `{contract.name}` can never hold",
            f"these parts of `{contract.name}` never hold together",
        )
        airspace = list(_airspace(proof)) if number in permitted else []
        before = len(proof.report.found)
        _together(proof, [*airspace, *parts], space, ("skill", number), together, [(name, "the skill")], name)
        if any(found.code is codes.CONTRADICTION for found in proof.report.found[before:]):
            proof.impossible.add(number)


def _nowhere(proof: ProofContext) -> None:
    """Report an airspace in which a vehicle can be nowhere, at no time."""
    declared, space = proof.lowered.declaration.airspace, proof.questions.space(0)
    if declared is None:
        return
    zones = proof.lowered.zones
    inside = [
        (name, tree.InsideZone(zones.zone(name.text, 0, smaller=True, span=name.span))) for name in declared.inside
    ]
    outside = [
        (name, tree.Negation(tree.InsideZone(zones.zone(name.text, 0, smaller=False, span=name.span))))
        for name in declared.outside
    ]
    parts = [
        Conjunct(words, name.span, node)
        for words, every in (("inside", inside), ("outside", outside))
        for name, node in every
    ]

    def goals() -> list[Goal]:
        return [(part.node, TRUE) for part in parts]

    def impossible(some: list[Conjunct]) -> bool:
        return isinstance(satisfiable([(part.node, TRUE) for part in some], space), No)

    if not isinstance(proof.questions.ask(("airspace",), goals, space), No):
        return
    conflict = minimal_conflict(parts, impossible)
    proof.report.add(
        codes.CONTRADICTION,
        declared.span,
        "nothing is left of the airspace: the vehicle can be nowhere in it",
        help="it is inside of all zones after `inside`, and outside of all after `outside`: leave one out of those "
        "marked, or take their union",
        labels=[(part.span, f"it must be {part.words} of this") for part in conflict],
    )


def prove_step_contract(proof: ProofContext, step: Step, invocation: PreparedInvocation) -> None:
    """Report a step whose contract contradicts itself, or the airspace, with the arguments that it has."""
    flat = invocation.invocation
    if isinstance(proof.questions.known(("skill", flat.skill)), No):
        return  # said of the skill
    clauses = (*flat.contract.require, *flat.contract.assume, *flat.contract.maintain)
    key = ("step", flat.skill, invocation.arguments, tuple(clause.code for clause in clauses))
    if isinstance(proof.questions.known(key), Yes):
        return
    if step.overrides is not None:
        skills = proof.policy.contracts[flat.skill]
        known = {clause.span for clause in _clauses(proof, skills)}
        own = [part for part in _clauses(proof, flat.contract) if part.span not in known]
        _vacuous(proof, flat.skill, flat.contract, own)
    space = proof.questions.space(flat.skill)._replace(arguments=invocation.arguments)
    parts = [*_clauses(proof, flat.contract), *_airspace(proof)]
    name = flat.contract.name
    together = (
        f"`{name}` can never begin with these arguments: this cannot hold",
        f"`{name}` can never begin with these arguments: this never holds together",
    )
    _together(proof, parts, space, key, together, [], step.span)


def _clauses(proof: ProofContext, contract: Contract) -> Iterator[Conjunct]:
    for words, clauses in (
        ("requires", contract.require),
        ("assumes", contract.assume),
        ("maintains", contract.maintain),
    ):
        for clause in clauses:
            yield Conjunct(words, proof.span(clause), proof.prepared.compiler.node(clause, contract), clause.code)


def _airspace(proof: ProofContext) -> Iterator[Conjunct]:
    airspace = proof.policy.airspace
    if airspace is None:
        return
    for zone in airspace.inside:
        yield Conjunct("airspace", proof.span(airspace), tree.InsideZone(zone))
    for zone in airspace.outside:
        yield Conjunct("airspace", proof.span(airspace), tree.Negation(tree.InsideZone(zone)))


def _together(
    proof: ProofContext,
    parts: Sequence[Conjunct],
    space: SituationSpace,
    key: tuple[object, ...],
    messages: tuple[str, str],
    labels: list[tuple[Span, str]],
    span: Span,
) -> None:
    def goals() -> list[Goal]:
        return [(part.node, TRUE) for part in parts]

    answer = proof.questions.ask(key, goals, space)
    if isinstance(answer, Undecided):
        proof.report.add(
            codes.UNDECIDED, span, "it could not be decided whether its conditions can hold together", help=answer.why
        )
    if not isinstance(answer, No):
        return

    def impossible(some: list[Conjunct]) -> bool:
        return isinstance(satisfiable([(part.node, TRUE) for part in some], space), No)

    conflict = minimal_conflict(parts, impossible)
    if conflict[0].words == "airspace" and len({part.words for part in conflict}) == 1:
        return  # the airspace alone is empty: no fault of what flies in it
    words = {"requires": "this is required", "assumes": "this is assumed", "maintains": "this is maintained"}
    marked = [(part.span, words.get(part.words, "this is the airspace")) for part in conflict]
    main = span if not labels else marked.pop()[0]
    proof.report.add(
        codes.CONTRADICTION,
        main,
        messages[len(conflict) > 1],
        help="no state of the vehicle meets it; change one of the conditions",
        labels=list(dict.fromkeys([*marked, *labels])),
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
