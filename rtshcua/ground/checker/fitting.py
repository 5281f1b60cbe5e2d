"""Check a value against an expected type, and suggest the unit or datum that fits."""

from fractions import Fraction
from math import floor

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.name_scope import Argument, Scope
from rtshcua.ground.checker.types import COUNT, EXAMPLES, LENGTH, POSITION, Kind, Type, Typed
from rtshcua.ground.language.exact_values import CANONICAL
from rtshcua.model.ir.expression import Quantity, Reference, Value
from rtshcua.model.ir.places import ENTRY, ZoneDecl
from rtshcua.model.ir.signals import SignalDecl
from rtshcua.model.quantity import UNITS, Datum, Dimension, display


def fit(scope: Scope, node: Value, found: Typed, expected: Type, asked: tuple[Span, str] | None = None) -> Typed | None:
    """Return `found` as a value of type `expected`; a constant length may become an altitude above home."""
    if found.type == expected:
        return found
    is_altitude = expected.dimension is Dimension.ALTITUDE
    if is_altitude and found.type == LENGTH and found.constant is not None and expected.datum is Datum.HOME:
        return Typed(expected, found.constant)
    datum = is_altitude and (
        found.type.dimension is Dimension.ALTITUDE or (found.type == LENGTH and found.constant is not None)
    )
    if datum:
        here = "above home" if found.type == LENGTH else f"above {found.type.datum.value}"  # type: ignore[union-attr]
        message = f"`{scope.report.text(node.span)}` is {here}; expected {expected.describe()}"
    else:
        message = f"expected {expected.describe()}; `{scope.report.text(node.span)}` is {found.type.describe()}"
    replacement = _corrected(scope, node, found, expected)
    scope.report.add(
        codes.DATUM_MISMATCH
        if datum
        else codes.DIMENSION_MISMATCH
        if _numbers(found.type, expected)
        else codes.WRONG_TYPE,
        node.span,
        message,
        help=_accepted(scope, node, expected, replacement),
        labels=[*declaration_labels(scope, node), *(() if asked is None else (asked,))],
        fix=None if replacement is None else (node.span, replacement, f"write `{replacement}`"),
    )
    return None


def stored(scope: Scope, node: Value, type: Type, constant: Fraction) -> int | None:
    """Return a constant as a whole canonical number; None after a finding if it is not whole."""
    if constant.denominator == 1:
        return constant.numerator
    assert type.dimension is not None
    unit = CANONICAL[Dimension.LENGTH if type.dimension is Dimension.ALTITUDE else type.dimension]
    below = floor(constant)
    near = " and ".join(f"`{display(each, type.dimension)}`" for each in (below, below + 1))
    plain = type.dimension is Dimension.COUNT
    kept = "a number without a unit must be whole" if plain else f"{type.describe()} must be whole {unit}"
    scope.report.add(
        codes.NOT_EXACT,
        node.span,
        f"`{scope.report.text(node.span)}` is not a whole number" + (f" of {unit}" if unit else ""),
        help=f"{kept}; the nearest are {near}",
    )
    return None


def _numbers(left: Type, right: Type) -> bool:
    return left.kind is Kind.NUMBER and right.kind is Kind.NUMBER


def _accepted(scope: Scope, node: Value, expected: Type, replacement: str | None) -> str:
    if expected == POSITION:
        zone = scope.find(node.name) if isinstance(node, Reference) else None
        if replacement is not None:
            return f"write `{replacement}` for the entry of the zone"
        if isinstance(zone, ZoneDecl):
            return f"add an `entry` to the zone `{zone.name.text}`, or write coordinates"
        return "write coordinates, as in `47.3977 N, 8.5456 E`, or a zone's entry, as in `bridge.entry`"
    if replacement is not None:
        return f"did you mean `{replacement}`?"
    if expected.kind is Kind.NUMBER and expected.dimension is not None:
        example = EXAMPLES[expected.dimension] + (" above sea" if expected.datum is Datum.SEA else "")
        return f"write {expected.describe()}, such as `{example}`"
    if expected.enumeration is not None:
        return "its values are " + ", ".join(f"`{member}`" for member in expected.enumeration.members)
    return f"write {expected.describe()}"


def _corrected(scope: Scope, node: Value, found: Typed, expected: Type) -> str | None:
    """The probable correction: the literal with the expected unit or datum, or a zone's entry."""
    zone = scope.find(node.name) if isinstance(node, Reference) and expected == POSITION else None
    if isinstance(zone, ZoneDecl):
        return None if zone.entry is None else f"{zone.name.text}{ENTRY}"
    if not isinstance(node, Quantity) or expected.kind is not Kind.NUMBER or expected.dimension is None:
        return None
    written = scope.report.text(node.span)
    if found.type == LENGTH and expected.dimension is Dimension.ALTITUDE:
        return f"{written} above {Datum.SEA.value}"
    if found.type == COUNT:
        return f"{written} {EXAMPLES[expected.dimension].split()[-1]}"
    if found.type == LENGTH and expected.dimension is Dimension.SPEED:
        unit = next((name for name in sorted(UNITS, key=len, reverse=True) if written.endswith(name)), "")
        return f"{written}/s" if f"{unit}/s" in UNITS else None
    return None


def declaration_labels(scope: Scope, node: Value) -> list[tuple[Span, str]]:
    """A label at the declaration of a name, if the value is a single name."""
    if not isinstance(node, Reference):
        return []
    found = scope.find(node.name)
    if isinstance(found, Argument):
        return [(found.declaration.span, f"`{node.name}` is declared here")]
    if isinstance(found, SignalDecl | ZoneDecl):
        return [(found.name.span, f"`{node.name}` is declared here")]
    return []
