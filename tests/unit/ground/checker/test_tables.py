"""The checker's tables agree with the dialect, and every code is some check's."""

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


def test_every_code_of_the_checker_is_reported_somewhere() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in GROUND.rglob("*.py"))
    names = {name for name, value in vars(codes).items() if isinstance(value, codes.Code)}
    assert [name for name in sorted(names) if name not in text] == []


def test_a_check_is_found_by_its_code() -> None:
    """The first line of a module names the codes that it reports, or their first and last."""
    heads = [path.read_text(encoding="utf-8").partition("\n")[0] for path in GROUND.rglob("*.py")]
    for group in ("E04", "E05", "E06", "E07", "E08"):
        assert any(group in head for head in heads), group
