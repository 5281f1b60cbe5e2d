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
from rtshcua.ground.analysis.space import Space
from rtshcua.ground.prove.minimal import minimal
from rtshcua.ground.prove.situation import Ground
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.policy import RuleKind
from rtshcua.model.ir.missions import Step


class Part(NamedTuple):
    """Something that must hold: what it is, where it is written, its condition; of a clause, what that comes from."""

    words: str
    span: Span
    node: tree.Node
    code: tuple[int, ...] = ()


def prove(ground: Ground) -> None:
    """Report every skill whose clauses contradict each other, and every clause of one that cannot fail."""
    permitted = {
        skill for rule in ground.prepared.policy.rules if rule.kind == RuleKind.PERMIT for skill in rule.skills
    }
    _nowhere(ground)
    for number, contract in enumerate(ground.prepared.policy.contracts):
        space = ground.questions.space(number)
        parts = list(_clauses(ground, contract))
        _vacuous(ground, number, contract, parts)
        name = ground.context.symbols.skills[contract.name].name.span
        together = (
            f"this part of `{contract.name}` can never hold",
            f"these parts of `{contract.name}` never hold together",
        )
        airspace = list(_airspace(ground)) if number in permitted else []
        before = len(ground.context.report.found)
        _together(ground, [*airspace, *parts], space, ("skill", number), together, [(name, "the skill")], name)
        if any(found.code is codes.CONTRADICTION for found in ground.context.report.found[before:]):
            ground.impossible.add(number)


def _nowhere(ground: Ground) -> None:
    """Report an airspace in which a vehicle can be nowhere, at no time."""
    declared, space = ground.lowered.declaration.airspace, ground.questions.space(0)
    if declared is None:
        return
    zones = ground.lowered.zones
    inside = [(name, tree.Inside(zones.zone(name.text, 0, smaller=True, span=name.span))) for name in declared.inside]
    outside = [
        (name, tree.Not(tree.Inside(zones.zone(name.text, 0, smaller=False, span=name.span))))
        for name in declared.outside
    ]
    parts = [
        Part(words, name.span, node)
        for words, every in (("inside", inside), ("outside", outside))
        for name, node in every
    ]

    def goals() -> list[Goal]:
        return [(part.node, TRUE) for part in parts]

    def impossible(some: list[Part]) -> bool:
        return isinstance(satisfiable([(part.node, TRUE) for part in some], space), No)

    if not isinstance(ground.questions.ask(("airspace",), goals, space), No):
        return
    conflict = minimal(parts, impossible)
    ground.context.report.add(
        codes.CONTRADICTION,
        declared.span,
        "nothing is left of the airspace: the vehicle can be nowhere in it",
        help="it is inside of all zones after `inside`, and outside of all after `outside`: leave one out of those "
        "marked, or take their union",
        labels=[(part.span, f"it must be {part.words} of this") for part in conflict],
    )


def prove_step(ground: Ground, step: Step, invocation: PreparedInvocation) -> None:
    """Report a step whose contract contradicts itself, or the airspace, with the arguments that it has."""
    flat = invocation.invocation
    if isinstance(ground.questions.known(("skill", flat.skill)), No):
        return  # said of the skill
    clauses = (*flat.contract.require, *flat.contract.assume, *flat.contract.maintain)
    key = ("step", flat.skill, invocation.arguments, tuple(clause.code for clause in clauses))
    if isinstance(ground.questions.known(key), Yes):
        return
    if step.overrides is not None:
        skills = ground.prepared.policy.contracts[flat.skill]
        known = {clause.span for clause in _clauses(ground, skills)}
        own = [part for part in _clauses(ground, flat.contract) if part.span not in known]
        _vacuous(ground, flat.skill, flat.contract, own)
    space = ground.questions.space(flat.skill)._replace(arguments=invocation.arguments)
    parts = [*_clauses(ground, flat.contract), *_airspace(ground)]
    name = flat.contract.name
    together = (
        f"`{name}` can never begin with these arguments: this cannot hold",
        f"`{name}` can never begin with these arguments: this never holds together",
    )
    _together(ground, parts, space, key, together, [], step.span)


def _clauses(ground: Ground, contract: Contract) -> Iterator[Part]:
    for words, clauses in (
        ("requires", contract.require),
        ("assumes", contract.assume),
        ("maintains", contract.maintain),
    ):
        for clause in clauses:
            yield Part(words, ground.span(clause), ground.prepared.compiler.node(clause, contract), clause.code)


def _airspace(ground: Ground) -> Iterator[Part]:
    airspace = ground.prepared.policy.airspace
    if airspace is None:
        return
    for zone in airspace.inside:
        yield Part("airspace", ground.span(airspace), tree.Inside(zone))
    for zone in airspace.outside:
        yield Part("airspace", ground.span(airspace), tree.Not(tree.Inside(zone)))


def _together(
    ground: Ground,
    parts: Sequence[Part],
    space: Space,
    key: tuple[object, ...],
    messages: tuple[str, str],
    labels: list[tuple[Span, str]],
    span: Span,
) -> None:
    def goals() -> list[Goal]:
        return [(part.node, TRUE) for part in parts]

    answer = ground.questions.ask(key, goals, space)
    if isinstance(answer, Undecided):
        ground.context.report.add(
            codes.UNDECIDED, span, "it could not be decided whether its conditions can hold together", help=answer.why
        )
    if not isinstance(answer, No):
        return

    def impossible(some: list[Part]) -> bool:
        return isinstance(satisfiable([(part.node, TRUE) for part in some], space), No)

    conflict = minimal(parts, impossible)
    if conflict[0].words == "airspace" and len({part.words for part in conflict}) == 1:
        return  # the airspace alone is empty: no fault of what flies in it
    words = {"requires": "this is required", "assumes": "this is assumed", "maintains": "this is maintained"}
    marked = [(part.span, words.get(part.words, "this is the airspace")) for part in conflict]
    main = span if not labels else marked.pop()[0]
    ground.context.report.add(
        codes.CONTRADICTION,
        main,
        messages[len(conflict) > 1],
        help="no state of the vehicle meets it; change one of the conditions",
        labels=list(dict.fromkeys([*marked, *labels])),
    )


def _vacuous(ground: Ground, skill: int, contract: Contract, parts: Sequence[Part]) -> None:
    space = ground.questions.space(skill)
    for part in parts:
        goal = (part.node, FALSE | UNKNOWN)
        if isinstance(ground.questions.ask(("fails", skill, part.code), partial(list, (goal,)), space), No):
            ground.context.report.add(
                codes.ALWAYS_HOLDS,
                part.span,
                f"this cannot fail for any arguments that `{contract.name}` may be given",
                help="leave it out, or say what was meant",
            )
