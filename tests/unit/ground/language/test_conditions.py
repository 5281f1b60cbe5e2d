"""Every form of condition and value, and how they bind."""

from collections.abc import Callable
from typing import Any

import pytest

from rtshcua.model.ir.program import Unit

Read = Callable[[str], Unit]
Plain = Callable[[Any], Any]


def condition(plain: Plain, unit: Read, text: str) -> Any:
    (clause,) = unit(f"skill s() {{ require {text} }}").skills[0].require
    return plain(clause.condition)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a < b", {"kind": "comparison", "operator": "<", "left": "&a", "right": "&b"}),
        ("a <= -3 m", {"kind": "comparison", "operator": "<=", "left": "&a", "right": (-3_000, "length")}),
        (
            "a in 22:00 .. 06:30",
            {"kind": "within", "subject": "&a", "range": {"kind": "range", "low": "1320 min", "high": "390 min"}},
        ),
        (
            "local \t time in 5..6",
            {
                "kind": "within",
                "subject": "&local time",
                "range": {"kind": "range", "low": (5, "count"), "high": (6, "count")},
            },
        ),
        ("a in {b, c}", {"kind": "one-of", "subject": "&a", "names": ["b", "c"]}),
        ("a inside z", {"kind": "inside", "subject": "&a", "region": "&z", "negated": False}),
        (
            "1 N, 2 W outside grow(z, -5 m)",
            {
                "kind": "inside",
                "subject": (10_000_000, -20_000_000),
                "region": {"kind": "grow", "zone": "&z", "margin": (-5_000, "length")},
                "negated": True,
            },
        ),
    ],
)
def test_condition(plain: Plain, unit: Read, text: str, expected: dict[str, Any]) -> None:
    assert condition(plain, unit, text) == expected


def shape(found: Any) -> Any:
    """Only how operators nest: comparisons as the name on their left."""
    if found["kind"] == "junction":
        return (found["operator"], *(shape(operand) for operand in found["operands"]))
    if found["kind"] == "not":
        return ("not", shape(found["operand"]))
    return found["left"].removeprefix("&")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a>1 or b>1 and c>1", ("or", "a", ("and", "b", "c"))),
        ("a>1 and b>1 or c>1", ("or", ("and", "a", "b"), "c")),
        ("a>1 or b>1 or c>1", ("or", "a", "b", "c")),
        ("not a>1 or b>1", ("or", ("not", "a"), "b")),
        ("not (a>1 or b>1)", ("not", ("or", "a", "b"))),
        ("not not a>1", ("not", ("not", "a"))),
        ("(a>1 or (b>1 or c>1)) or d>1", ("or", ("or", "a", ("or", "b", "c")), "d")),
    ],
)
def test_precedence_of_conditions(plain: Plain, unit: Read, text: str, expected: Any) -> None:
    assert shape(condition(plain, unit, text)) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a + b * c", ("+", "a", ("*", "b", "c"))),
        ("a * b - c", ("-", ("*", "a", "b"), "c")),
        ("a - b - c", ("-", ("-", "a", "b"), "c")),
        ("a - (b - c)", ("-", "a", ("-", "b", "c"))),
        ("((a))", "a"),
    ],
)
def test_precedence_of_values(plain: Plain, unit: Read, text: str, expected: Any) -> None:
    def nested(found: Any) -> Any:
        if isinstance(found, str):
            return found.removeprefix("&")
        return (found["operator"], nested(found["left"]), nested(found["right"]))

    assert nested(condition(plain, unit, f"x > {text}")["right"]) == expected
