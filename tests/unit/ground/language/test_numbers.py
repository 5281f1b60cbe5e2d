"""Numbers are read exactly or refused."""

from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.parse import parse
from virtual.rows import rows

NUMBERS = (
    ("20 m", True), ("2_0 m", True), ("1_000_000 mm", True), ("20.5 m", True), ("20.5_0 m", True),
    ("20 /* 1 */ m", True), ("0_" * 63 + "1 m", True), ("0_" * 64 + "1 m", False),
    ("20_ m", False), ("_20 m", False), ("2__0 m", False), ("20._5 m", False), ("20.5_ m", False), ("20. m", False),
    (".5 m", False), ("2 0 m", False), ("20_m", False), ("1e2 m", False), ("20.5.5 m", False), ("0x14 m", False),
    ("\uff12\uff10 m", False), ("20_.5 m", False), ("+20 m", False),
)  # fmt: skip


@rows("written, read", NUMBERS)
def test_invalid_number_is_reported(written: str, read: bool) -> None:
    source = "skill s() {\n  require height <= " + written + "\n  maintain height <= 1 m\n}\n"
    assert (parse(Source("x", source)).diagnostics == ()) is read


PLACES = (
    ("47.39774, 8.54659, altitude = 10 m", ["47.39774 N, 8.54659 E"]),
    ("-47.5, -8.54659, altitude = 10 m", ["47.5 S, 8.54659 W"]),
    ("target = 47.39774, 8.54659", ["47.39774 N, 8.54659 E"]),
    ("47, 8.54659, 10.5)  hover(1.5", ["47 N, 8.54659 E", "", ""]),
    ("97.5, 8.5", ["", ""]),
    ("altitude = 1.5", [""]),
    ("47.39774 N, 8.54659 E", []),
)  # fmt: skip


@rows("given, meant", PLACES)
def test_two_plain_numbers_are_reported_once_as_coordinates(given: str, meant: list[str]) -> None:
    text = f"mission m under p@1 on quad {{ phase a {{ goto({given}) }} }}"
    found = [each for each in parse(Source("x", text)).diagnostics if each.code.id == "E0302"]
    assert [each.fixes[0].replacement if each.fixes else "" for each in found] == meant
    for each in found:
        if each.fixes:
            assert each.help == f"for a place, write `{each.fixes[0].replacement}`"
            assert each.span == each.fixes[0].span
            assert "," in text[each.fixes[0].span.start : each.fixes[0].span.end]
