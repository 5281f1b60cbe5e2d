"""State slots for the signals that a policy reads, and the signals as the state monitor needs them."""

from collections.abc import Iterator
from math import gcd

from rtshcua.ground.checker.checks.signals import selected_value, sentinel
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.scope import signal_type
from rtshcua.ground.checker.types import Kind, Type
from rtshcua.mavlink.quantise import UNITS
from rtshcua.model.flat.signal import CELL, ENUMERATION, NUMBER, POSITION, Signal, SignalSource
from rtshcua.model.ir.signals import EnumDecl, SignalDecl
from rtshcua.model.ir.signals import SignalSource as SourceDecl
from rtshcua.model.quantity import Dimension


class Slots:
    """Slots in the order in which signals are first asked for; a position has two. `cells` are those of the battery."""

    def __init__(self, context: Context, cells: int = 1) -> None:
        self._context = context
        self._cells = cells
        self._slots: dict[str, int] = {}
        self.signals: list[Signal] = []
        self.count = 0

    def of(self, name: str) -> int:
        """The slot of a declared signal."""
        slot = self._slots.get(name)
        if slot is None:
            slot = self._slots[name] = self.count
            signal = self._lowered(self._context.symbols.signals[name], slot)
            self.signals.append(signal)
            self.count += 2 if signal.kind == POSITION else 1
        return slot

    def width(self, name: str) -> int:
        """How many slots a signal has that was asked for."""
        slot = self._slots[name]
        return next(2 if each.kind == POSITION else 1 for each in self.signals if each.slot == slot)

    def _lowered(self, declared: SignalDecl, slot: int) -> Signal:
        type = signal_type(self._context.symbols, declared)
        assert type is not None
        enum = self._context.symbols.enums.get(declared.type.text)
        if enum is not None:
            kind, dimension = ENUMERATION, enum.name.text
        elif type.kind is Kind.POSITION:
            kind, dimension = POSITION, "position"
        else:
            assert type.dimension is not None
            kind, dimension = NUMBER, type.dimension.value
        return Signal(
            name=declared.name.text,
            slot=slot,
            kind=kind,
            dimension=dimension,
            stale_us=declared.stale_after.value,
            labels=() if enum is None else enum_labels(self._context, enum),
            sources=tuple(self._source(declared, source, type, enum) for source in declared.sources),
        )

    def _source(self, declared: SignalDecl, source: SourceDecl, type: Type, enum: EnumDecl | None) -> SignalSource:
        members = {} if enum is None else {member.name.text: member.value for member in enum.members}
        numerator, denominator = 1, 1
        if type.kind is Kind.NUMBER:
            assert type.dimension is not None
            dimension = Dimension.LENGTH if type.dimension is Dimension.ALTITUDE else type.dimension
            field = self._context.dialect.messages[source.message.text].fields[source.fields[0].text]
            numerator, denominator = UNITS[dimension][field.unit]
            if declared.name.text == CELL:
                denominator *= self._cells
        common = gcd(numerator, denominator)
        marks = (sentinel(name.text, members) for name in declared.unknown_at)
        return SignalSource(
            message=source.message.text,
            fields=tuple(name.text for name in source.fields),
            numerator=numerator // common,
            denominator=denominator // common,
            unknown=tuple(sorted({mark for mark in marks if mark is not None})),
            where=tuple(sorted(self._selected(source))),
        )

    def _selected(self, source: SourceDecl) -> Iterator[tuple[str, int]]:
        for each in source.where:
            value = selected_value(self._context.dialect, source.message.text, each)
            assert value is not None
            yield each.field.text, value


def enum_labels(context: Context, enum: EnumDecl) -> tuple[tuple[int, str], ...]:
    """Every value of an enumeration with its name, by value: the declared ones, then what else the dialect knows."""
    labels: dict[int, str] = {}
    if enum.dialect is not None:
        entries = context.dialect.enums[enum.dialect.text]
        labels = {value: name.lower() for name, value in entries.items()}
    labels.update((member.value, member.name.text) for member in enum.members)
    return tuple(sorted(labels.items()))
