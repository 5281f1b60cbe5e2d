"""Actions for nominals, tests and scenarios."""

from collections.abc import Sequence
from itertools import chain
from typing import Any

from rtshcua.diagnostics.codes import SYNTAX, WRITTEN_TWICE
from rtshcua.diagnostics.diagnostic import Fix, Label
from rtshcua.diagnostics.excerpt import short
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.build.literals import text
from rtshcua.ground.language.build.reader import Action, Part, Reader, node, part, several
from rtshcua.model.ir.expression import Quantity, Value
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.scenarios import (
    AfterStepDecl,
    AtTimeDecl,
    Begins,
    Charge,
    DecidesDecl,
    Delay,
    Ends,
    FaultCall,
    FliesDecl,
    IncidentDecl,
    Keeps,
    Lands,
    OnConditionDecl,
    Reacts,
    ScenarioDecl,
    Seeds,
)
from rtshcua.model.ir.skills import ArgumentValue
from rtshcua.model.ir.tests import (
    Answer,
    Asker,
    Assignment,
    CaseTable,
    Deed,
    Expectation,
    Identity,
    InPhase,
    Instant,
    Issue,
    Named,
    NominalDecl,
    OverTime,
    Premises,
    Quoted,
    RequestDecl,
    Subject,
    TableCell,
    TableRow,
    TestDecl,
    VersionInForce,
)

#: the most approvals that a rule may require
PEOPLE = 2

#: parts of a nominal or a test that may repeat
_LISTED = ("given", "answer")

FORMS: dict[str, Action] = {
    "under": part("under"),
    "aboard": part("on"),
    "asker": part("by", node(Asker, "role", "source")),
    "over_time": node(OverTime, "condition"),
    "given": part("given", several),
    "instant": part("at", node(Instant, "utc_us", "within")),
    "in_phase": part("phase", node(InPhase, "phase", "order", order=())),
    "released": part("released"),
    "issued": part("issued", node(Issue, "distance", ahead=False)),
    "issued_ahead": part("issued", node(Issue, "distance", ahead=True)),
    "in_force": part("version", node(VersionInForce, "version")),
    "identified": part("identity", node(Identity, "text")),
    "reason": node(Name, "text"),
    "outcome": several,
    "flown_mission": part("flies"),
    "flavours": part("aboard"),
    "start": part("start", several),
    "begins": node(Begins, "utc_us"),
    "charge": node(Charge, "name", "value"),
    "at_time": node(AtTimeDecl, "delay"),
    "after_step": node(AfterStepDecl, "delay", "skill", "number"),
    "on_condition": node(OnConditionDecl, "delay", "condition"),
    "incident": part("incident", node(IncidentDecl, "moment", "fault")),
    "ends": part("demand", node(Ends, "endings")),
    "flies": part("demand", node(FliesDecl, "skill", never=False)),
    "never": part("demand", node(FliesDecl, "skill", never=True)),
    "bound": node(Name, "text"),
    "lands": part("demand", node(Lands, "zone")),
}


def title(reader: Reader, span: Span, raw: str) -> Quoted:
    """A quoted name, or a quoted clause."""
    return Quoted(span=span, text=text(reader, span, raw))


def cell(reader: Reader, span: Span, value: Value | str, measured: Quantity | None) -> TableCell:
    """`20 %`, `unknown`, `fix_3d measured 3 s ago`."""
    return TableCell(span=span, value=None if isinstance(value, str) else value, measured=measured)


def assignment(reader: Reader, span: Span, subject: Name | OverTime, cell: TableCell) -> Assignment:
    """`battery = 20 %`."""
    return Assignment(span=span, subject=_subject(subject), cell=cell)


def answer(reader: Reader, span: Span, word: str, role: Name, ago: Quantity | None) -> Part:
    """`approved by role supervisor 2 s ago`, `refused by role supervisor`."""
    return Part("answer", span, Answer(span=span, granted=word == "approved", role=role, ago=ago))


def deed(reader: Reader, span: Span, word: Any) -> Part:
    """`replayed`, `tampered`."""
    return Part(word, span, Deed(span=span, kind=word))


def asked(
    reader: Reader,
    span: Span,
    skill: Name,
    arguments: tuple[ArgumentValue, ...] | None,
    role: Name | None,
    source: Name | None,
) -> Part:
    """`when inspect_area(area = bridge_a, altitude = 20 m) by operator through agent`."""
    spans = [name.span for name in (role, source) if name is not None]
    asker = Asker(span=spans[0].to(spans[-1]), role=role, source=source) if spans else None
    return Part("when", span, RequestDecl(span=span, skill=skill, arguments=arguments or (), asker=asker))


def expectation(
    reader: Reader, span: Span, outcome: tuple[Any, ...], reason: Name | None, clause: Quoted | None
) -> Part:
    """`expect fallback return_home because state/violated`."""
    word, target = outcome if len(outcome) == 2 else (*outcome, None)
    return Part("expect", span, Expectation(span=span, outcome=word, target=target, reason=reason, clause=clause))


def columns(reader: Reader, span: Span, *subjects: Name | OverTime) -> tuple[Subject, ...]:
    """`battery, wind.speed`."""
    return tuple(map(_subject, subjects))


