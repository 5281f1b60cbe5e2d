"""Enumerations and signals."""

from typing import Any

from rtshcua.diagnostics.codes import SYNTAX
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.build.base import Part
from rtshcua.ground.language.build.conditions import Conditions
from rtshcua.ground.language.wording import short
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.signals import EnumDecl, Enumerator, Selected, SignalDecl, SignalSource


class Signals(Conditions):
    """What the vehicle reports."""

    def enumerator(self, span: Span, name: Name, value: int) -> Enumerator:
        """`fix_3d = 3`."""
        self.undotted(name, "value")
        return Enumerator(span=span, name=name, value=value)

    def enumerators(self, span: Span, *members: Enumerator) -> tuple[Enumerator, ...]:
        """Members with commas between them."""
        return members

    def enum(self, span: Span, name: Name, dialect: Name | None, members: tuple[Enumerator, ...] | None) -> None:
        """`enum gps_fix = GPS_FIX_TYPE { ... }`."""
        self.undotted(name, "enumeration")
        self.declare(EnumDecl(span=span, name=name, dialect=dialect, members=members or ()), name)

    def sentinel(self, span: Span, *parts: str) -> Name:
        """A raw value or an enumerator that means "not known"."""
        return Name(span=span, text="".join(parts))

    def sentinels(self, span: Span, *names: Name) -> tuple[Name, ...]:
        """Sentinels with commas between them."""
        return names

    def selected(self, span: Span, field: Name, value: Name) -> Selected:
        """`orientation = 0`."""
        self.undotted(field, "field")
        return Selected(span=span, field=field, value=value)

    def selector(self, span: Span, *selected: Selected) -> tuple[Selected, ...]:
        """`where id = 0 and orientation = 0`."""
        return selected

    def source(self, span: Span, *parts: Any) -> SignalSource:
        """`GPS_RAW_INT.fix_type`, or two fields of one message; which of the messages count stands last."""
        paths: tuple[Name, ...] = tuple(part for part in parts if isinstance(part, Name))
        where = parts[-1] if isinstance(parts[-1], tuple) else ()
        messages, fields = zip(*map(self._field, paths), strict=True)
        for other in messages[1:]:
            if other.text != messages[0].text:
                self.report(
                    SYNTAX,
                    f"one source reads one message, not `{short(messages[0].text)}` and `{short(other.text)}`",
                    span,
                    "`or` goes between alternatives of different messages",
                )
        if len(fields) > 2:
            self.report(SYNTAX, f"a source has one field or two, not {len(fields)}", span, "write one field, or a pair")
        return SignalSource(span=span, message=messages[0], fields=fields[:2], where=where)

    def unknown(self, span: Span, names: tuple[Name, ...]) -> Part:
        """`unknown at -1, no_fix`."""
        return Part("unknown at", span, names)

    def stale(self, span: Span, time: Quantity) -> Part:
        """`stale after 5 s`."""
        return Part("stale after", span, time)

    def signal(self, span: Span, name: Name, type: Name, *rest: SignalSource | Part) -> None:
        """`signal battery : ratio = BATTERY_STATUS.battery_remaining unknown at -1 stale after 5 s`."""
        sources = tuple(item for item in rest if isinstance(item, SignalSource))
        given = [item for item in rest if isinstance(item, Part)]
        found = self.parts("signal", name, given, ("stale after",))
        if self.sound:
            unknown = found["unknown at"].value if "unknown at" in found else ()
            stale = found["stale after"].value
            decl = SignalDecl(span=span, name=name, type=type, sources=sources, unknown_at=unknown, stale_after=stale)
            self.declare(decl, name)
        else:
            self.abandon(name)

    def _field(self, path: Name) -> tuple[Name, Name]:
        """The message and the field of `MESSAGE.field`, each with its own place."""
        message, dot, field = path.text.partition(".")
        if not dot or "." in field:
            self.report(
                SYNTAX,
                f"`{short(path.text)}` does not name a message and its field",
                path.span,
                "write the message, a dot and the field, as in `GPS_RAW_INT.fix_type`",
            )
        file, start, end = path.span
        middle = start + len(message)
        first = Name(span=Span(file, start, middle), text=message)
        return first, Name(span=Span(file, min(middle + 1, end), end), text=field)
