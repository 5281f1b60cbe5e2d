"""Numbers are read as they are written, or not at all."""

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
def test_number(written: str, read: bool) -> None:
    source = "skill s() {\n  require height <= " + written + "\n  maintain height <= 1 m\n}\n"
    assert (parse(Source("x", source)).diagnostics == ()) is read
