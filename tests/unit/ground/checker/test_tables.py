"""The checker's tables agree with the dialect, and every code is reported by some module."""

import ast
from pathlib import Path

import rtshcua.ground as ground
from rtshcua.diagnostics import codes
from rtshcua.mavlink import dialect
from rtshcua.mavlink.dialect import DATUM
from rtshcua.mavlink.quantise import UNITS
from rtshcua.model.quantity import Dimension
from virtual.rows import rows

GROUND = Path(ground.__file__).parent


@rows(("message", "field"), list(DATUM))
def test_altitudes_of_known_datum_are_fields_with_a_length(message: str, field: str) -> None:
    assert dialect.load().messages[message].fields[field].unit in UNITS[Dimension.LENGTH]


def test_every_code_is_reported_by_a_module_of_the_ground() -> None:
    """A code is found by the name of its constant: each is used in at least one module."""
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in GROUND.rglob("*.py")]
    used = {name for tree in trees for node in ast.walk(tree) for name in _names(node)}
    names = {name for name, value in vars(codes).items() if isinstance(value, codes.Code)}
    assert sorted(names - used) == []


def _names(node: ast.AST) -> tuple[str, ...]:
    if isinstance(node, ast.Attribute):
        return (node.attr,)
    return (node.id,) if isinstance(node, ast.Name) else ()
