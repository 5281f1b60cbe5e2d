"""Every node that is parsed holds what its annotations say: construction does not check it (see `model/ir/node.py`)."""

from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from types import UnionType
from typing import Any, ClassVar, Literal, Union, get_args, get_origin, get_type_hints

import pytest

from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.language.parse import parse
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.program import Unit

CHECKOUT = Path(__file__).resolve().parents[3]
SOURCES = sorted(
    path
    for pattern in ("skills/*.rts", "policies/*.rts", "missions/*.rts", "tests/accepted/*.rts", "tests/rejected/*.rts")
    for path in CHECKOUT.glob(pattern)
)
HINTS: dict[type, dict[str, Any]] = {}


def fits(value: object, wanted: Any) -> bool:
    origin, inner = get_origin(wanted), get_args(wanted)
    if origin in (Union, UnionType):
        return any(fits(value, each) for each in inner)
    if origin is Literal:
        return value in inner
    if origin is tuple:
        kinds = inner[:1] * len(value) if inner[1:] == (...,) else inner  # type: ignore[arg-type]
        return type(value) is tuple and len(value) == len(kinds) and all(map(fits, value, kinds))
    if wanted is None or wanted is type(None):
        return value is None
    return isinstance(value, wanted) if issubclass(wanted, Node | Enum) else type(value) is wanted


def faults(node: Node) -> Iterator[str]:
    """The fields, of a node and of all below, that hold something else than is declared."""
    kind = type(node)
    if kind not in HINTS:
        hints = get_type_hints(kind)
        HINTS[kind] = {name: hint for name, hint in hints.items() if get_origin(hint) is not ClassVar}
    assert set(HINTS[kind]) == set(kind.__struct_fields__)
    for name, hint in HINTS[kind].items():
        value = getattr(node, name)
        if not fits(value, hint):
            yield f"{kind.__name__}.{name} is {value!r}"
        waiting = [value]
        while waiting:
            each = waiting.pop()
            if isinstance(each, Node):
                yield from faults(each)
            elif type(each) is tuple:
                waiting += each


def test_parsed_nodes_have_declared_types() -> None:
    assert len(SOURCES) > 100
    for path in (*SOURCES, CHECKOUT / "tests" / "unit" / "ground" / "language" / "forms.rts"):
        unit = parse(Source(path.name, path.read_text(encoding="utf-8", errors="replace"))).unit
        assert not list(faults(unit)), path


def test_wrong_type_is_detected() -> None:
    span = Span("x", 0, 1)
    unit = parse(Source("x", "zone a = circle(1 N, 2 E, 3 m)")).unit
    wrong = unit.copied(zones=(unit.zones[0].copied(floor=3),))
    assert list(faults(wrong)) == ["ZoneDecl.floor is 3"]
    assert list(faults(Name(span=span, text=3))) == ["Name.text is 3"]  # type: ignore[arg-type]


def test_nodes_are_values() -> None:
    span = Span("x", 0, 1)
    name = Name(span=span, text="a")
    assert name == Name(span=span, text="a") != Name(span=span, text="b")
    assert hash(name) == hash(Name(span=span, text="a"))
    assert name.copied(text="b") == Name(span=span, text="b")
    assert "span" in Unit.__struct_fields__
    assert set(Quantity.__struct_fields__) == {"span", "kind", "value", "dimension", "datum"}
    for change in (lambda: setattr(name, "text", "b"), lambda: delattr(name, "text")):
        with pytest.raises(AttributeError, match="immutable type"):
            change()
    for wrong in ({}, {"text": "a", "more": 1}):
        with pytest.raises(TypeError, match=r"Missing required argument 'text'|Unexpected keyword argument 'more'"):
            Name(span=span, **wrong)  # type: ignore[arg-type]
