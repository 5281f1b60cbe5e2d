"""The dialect table: its contents, and agreement with pymavlink."""

import json
import subprocess
import sys

from rtshcua.codec.build_dialect import COMMAND, build_table, render
from rtshcua.mavlink import dialect
from rtshcua.mavlink.dialect import Field
from virtual.rows import rows


def test_shipped_table_is_fresh() -> None:
    assert dialect.TABLE.read_text(encoding="utf-8") == render(build_table()), f"the table is stale: run `{COMMAND}`"


def test_rendered_table_is_the_table() -> None:
    table = build_table()
    assert json.loads(render(table)) == table


@rows(
    ("message", "field", "expected"),
    [
        ("BATTERY_STATUS", "battery_remaining", Field("int8_t", 0, "%", None)),
        ("BATTERY_STATUS", "voltages", Field("uint16_t", 10, "mV", None)),
        ("BATTERY_STATUS", "voltages_ext", Field("uint16_t", 4, "mV", None)),
        ("BATTERY_STATUS", "temperature", Field("int16_t", 0, "cdegC", None)),
        ("GLOBAL_POSITION_INT", "relative_alt", Field("int32_t", 0, "mm", None)),
        ("GLOBAL_POSITION_INT", "lat", Field("int32_t", 0, "degE7", None)),
        ("GPS_RAW_INT", "fix_type", Field("uint8_t", 0, "", "GPS_FIX_TYPE")),
        ("WIND_COV", "wind_x", Field("float", 0, "m/s", None)),
        ("WIND", "speed", Field("float", 0, "m/s", None)),
        ("EKF_STATUS_REPORT", "flags", Field("uint16_t", 0, "", "EKF_STATUS_FLAGS")),
        ("STATUSTEXT", "text", Field("char", 50, "", None)),
        ("DISTANCE_SENSOR", "current_distance", Field("uint16_t", 0, "cm", None)),
    ],
)
def test_fields(message: str, field: str, expected: Field) -> None:
    assert dialect.load().messages[message].fields[field] == expected


def test_numbers_and_enumerations() -> None:
    table = dialect.load()
    assert table.messages["HEARTBEAT"].id == 0
    assert table.messages["EKF_STATUS_REPORT"].id == 193
    assert table.enums["GPS_FIX_TYPE"]["GPS_FIX_TYPE_3D_FIX"] == 3
    assert not any(entry.endswith("_ENUM_END") for entries in table.enums.values() for entry in entries)


def test_lookup_is_lazy_and_a_mapping() -> None:
    messages = dialect.load().messages
    assert messages["ATTITUDE"] is messages["ATTITUDE"]
    assert "ATTITUDE" in messages
    assert "NO_SUCH" not in messages
    assert messages.get("NO_SUCH") is None
    assert len(messages) == len(list(messages)) > 250


def test_reading_the_table_imports_no_pymavlink() -> None:
    code = (
        "import sys; from rtshcua.mavlink import dialect, quantise; dialect.load().messages['HEARTBEAT']; "
        "sys.exit(any(name.startswith('pymavlink') for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
