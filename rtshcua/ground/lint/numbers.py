"""E1304: the same number for the same quantity, again and again: changed in one place, it is forgotten in another."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple, TypeAlias

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.parts import walk
from rtshcua.ground.lint.subject import Subject
from rtshcua.model.ir.expression import Comparison, Condition, Grow, Quantity, Reference, Value, Within
from rtshcua.model.ir.policies import PolicyDecl, TemplateDecl
from rtshcua.model.ir.skills import SkillDecl
from rtshcua.model.quantity import Datum, Dimension

Owner: TypeAlias = PolicyDecl | TemplateDecl | SkillDecl

#: in how many conditions a number may stand before it is worth a name
ENOUGH = 3


class Compared(NamedTuple):
    """What a number is compared with, as it is written, and the number."""

    what: str
    value: int
    dimension: Dimension
    datum: Datum | None


def check(subject: Subject) -> Iterator[Diagnostic]:
    """Report each number that stands for the same quantity in several conditions of one declaration."""
    for unit in subject.asked:
        owners: list[Owner] = [*unit.policies, *unit.templates, *unit.skills]
        for owner in owners:
            yield from _repeated(subject, owner)


def _repeated(subject: Subject, owner: Owner) -> Iterator[Diagnostic]:
    found: dict[Compared, list[Span]] = {}
    for condition in _conditions(owner):
        here: dict[Compared, Span] = {}
        for what, number in _numbers(condition):
            key = Compared(_text(subject, what), number.value, number.dimension, number.datum)
            here.setdefault(key, number.span)
        for key, span in here.items():
            found.setdefault(key, []).append(span)
    for key, spans in found.items():
        if len(spans) >= ENOUGH:
            written = _text(subject, spans[0])
            yield Diagnostic(
                codes.REPEATED_NUMBER,
                f"`{written}` stands for the same `{key.what}` in {len(spans)} conditions",
                spans[0],
                _help(owner, written),
                tuple(Label(span, "again here") for span in spans[1:]),
            )


def _help(owner: Owner, number: str) -> str:
    if isinstance(owner, PolicyDecl):
        return "make one rule of them, or a template with a parameter, so that it is written once"
    what = "template" if isinstance(owner, TemplateDecl) else "skill"
    return f"give the {what} a parameter with `{number}` as its default, so that it is written once"


def _conditions(owner: Owner) -> Iterable[Condition]:
    if isinstance(owner, SkillDecl):
        return [clause.condition for clause in (*owner.require, *owner.assume, *owner.maintain)]
    found = [rule.when for rule in owner.rules]
    found += [each.when for each in owner.delegations] if isinstance(owner, PolicyDecl) else []
    return [condition for condition in found if condition is not None]


def _numbers(condition: Condition) -> Iterator[tuple[Span, Quantity]]:
    """The numbers of a condition, but for zero, each with the place of what it is compared with."""
    for part in walk(condition):
        pairs: list[tuple[Value | Reference, Value]] = []
        match part:
            case Comparison():
                pairs = [(part.left, part.right), (part.right, part.left)]
            case Within():
                pairs = [(part.subject, part.range.low), (part.subject, part.range.high)]
            case Grow():
                pairs = [(part.zone, part.margin)]
        for what, number in pairs:
            if isinstance(number, Quantity) and number.value != 0 and not isinstance(what, Quantity):
                yield what.span, number


def _text(subject: Subject, span: Span) -> str:
    return " ".join(subject.program.sources[span.file].slice(span).split())
