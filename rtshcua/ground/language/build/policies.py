"""Actions for imports, roles, policies, templates and missions."""

from typing import Any

from rtshcua.diagnostics.codes import NOT_WRITTEN, SYNTAX
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.build.reader import Action, Part, Reader, node, part, several
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.missions import Item, MissionDecl, Overrides, Phase, Repeat, Step
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.policies import (
    AirspaceDecl,
    Delegation,
    PolicyDecl,
    RoleDecl,
    RuleDecl,
    Silence,
    TemplateDecl,
    Use,
)
from rtshcua.model.ir.program import Import
from rtshcua.model.ir.skills import ArgumentValue, ParameterDecl

Names = tuple[Name, ...]

FORMS: dict[str, Action] = {
    "permit": node(RuleDecl, "skills", "roles", "through", "when", kind="permit", through=()),
    "forbid": node(RuleDecl, "skills", "roles", "through", "when", "where_fitted", kind="forbid", through=()),
    "confirm": node(
        RuleDecl,
        "skills",
        "when",
        "approver",
        "another",
        "within",
        "where_fitted",
        kind="confirm",
        roles=(),
        through=(),
    ),
    "degrade": node(RuleDecl, "skills", "when", "target", "where_fitted", kind="degrade", roles=(), through=()),
    "contingency": part("contingency"),
    "without_evidence": part("without evidence"),
    "without_link": part("without link", node(Silence, "limit", "then")),
    "use": node(Use, "template", "arguments", arguments=()),
    "delegate": node(Delegation, "skills", "grantor", "grantee", "through", "when", through=()),
    "arguments": several,
    "most_steps": part("steps"),
    "intent": part("intent"),
    "proposed": part("proposed", several),
}


def file(reader: Reader, span: Span, *declarations: None) -> None:
    """The whole text. The reader already has its declarations."""


def import_file(reader: Reader, span: Span, path: str) -> None:
    """`import "lib:skills/goto.rts"`."""
    reader.declare(Import(span=span, path=path))


def anyone(reader: Reader, span: Span) -> Names:
    """`any` skill, or `by any` role: no names."""
    return ()


def airspace(reader: Reader, span: Span, inside: Names | None, outside: Names | None) -> Part:
    """`airspace inside city outside school`."""
    if inside is None and outside is None:
        help = "write `inside`, `outside` or both, as in `airspace inside city outside school`"
        reader.report(NOT_WRITTEN, "the airspace has no zone", span, help)
    return Part("airspace", span, AirspaceDecl(span=span, inside=inside or (), outside=outside or ()))


def role(reader: Reader, span: Span, names: Names) -> None:
    """`role supervisor, trainee`."""
    reader.declare(RoleDecl(span=span, names=names))


def template(
    reader: Reader, span: Span, name: Name, parameters: tuple[ParameterDecl, ...] | None, *rules: RuleDecl
) -> None:
    """`template low_flight(area: zone, top: altitude) { permit ... }`."""
    reader.undotted(name, "template")
    reader.declare(TemplateDecl(span=span, name=name, parameters=parameters or (), rules=rules), name)


def policy(reader: Reader, span: Span, name: Name, version: int, *given: RuleDecl | Use | Delegation | Part) -> None:
    """`policy bridge_inspection version 7 { ... }`."""
    reader.undotted(name, "policy")
    found = reader.parts("policy", name, [part for part in given if isinstance(part, Part)])
    reader.declare(
        PolicyDecl(
            span=span,
            name=name,
            version=version,
            rules=tuple(rule for rule in given if isinstance(rule, RuleDecl)),
            airspace=found.get("airspace"),
            contingency=found.get("contingency", ()),
            uses=tuple(use for use in given if isinstance(use, Use)),
            delegations=tuple(each for each in given if isinstance(each, Delegation)),
            without_evidence=found.get("without evidence", "land"),
            without_link=found.get("without link"),
        ),
        name,
    )


def argument(reader: Reader, span: Span, *parts: Any) -> ArgumentValue:
    """`altitude = 20 m`, or a positional value."""
    name, value = parts if len(parts) == 2 else (None, *parts)
    return ArgumentValue(span=span, name=name, value=value)


def step(
    reader: Reader,
    span: Span,
    skill: Name,
    arguments: tuple[ArgumentValue, ...] | None,
    otherwise: Any,
    tighter: tuple[Span, tuple[Part, ...]] | None,
) -> Step:
    """`goto(bridge_a.entry, altitude = 20 m) on inadmissible skip { deadline 2 s }`."""
    return Step(
        span=span,
        skill=skill,
        arguments=arguments or (),
        on_inadmissible=otherwise or "abort",
        overrides=None if tighter is None else _overrides(reader, skill, *tighter),
    )


def overrides(reader: Reader, span: Span, *given: Part) -> tuple[Span, tuple[Part, ...]]:
    """`{ deadline 2 s }`, after a step."""
    return span, given


def _overrides(reader: Reader, skill: Name, span: Span, given: tuple[Part, ...]) -> Overrides:
    found = reader.parts("the step", skill, given)
    for each in given:
        if each.key in ("require", "assume", "maintain") and any(clause.where_fitted for clause in each.value):
            reader.report(
                SYNTAX,
                "`where fitted` is not allowed in a step: the mission names its vehicle",
                each.span,
                "remove `where fitted`; if the vehicle lacks the sensor, remove the clause",
            )
    validity, phases = found.get("valid", (None, ()))
    return Overrides(
        span=span,
        deadline=found.get("deadline"),
        validity=validity,
        duration=found.get("lasts"),
        grace=found.get("grace"),
        energy=found.get("energy"),
        phases=phases,
        require=found.get("require", ()),
        assume=found.get("assume", ()),
        maintain=found.get("maintain", ()),
        record=found.get("record", ()),
    )


def repeat(reader: Reader, span: Span, count: Quantity, *items: Item) -> Node:
    """`repeat 3 { ... }`."""
    made = Repeat(span=span, count=count, items=items)
    return reader.nested(made, *items, help="write one `repeat` with the product of the counts")


def phase(reader: Reader, span: Span, name: Name, *items: Item) -> Phase:
    """`phase inspection { ... }`."""
    reader.undotted(name, "phase")
    return Phase(span=span, name=name, items=items)


def mission(
    reader: Reader,
    span: Span,
    name: Name,
    parameters: tuple[ParameterDecl, ...] | None,
    policy: Name,
    version: int,
    vehicle: Name,
    *given: Phase | Part,
) -> None:
    """`mission inspect_bridge_a(height: altitude) under bridge_inspection@7 on quad { ... }`."""
    reader.undotted(name, "mission")
    found = reader.parts("mission", name, [part for part in given if isinstance(part, Part)])
    source, proposer, role = found.get("proposed", (None, None, None))
    reader.declare(
        MissionDecl(
            span=span,
            name=name,
            policy=policy,
            policy_version=version,
            vehicle=vehicle,
            intent=found.get("intent"),
            source=source,
            proposer=proposer,
            role=role,
            phases=tuple(phase for phase in given if isinstance(phase, Phase)),
            parameters=parameters or (),
            most_time=found.get("lasts"),
            most_energy=found.get("energy"),
            most_steps=found.get("steps"),
        ),
        name,
    )
