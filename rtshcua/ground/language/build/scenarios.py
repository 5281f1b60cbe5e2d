"""Scenarios."""

from typing import Any

from rtshcua.diagnostics.codes import SYNTAX
from rtshcua.diagnostics.diagnostic import Fix
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.build.base import Part
from rtshcua.ground.language.build.tests import Tests
from rtshcua.model.ir.expression import Condition, Quantity
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.scenarios import (
    AfterStep,
    AtTime,
    Beginning,
    Begins,
    Charge,
    Decides,
    Delay,
    Ends,
    FaultCall,
    Flies,
    Incident,
    Keeps,
    Lands,
    Moment,
    OnCondition,
    Reacts,
    ScenarioDecl,
    Seeds,
)
from rtshcua.model.ir.skills import ArgumentValue
from rtshcua.model.ir.tests import Quoted

#: parts of which there may be several
_LISTED = ("incident", "expect")


class Scenarios(Tests):
    """What is flown, what goes wrong on the way, and what must come of it."""

    def flown_mission(self, span: Span, mission: Name) -> Part:
        """`flies standard`."""
        return Part("flies", span, mission)

    def flavours(self, span: Span, names: tuple[Name, ...]) -> Part:
        """`aboard px4, ardupilot`."""
        return Part("aboard", span, names)

    def seeds(self, span: Span, first: Quantity, last: Quantity | None) -> Part:
        """`seeds 1 .. 20`."""
        return Part("seeds", span, Seeds(span=span, first=first, last=last or first))

    def start(self, span: Span, *beginnings: Beginning) -> Part:
        """`start battery = 80 %, wind(speed = 3 m/s), at "2026-06-01T08:00:00Z"`."""
        return Part("start", span, beginnings)

    def begins(self, span: Span, utc_us: int) -> Begins:
        """`at "2026-06-01T08:00:00Z"`."""
        return Begins(span=span, utc_us=utc_us)

    def charge(self, span: Span, name: Name, value: Quantity) -> Charge:
        """`battery = 80 %`."""
        return Charge(span=span, name=name, value=value)

    def fault(self, span: Span, name: str, arguments: tuple[ArgumentValue, ...] | None) -> FaultCall:
        """`link_silence(for = 5 s, way = up)`."""
        named = Name(span=Span(span.file, span.start, span.start + len(name)), text=name)
        return FaultCall(span=span, name=named, arguments=arguments or ())

    def delay(self, span: Span, low: Quantity, high: Quantity | None) -> Delay:
        """`30 s .. 40 s`."""
        return Delay(span=span, low=low, high=high or low)

    def at_time(self, span: Span, delay: Delay) -> AtTime:
        """`at 20 s`."""
        return AtTime(span=span, delay=delay)

    def after_step(self, span: Span, delay: Delay | None, skill: Name, number: Quantity | None) -> AfterStep:
        """`2 s after goto 2`."""
        return AfterStep(span=span, delay=delay, skill=skill, number=number)

    def on_condition(self, span: Span, delay: Delay | None, condition: Condition) -> OnCondition:
        """`when height > 10 m`."""
        return OnCondition(span=span, delay=delay, condition=condition)

    def incident(self, span: Span, moment: Moment, fault: FaultCall) -> Part:
        """`at 20 s gps_loss(for = 4 s)`."""
        return Part("incident", span, Incident(span=span, moment=moment, fault=fault))

    def demand(self, span: Span, decision: Part) -> Part:
        """`expect fallback return_home because state/violated`."""
        return Part("expect", span, Decides(span=span, decision=decision.value))

    def ends(self, span: Span, endings: tuple[Name, ...]) -> Part:
        """`expect ends completed, aborted`."""
        return Part("expect", span, Ends(span=span, endings=endings))

    def flies(self, span: Span, skill: Name) -> Part:
        """`expect flies return_home`."""
        return Part("expect", span, Flies(span=span, skill=skill, never=False))

    def never(self, span: Span, skill: Name) -> Part:
        """`expect never emergency_land`."""
        return Part("expect", span, Flies(span=span, skill=skill, never=True))

    def bound(self, span: Span, operator: str) -> Name:
        """`<=`, before how much it may be."""
        return Name(span=span, text=operator)

    def reaction(self, span: Span, operator: Name, most: Quantity) -> Part:
        """`expect reaction <= 200 ms`."""
        self._bounded(operator, "<=", "a reaction is bounded from above")
        return Part("expect", span, Reacts(span=span, most=most))

    def distance(self, span: Span, place: Name, operator: Name, least: Quantity) -> Part:
        """`expect distance to school >= 20 m`."""
        self._bounded(operator, ">=", "a distance is bounded from below")
        return Part("expect", span, Keeps(span=span, place=place, least=least))

    def lands(self, span: Span, zone: Name) -> Part:
        """`expect lands in home_field`."""
        return Part("expect", span, Lands(span=span, zone=zone))

    def scenario(self, span: Span, name: Quoted, *given: Part) -> None:
        """`scenario "a dropout over the bridge" { ... }`."""
        once = [part for part in given if part.key not in _LISTED]
        found: dict[str, Any] = {
            key: part.value for key, part in self.parts("scenario", name, once, ("flies",)).items()
        }
        if "flies" not in found:
            self.settle()
            return
        self.declare(
            ScenarioDecl(
                span=span,
                name=name,
                mission=found["flies"],
                flavours=found.get("aboard", ()),
                seeds=found.get("seeds"),
                start=found.get("start", ()),
                incidents=tuple(part.value for part in given if part.key == "incident"),
                demands=tuple(part.value for part in given if part.key == "expect"),
            )
        )

    def _bounded(self, operator: Name, meant: str, why: str) -> None:
        """The one comparison that has a meaning there."""
        if operator.text != meant:
            self.report(
                SYNTAX,
                f"found `{operator.text}`, expected `{meant}`: {why}",
                operator.span,
                f"write `{meant}`",
                fixes=(Fix(operator.span, meant, f"write `{meant}`"),),
            )
