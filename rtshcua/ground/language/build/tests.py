"""Nominals and tests."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from rtshcua.diagnostics.codes import WRITTEN_TWICE
from rtshcua.diagnostics.diagnostic import Label
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.build.base import Part
from rtshcua.ground.language.build.policies import Policies
from rtshcua.ground.language.wording import short
from rtshcua.model.ir.expression import Condition, Quantity, Value
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.skills import ArgumentValue
from rtshcua.model.ir.tests import (
    Answer,
    Asker,
    Assignment,
    Cell,
    Deed,
    Expectation,
    Identity,
    InForce,
    InPhase,
    Instant,
    Issue,
    Named,
    NominalDecl,
    OverTime,
    Premises,
    Quoted,
    Request,
    Row,
    Subject,
    Table,
    TestDecl,
)

#: parts of which there may be several
_LISTED = ("given", "answer")


class Outcome(NamedTuple):
    """`fallback return_home`, within an expectation."""

    outcome: Any
    target: Name | None


class Tests(Policies):
    """What must be decided, and where that starts from."""

    def title(self, span: Span, raw: str) -> Quoted:
        """A text that names something, or quotes a clause."""
        return Quoted(span=span, text=self.text(span, raw))

    def under(self, span: Span, policy: Name) -> Part:
        """`under bridge_inspection`."""
        return Part("under", span, policy)

    def aboard(self, span: Span, vehicle: Name) -> Part:
        """`on quad`."""
        return Part("on", span, vehicle)

    def asker(self, span: Span, role: Name, source: Name | None) -> Part:
        """`by role operator through agent`."""
        return Part("by", span, Asker(span=span, role=role, source=source))

    def over_time(self, span: Span, condition: Condition) -> OverTime:
        """`(battery < 30 % for the last 5 s)`."""
        return OverTime(span=span, condition=condition)

    def cell(self, span: Span, value: Value | str, measured: Quantity | None) -> Cell:
        """`20 %`, `unknown`, `fix_3d measured 3 s ago`."""
        return Cell(span=span, value=None if isinstance(value, str) else value, measured=measured)

    def assignment(self, span: Span, subject: Name | OverTime, cell: Cell) -> Assignment:
        """`battery = 20 %`."""
        return Assignment(span=span, subject=_subject(subject), cell=cell)

    def given(self, span: Span, *assignments: Assignment) -> Part:
        """`given battery = 20 %, gps.fix = fix_3d`."""
        return Part("given", span, assignments)

    def instant(self, span: Span, utc_us: int, within: Quantity | None) -> Part:
        """`at "2026-06-01T08:00:00Z" within 2 s`."""
        return Part("at", span, Instant(span=span, utc_us=utc_us, within=within))

    def in_phase(self, span: Span, phase: Name, order: tuple[Name, ...] | None) -> Part:
        """`phase departure of departure, inspection`."""
        return Part("phase", span, InPhase(span=span, phase=phase, order=order or ()))

    def answer(self, span: Span, word: str, role: Name, ago: Quantity | None) -> Part:
        """`approved by role supervisor 2 s ago`, `refused by role supervisor`."""
        return Part("answer", span, Answer(span=span, granted=word == "approved", role=role, ago=ago))

    def released(self, span: Span, ago: Quantity) -> Part:
        """`released 3 s ago`."""
        return Part("released", span, ago)

    def issued(self, span: Span, ago: Quantity) -> Part:
        """`issued 11 min ago`."""
        return Part("issued", span, Issue(span=span, distance=ago, ahead=False))

    def issued_ahead(self, span: Span, ahead: Quantity) -> Part:
        """`issued in 5 s`."""
        return Part("issued", span, Issue(span=span, distance=ahead, ahead=True))

    def in_force(self, span: Span, version: int) -> Part:
        """`version 8 in force`."""
        return Part("version", span, InForce(span=span, version=version))

    def identified(self, span: Span, text: str) -> Part:
        """`identity "quad-08"`."""
        return Part("identity", span, Identity(span=span, text=text))

    def deed(self, span: Span, word: Any) -> Part:
        """`replayed`, `tampered`."""
        return Part(word, span, Deed(span=span, kind=word))

    def asked(
        self,
        span: Span,
        skill: Name,
        arguments: tuple[ArgumentValue, ...] | None,
        role: Name | None,
        source: Name | None,
    ) -> Part:
        """`when inspect_area(area = bridge_a, altitude = 20 m) by operator through agent`."""
        said = [name.span for name in (role, source) if name is not None]
        asker = Asker(span=said[0].to(said[-1]), role=role, source=source) if said else None
        return Part("when", span, Request(span=span, skill=skill, arguments=arguments or (), asker=asker))

    def reason(self, span: Span, text: str) -> Name:
        """`state/violated`."""
        return Name(span=span, text=text)

    def outcome(self, span: Span, word: str, target: Name | None = None) -> Outcome:
        """`allow`, `fallback return_home`."""
        return Outcome(word, target)

    def expectation(self, span: Span, outcome: Outcome, reason: Name | None, clause: Quoted | None) -> Part:
        """`expect fallback return_home because state/violated`."""
        word, target = outcome
        return Part("expect", span, Expectation(span=span, outcome=word, target=target, reason=reason, clause=clause))

    def columns(self, span: Span, *subjects: Name | OverTime) -> tuple[Subject, ...]:
        """`battery, wind.speed`."""
        return tuple(map(_subject, subjects))

    def row(self, span: Span, *parts: Any) -> Row:
        """`20 %, 3 m/s expect allow`."""
        *cells, expectation = parts
        return Row(span=span, cells=tuple(cells), expectation=expectation.value)

    def rows(self, span: Span, columns: tuple[Subject, ...], *rows: Row) -> Part:
        """`table battery, wind.speed { ... }`."""
        return Part("table", span, Table(span=span, columns=columns, rows=rows))

    def nominal(self, span: Span, name: Name, *given: Part) -> None:
        """`nominal morning { under bridge_inspection on quad ... }`."""
        self.undotted(name, "nominal")
        premises, found = self._premises(span, "nominal", name, given, ("under", "on"))
        if not self.sound:
            self.abandon(name)
            return
        self.declare(
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

    def test(self, span: Span, name: Quoted, nominal: Name | None, *given: Part) -> None:
        """`test "low battery turns an inspection into a return" { ... }`."""
        premises, found = self._premises(span, "test", name, given)
        self.declare(
            TestDecl(
                span=span,
                name=name,
                nominal=nominal,
                premises=premises,
                request=found.get("when"),
                expectation=found.get("expect"),
                table=found.get("table"),
            )
        )

    def _premises(
        self, span: Span, owner: str, name: Name | Quoted, given: Sequence[Part], required: Sequence[str] = ()
    ) -> tuple[Premises, dict[str, Any]]:
        """What holds, and the other parts by their key."""
        once = [part for part in given if part.key not in _LISTED]
        found = {key: part.value for key, part in self.parts(owner, name, once, required).items()}
        answers: list[Answer] = []
        for part in given:
            if part.key == "answer":
                self._answer(answers, part.value)
        premises = Premises(
            span=span,
            given=tuple(each for part in given if part.key == "given" for each in part.value),
            instant=found.get("at"),
            phase=found.get("phase"),
            answers=tuple(answers),
            released=found.get("released"),
            issued=found.get("issued"),
            in_force=found.get("version"),
            identity=found.get("identity"),
            replayed=found.get("replayed"),
            tampered=found.get("tampered"),
        )
        return premises, found

    def _answer(self, answers: list[Answer], answer: Answer) -> None:
        """Each answer is of another person; no rule asks more than two."""
        same = [each for each in answers if each.role.text == answer.role.text]
        if len(same) < _PEOPLE:
            answers.append(answer)
            return
        self.report(
            WRITTEN_TWICE,
            f"`{short(answer.role.text)}` answers more than twice",
            answer.span,
            "keep two of them: a rule asks two people at most",
            labels=(Label(same[0].span, "first written here"),),
        )


#: of how many people a rule may ask for an approval
_PEOPLE = 2


def _subject(subject: Name | OverTime) -> Subject:
    return Named(span=subject.span, name=subject) if isinstance(subject, Name) else subject
