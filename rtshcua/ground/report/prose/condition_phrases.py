"""Describes conditions. `docs/language.md` gives the meaning of each form, from section "Conditions" on."""

from typing import Final, assert_never

from rtshcua.ground.report.prose.phrases import (
    LOCAL_TIME,
    Vocabulary,
    between,
    bracketed,
    describe_value,
    listed,
    name,
    named,
    on_days,
    reference,
    region,
    whole_day,
)
from rtshcua.model.ir.expression import (
    Comparison,
    Condition,
    Edge,
    ForLast,
    Inside,
    Junction,
    Known,
    Near,
    Not,
    OneOf,
    Reference,
    TimeOfDay,
    Value,
    Within,
    WithinLast,
)
from rtshcua.model.quantity import Dimension, display

_RELATIONS: Final = {
    "<": "below",
    "<=": "at most",
    ">": "above",
    ">=": "at least",
    "==": "exactly",
    "!=": "other than",
}
_TIMES: Final = _RELATIONS | {"<": "before", "<=": "not after", ">": "after", ">=": "not before"}


def describe_condition(condition: Condition, names: Vocabulary) -> str:
    """Describe a condition as a clause of a sentence: `battery` is above 35 %."""
    match condition:
        case Comparison():
            return _comparison(condition, names)
        case Within():
            return f"{describe_value(condition.subject, names)} is {_range(condition, names)}"
        case OneOf():
            return (
                f"{describe_value(condition.subject, names)} is {named([each.text for each in condition.names], 'or')}"
            )
        case Inside():
            return _inside(condition, names)
        case Known():
            return f"{describe_value(condition.subject, names)} is known"
        case Not():
            return f"it is not so that {_operand(condition.operand, names)}"
        case Junction():
            return listed([_operand(each, names) for each in condition.operands], condition.operator)
        case ForLast() | WithinLast():
            kept = "all through" if isinstance(condition, ForLast) else "at some moment of"
            window = display(condition.window.value, Dimension.DURATION)
            return f"{_operand(condition.operand, names)}, {kept} the last {window}"
        case Near():
            window = display(condition.window.value, Dimension.DURATION)
            left, right = _operand(condition.left, names), _operand(condition.right, names)
            return f"one of these holds now and the other did within the last {window}: {left}; {right}"
        case Edge():
            became = "true" if condition.rising else "false"
            return f"it has just become {became} that {_operand(condition.operand, names)}"
    assert_never(condition)


def conjuncts(condition: Condition | None) -> tuple[Condition, ...]:
    """The parts of a condition that must all hold."""
    if condition is None:
        return ()
    if isinstance(condition, Junction) and condition.operator == "and":
        return tuple(part for each in condition.operands for part in conjuncts(each))
    return (condition,)


def describe_clauses(condition: Condition | None, names: Vocabulary) -> tuple[str, ...]:
    """Describe the parts of a condition that must all hold."""
    return tuple(describe_condition(each, names) for each in conjuncts(condition))


def _operand(condition: Condition, names: Vocabulary) -> str:
    """Describe a condition within another one, in brackets unless it is unambiguous.

    At each depth of brackets there is only one kind of list, of `and` or of `or`, so a sentence has one meaning only.
    """
    words = describe_condition(condition, names)
    simple = isinstance(condition, Comparison | Within | OneOf | Inside | Known)
    return bracketed(words) if simple else f"({words})"


def _inside(one: Inside, names: Vocabulary) -> str:
    """Describe where something is. A requested place only needs the ground plan of a zone (`ARGUMENT_POINT_IN`)."""
    side = "outside" if one.negated else "inside"
    asked = isinstance(one.subject, Reference) and one.subject.name in names.places
    height = " (on the ground, at whatever height)" if asked else ""
    return f"{describe_value(one.subject, names)} is {side} {region(one.region, names)}{height}"


def _comparison(one: Comparison, names: Vocabulary) -> str:
    timed = any(_is_time(side) for side in (one.left, one.right))
    words = (_TIMES if timed else _RELATIONS)[one.operator]
    plain = one.operator in ("==", "!=") and any(_is_member(side, names) for side in (one.left, one.right))
    if plain:  # an enumeration or a phase has no order
        words = "" if one.operator == "==" else "not"
    return " ".join(f"{describe_value(one.left, names)} is {words} {describe_value(one.right, names)}".split())


def _range(one: Within, names: Vocabulary) -> str:
    low, high = one.range.low, one.range.high
    if isinstance(low, TimeOfDay) and isinstance(high, TimeOfDay):
        if one.days and whole_day(low.value, high.value):
            return on_days(one.days)
        over = ", over midnight" if low.value > high.value else ""
        begins = f", beginning {on_days(one.days)}" if over else f" {on_days(one.days)}"
        return f"between {between(one.range, names)}{over}{begins if one.days else ''}"
    return f"from {describe_value(low, names)} up to {describe_value(high, names)}"


def _is_time(value: Value) -> bool:
    return isinstance(value, TimeOfDay) or (isinstance(value, Reference) and value.name == LOCAL_TIME)


def _is_member(value: Value, names: Vocabulary) -> bool:
    """Whether a value is the name of a state or a phase."""
    return (
        isinstance(value, Reference)
        and value.name not in names.signals
        and reference(value.name, names) == name(value.name)
    )
