"""Signals and enumerations in words: what the vehicle reports, where it comes from, and how long it counts."""

from typing import Final

from rtshcua.ground.report.words.vocabulary import listed, name
from rtshcua.model.ir.signals import EnumDecl, SignalDecl, SignalSource
from rtshcua.model.quantity import Dimension, display

_TYPES: Final = {
    "position": "a place on the ground",
    "altitude": "a height above home",
    "length": "a length",
    "speed": "a speed",
    "duration": "a duration",
    "ratio": "a part of a whole",
    "angle": "an angle",
    "voltage": "a voltage",
    "count": "a number",
}


def told_type(signal: SignalDecl) -> str:
    """What a signal measures."""
    return _TYPES.get(signal.type.text, f"one of the states of {name(signal.type.text)}")


def told_sources(signal: SignalDecl) -> str:
    """The MAVLink fields that it is read from."""
    words = listed([_source(each) for each in signal.sources], "or")
    return words if len(signal.sources) == 1 else f"{words}, whichever is newer"


def _source(source: SignalSource) -> str:
    where = listed([f"{name(each.field.text)} is {name(each.value.text)}" for each in source.where])
    words = f"{name(source.message.text)} field {listed([name(field.text) for field in source.fields])}"
    return f"{words}, where {where}" if where else words


def told_unknown(signal: SignalDecl) -> str:
    """When its value counts as not known."""
    stale = f"when older than {display(signal.stale_after.value, Dimension.DURATION)}"
    if not signal.unknown_at:
        return stale
    return f"{stale}, and when it reads {listed([name(each.text) for each in signal.unknown_at], 'or')}"


def told_members(enum: EnumDecl) -> str:
    """The states of an enumeration in their order, with the numbers that stand for them."""
    return ", ".join(
        f"{name(each.name.text)} ({each.value})" for each in sorted(enum.members, key=lambda one: one.value)
    )