def row(reader: Reader, span: Span, *parts: Any) -> TableRow:
    """`20 %, 3 m/s expect allow`."""
    *cells, expectation = parts
    return TableRow(span=span, cells=tuple(cells), expectation=expectation.value)


def rows(reader: Reader, span: Span, columns: tuple[Subject, ...], *rows: TableRow) -> Part:
    """`table battery, wind.speed { ... }`."""
    return Part("table", span, CaseTable(span=span, columns=columns, rows=rows))


def nominal(reader: Reader, span: Span, name: Name, *given: Part) -> None:
    """`nominal morning { under bridge_inspection on quad ... }`."""
    reader.undotted(name, "nominal")
    found = reader.parts("nominal", name, given, ("under", "on"), _LISTED)
    premises = _premises(reader, span, found)
    if not reader.sound:
        reader.abandon(name)
        return
    reader.declare(
        NominalDecl(
            span=span,
            name=name,
            policy=found["under"],
            vehicle=found["on"],
            asker=found.get("by"),
            premises=premises,
        ),
        name,
    )


def test(reader: Reader, span: Span, name: Quoted, nominal: Name | None, *given: Part) -> None:
    """`test "low battery turns an inspection into a return" { ... }`."""
    found = reader.parts("test", name, given, (), _LISTED)
    reader.declare(
        TestDecl(
            span=span,
            name=name,
            nominal=nominal,
            premises=_premises(reader, span, found),
            request=found.get("when"),
            expectation=found.get("expect"),
            table=found.get("table"),
        )
    )


def _premises(reader: Reader, span: Span, found: dict[str, Any]) -> Premises:
    """The premises among the parts of a nominal or a test."""
    return Premises(
        span=span,
        given=tuple(chain.from_iterable(found["given"])),
        instant=found.get("at"),
        phase=found.get("phase"),
        answers=_answers(reader, found["answer"]),
        released=found.get("released"),
        issued=found.get("issued"),
        in_force=found.get("version"),
        identity=found.get("identity"),
        replayed=found.get("replayed"),
        tampered=found.get("tampered"),
    )


def _answers(reader: Reader, given: Sequence[Answer]) -> tuple[Answer, ...]:
    """The answers, at most two per role; each is of another person."""
    kept: list[Answer] = []
    for answer in given:
        same = [each for each in kept if each.role.text == answer.role.text]
        if len(same) < PEOPLE:
            kept.append(answer)
        else:
            reader.report(
                WRITTEN_TWICE,
                f"the role `{short(answer.role.text)}` has more than two answers",
                answer.span,
                "keep two of them: a rule needs at most two approvals",
                labels=(Label(same[0].span, "first written here"),),
            )
    return tuple(kept)


def _subject(subject: Name | OverTime) -> Subject:
    return Named(span=subject.span, name=subject) if isinstance(subject, Name) else subject


def seeds(reader: Reader, span: Span, first: Quantity, last: Quantity | None) -> Part:
    """`seeds 1 .. 20`."""
    return Part("seeds", span, Seeds(span=span, first=first, last=last or first))


def fault(reader: Reader, span: Span, name: str, arguments: tuple[ArgumentValue, ...] | None) -> FaultCall:
    """`link_silence(for = 5 s, way = up)`."""
    named = Name(span=Span(span.file, span.start, span.start + len(name)), text=name)
    return FaultCall(span=span, name=named, arguments=arguments or ())


def delay(reader: Reader, span: Span, low: Quantity, high: Quantity | None) -> Delay:
    """`30 s .. 40 s`."""
    return Delay(span=span, low=low, high=high or low)


def demand(reader: Reader, span: Span, decision: Part) -> Part:
    """`expect fallback return_home because state/violated`."""
    return Part("demand", span, DecidesDecl(span=span, decision=decision.value))


def reaction(reader: Reader, span: Span, operator: Name, most: Quantity) -> Part:
    """`expect reaction <= 200 ms`."""
    _bounded(reader, operator, "<=", "a reaction time has an upper bound")
    return Part("demand", span, Reacts(span=span, most=most))


def distance(reader: Reader, span: Span, place: Name, operator: Name, least: Quantity) -> Part:
    """`expect distance to school >= 20 m`."""
    _bounded(reader, operator, ">=", "a distance has a lower bound")
    return Part("demand", span, Keeps(span=span, place=place, least=least))


def _bounded(reader: Reader, operator: Name, meant: str, why: str) -> None:
    """Report a comparison with another operator than `meant`."""
    if operator.text != meant:
        reader.report(
            SYNTAX,
            f"found `{operator.text}`, expected `{meant}`: {why}",
            operator.span,
            f"write `{meant}`",
            fixes=(Fix(operator.span, meant, f"write `{meant}`"),),
        )


def scenario(reader: Reader, span: Span, name: Quoted, *given: Part) -> None:
    """`scenario "a dropout over the bridge" { ... }`."""
    found = reader.parts("scenario", name, given, ("flies",), ("incident", "demand"))
    if "flies" not in found:
        reader.settle()
        return
    reader.declare(
        ScenarioDecl(
            span=span,
            name=name,
            mission=found["flies"],
            flavours=found.get("aboard", ()),
            seeds=found.get("seeds"),
            start=found.get("start", ()),
            incidents=tuple(found["incident"]),
            demands=tuple(found["demand"]),
        )
    )
