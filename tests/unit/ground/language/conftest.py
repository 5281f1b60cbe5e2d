"""Helpers of the language's tests: parse a text, and make its nodes comparable."""

from collections.abc import Callable
from typing import Any

import pytest

from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.parse import parse
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.program import Unit


def read(text: str) -> Unit:
    parsed = parse(Source("x.rts", text))
    assert parsed.diagnostics == (), parsed.diagnostics
    assert parsed.broken == frozenset()
    return parsed.unit


def flat(node: Any) -> Any:
    """A node as nested tuples and dicts: names as their text, quantities as `value dimension datum`, no spans."""
    if isinstance(node, tuple):
        return [flat(item) for item in node]
    if not isinstance(node, Node):
        return node
    kind = type(node).__name__
    if kind == "Name":
        return node.text
    if kind == "Reference":
        return f"&{node.name}"
    if kind == "Quantity":
        return (node.value, node.dimension.value) + ((node.datum.value,) if node.datum else ())
    if kind == "Coordinates":
        return (node.latitude, node.longitude)
    if kind == "TimeOfDay":
        return f"{node.value // 60_000_000} min"
    found = {name: flat(getattr(node, name)) for name in type(node).__struct_fields__ if name != "span"}
    return {name: value for name, value in found.items() if value not in (None, [])}


@pytest.fixture(name="unit")
def read_unit() -> Callable[[str], Unit]:
    """Reads a text that must be without findings."""
    return read


@pytest.fixture(name="plain")
def make_plain() -> Callable[[Any], Any]:
    """Makes nodes comparable: see `flat`."""
    return flat
