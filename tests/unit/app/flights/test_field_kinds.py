"""Every field of a report has a kind, and what a redacted report keeps of it is what the kind says."""

import types
from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from enum import Enum
from itertools import count
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

import pytest

from rtshcua.app.flights.flight_reading import read_flight
from rtshcua.app.flights.redaction import REDACTABLE, Redaction
from rtshcua.ground.flight.field_kinds import KINDS, FieldKind, fields_of
from rtshcua.ground.flight.flight_content import FlightReport
from rtshcua.ground.flight.flown import Flight

#: kinds that stay whatever is removed
ALWAYS = {FieldKind.MACHINE, FieldKind.TIME, FieldKind.HEIGHT, FieldKind.VALUE, FieldKind.LOG}
#: and those that stay with names, or with places
NAMED = {FieldKind.NAME, FieldKind.WORD, FieldKind.CALL, FieldKind.SOURCE, FieldKind.TEXT}
PLACED = {FieldKind.PLACE, FieldKind.NO_PLACE}


def parts(hint: Any) -> Iterator[type]:
    """The record types in a type hint."""
    if hint in KINDS or (isinstance(hint, type) and fields_of(hint)):
        yield hint
    for each in get_args(hint):
        yield from parts(each)


def reached(of: type) -> set[type]:
    found, todo = set[type](), [of]
    while todo:
        each = todo.pop()
        if each not in found:
            found.add(each)
            todo += [part for hint in get_type_hints(each).values() for part in parts(hint)]
    return found


def test_table_has_every_field_of_every_type_of_a_report() -> None:
    assert reached(FlightReport) == set(KINDS)
    for of, kinds in KINDS.items():
        assert tuple(sorted(kinds)) == tuple(sorted(fields_of(of)))


class Planter:
    """Makes a value of a type in which every text and number is one that is nowhere else."""

    def __init__(self, signal: str) -> None:
        self.number = count(7_000_001)
        self.kinds: dict[str, FieldKind] = {}
        self._signal = signal

    def part(self, of: type, under: FieldKind = FieldKind.PART) -> Any:
        values = {}
        for name, hint in get_type_hints(of).items():
            if name not in KINDS[of]:
                continue
            kind = under if under in (*PLACED, FieldKind.OUTSIDE) else KINDS[of][name]
            if name == "name" and kind is FieldKind.WORD:
                values[name] = self._signal  # others are left out as a whole
            else:
                values[name] = self.value(hint, kind)
        return of(**values)

    def value(self, hint: Any, kind: FieldKind) -> Any:
        of, arguments = get_origin(hint), get_args(hint)
        if of in (Union, types.UnionType):
            return self.value(next(each for each in arguments if each is not type(None)), kind)
        if of is tuple:
            return tuple(self.value(each, kind) for each in arguments if each is not Ellipsis)
        if of is Mapping:
            return {1: self.value(arguments[1], kind)}
        if hint in KINDS:
            return self.part(hint, kind)
        if hint is bool:
            return True
        if isinstance(hint, type) and issubclass(hint, Enum):
            return next(iter(hint))
        number = next(self.number)
        mark = f"zq{number}zq"
        self.kinds[mark if hint is str else str(number)] = kind
        if hint is str:
            return f"ours `{mark}` 12 m" if kind is FieldKind.TEXT else mark
        return number


def told(value: Any) -> Iterator[str]:
    """All texts and numbers of a value, as texts."""
    if isinstance(value, Mapping):
        for each in value.values():
            yield from told(each)
    elif type(value) in KINDS:
        for name in fields_of(type(value)):
            yield from told(getattr(value, name))
    elif isinstance(value, tuple):
        for each in value:
            yield from told(each)
    elif is_dataclass(value):
        raise AssertionError(type(value))
    else:
        yield str(value)


@pytest.mark.parametrize("removed", [("position",), ("names",), REDACTABLE])
def test_planted_texts_and_numbers_stay_only_by_their_kind(completed: Path, removed: tuple[str, ...]) -> None:
    flight = read_flight(completed / "log.jsonl")
    assert isinstance(flight, Flight)
    planter = Planter("battery")
    planted = planter.part(FlightReport)
    redaction = Redaction(flight, ("ada",), removed)
    kept = " ".join(told(redaction.report(planted, flight)))
    stay = ALWAYS | (set() if "names" in removed else NAMED - {FieldKind.TEXT, FieldKind.CALL})
    stay |= set() if "position" in removed else PLACED
    found = {mark: kind for mark, kind in planter.kinds.items() if mark in kept}
    assert len(planter.kinds) > 100
    assert set(found.values()) <= stay
    missing = {kind for mark, kind in planter.kinds.items() if mark not in found and kind in ALWAYS}
    assert missing <= {FieldKind.MACHINE, FieldKind.TIME}  # of the listed records, which are told anew
    if "position" in removed:
        assert "12 m" not in kept
