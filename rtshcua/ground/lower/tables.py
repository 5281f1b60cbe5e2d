"""The tables of a policy to which its code refers by index: sets of values, monitors, slots of signals, source files.

Each entry is stored once.
"""

from collections.abc import Iterable, Iterator, Mapping
from math import gcd

from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.checks.signals import selected_value, sentinel
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.name_scope import signal_type
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.types import Kind, Type
from rtshcua.mavlink.quantise import UNITS
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.limits import MAX_TEXT
from rtshcua.model.flat.policy import Monitor, MonitorKind
from rtshcua.model.flat.signal import CELL, ENUMERATION, NUMBER, POSITION, Signal, SignalSource
from rtshcua.model.ir.signals import EnumDecl, SignalDecl
from rtshcua.model.ir.signals import SourceDecl as SourceDecl
from rtshcua.model.quantity import Dimension


class ValueSets:
    """Sets of values in the order of first use, and the names of phases in them."""

    def __init__(self) -> None:
        self._numbers: dict[tuple[int, ...], int] = {}
        self._phases: dict[str, int] = {}

    @property
    def all(self) -> tuple[tuple[int, ...], ...]:
        """All sets."""
        return tuple(self._numbers)

    @property
    def phases(self) -> tuple[str, ...]:
        """The names of phases, by index."""
        return tuple(self._phases)

    def of(self, members: Iterable[int]) -> int:
        """Return the index of a set."""
        return self._numbers.setdefault(tuple(sorted(set(members))), len(self._numbers))

    def of_phases(self, names: Iterable[str]) -> int:
        """Return the index of a set of phases, which contains the index of each name."""
        return self.of([self._phases.setdefault(name, len(self._phases)) for name in names])


class MonitorTable:
    """Monitors by kind, window and code."""

    def __init__(self) -> None:
        self.all: list[Monitor] = []
        self._numbers: dict[tuple[int, int, tuple[int, ...]], int] = {}

    def of(self, kind: MonitorKind, window_us: int, when: Clause) -> int:
        """Return the index of a monitor. Equal monitors share one, with the source place of the first."""
        key = (int(kind), window_us, when.code)
        number = self._numbers.setdefault(key, len(self.all))
        if number == len(self.all):
            self.all.append(Monitor(int(kind), window_us, when))
        return number


class SignalSlots:
    """Slots of signals in the order of first use. A position has two. `cells` is the number of battery cells."""

    def __init__(self, context: CheckContext, cells: int = 1) -> None:
        self._context = context
        self._cells = cells
        self._slots: dict[str, int] = {}
        self.signals: list[Signal] = []
        self.count = 0

    def of(self, name: str) -> int:
        """Return the slot of a declared signal."""
        slot = self._slots.get(name)
        if slot is None:
            slot = self._slots[name] = self.count
            signal = self._lowered(self._context.symbols.signals[name], slot)
            self.signals.append(signal)
            self.count += 2 if signal.kind == POSITION else 1
        return slot

    def width(self, name: str) -> int:
        """Return the number of slots of a signal in the table."""
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


def enum_labels(context: CheckContext, enum: EnumDecl) -> tuple[tuple[int, str], ...]:
    """Return every value of an enumeration with its name, in order. Declared names replace those of the dialect."""
    labels: dict[int, str] = {}
    if enum.dialect is not None:
        entries = context.dialect.enums[enum.dialect.text]
        labels = {value: name.lower() for name, value in entries.items()}
    labels.update((member.value, member.name.text) for member in enum.members)
    return tuple(sorted(labels.items()))


def shortened(text: str) -> str:
    """Return a text shortened to the limit on board."""
    return text if len(text) <= MAX_TEXT else text[: MAX_TEXT - 3] + "..."


class SourceTable:
    """File names by index, in the order of first use. `stable` maps them to their names in signed artefacts."""

    def __init__(self, report: Report, stable: Mapping[str, str]) -> None:
        self._report = report
        self._stable = stable
        self._index: dict[str, int] = {}

    def index(self, file: str) -> int:
        """Return the index of a file."""
        return self._index.setdefault(file, len(self._index))

    def place(self, span: Span) -> tuple[str, int, int, int]:
        """Return a span in the flat form: its text, the index of its file, its start and its end."""
        return shortened(self._report.text(span)), self.index(span.file), span.start, span.end

    def span(self, file: int, start: int, end: int) -> Span:
        """Return the span of a place in the flat form."""
        return Span(tuple(self._index)[file], start, end)

    def text(self, span: Span) -> str:
        """Return the whole text of a span, on one line."""
        return self._report.text(span)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the files in signed artefacts."""
        return tuple(self._stable.get(name, name) for name in self._index)

    @property
    def digests(self) -> tuple[bytes, ...]:
        """The SHA-256 of each file's text in UTF-8."""
        return tuple(self._report.digest(name) for name in self._index)


class JointSourceTable(SourceTable):
    """The files of a policy, followed by those of a mission, to which a step's own clauses refer.

    On board, in bundles and in logs, the `source` of a clause is an index into both lists together.
    """

    def __init__(self, policy: SourceTable, mission: SourceTable) -> None:
        super().__init__(policy._report, mission._stable)
        self._policy = policy
        self._mission = mission

    def index(self, file: str) -> int:
        """Return the index of a file."""
        own = self._policy._index.get(file)
        return len(self._policy._index) + self._mission.index(file) if own is None else own

    def span(self, file: int, start: int, end: int) -> Span:
        """Return the span of a place in the flat form."""
        first = len(self._policy._index)
        return self._policy.span(file, start, end) if file < first else self._mission.span(file - first, start, end)
