"""Every shared layout, number and mode agrees with pymavlink's dialect."""

from random import Random
from types import ModuleType

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as dialect

from rtshcua.mavlink import command_results, enums, layouts
from rtshcua.mavlink.layouts import LAYOUTS, Layout
from rtshcua.mavlink.modes import COPTER_NAMES, PX4_NAMES, CopterMode, Px4Mode
from virtual.rows import rows


def numbers(of: ModuleType) -> dict[str, int]:
    return {name: value for name, value in vars(of).items() if name.isupper() and isinstance(value, int)}


MESSAGES = {name: value for name, value in numbers(layouts).items() if name not in {"HEADER", "TEXT_OCTETS"}}
#: of the development dialect, or newer than pymavlink
NEWER = {
    "COMMAND_CANCEL": 80, "PROTOCOL_VERSION": 300, "CONTROL_STATUS": 512, "MAV_CMD_REQUEST_OPERATOR_CONTROL": 32_100,
    "CANCELLED": 6,
}  # fmt: skip
OWN_WORDS = {"POSITION_ONLY", "POSITION_AND_YAW", "NO_PLACE"}
IGNORED = ("VX", "VY", "VZ", "AX", "AY", "AZ", "YAW", "YAW_RATE")


def test_messages_have_the_dialects_numbers() -> None:
    theirs = {name: getattr(dialect, f"MAVLINK_MSG_ID_{name}", NEWER.get(name)) for name in MESSAGES}
    assert theirs == MESSAGES
    assert set(theirs.values()) >= LAYOUTS.keys()


@rows(("number", "layout"), LAYOUTS.items(), ids=[name for name, number in MESSAGES.items() if number in LAYOUTS])
def test_layouts_are_the_dialects(number: int, layout: Layout) -> None:
    kind = dialect.mavlink_map[number]
    assert layout.names == tuple(kind.ordered_fieldnames)
    assert layout.extra == kind.crc_extra
    assert layout.fields.size == kind.unpacker.size
    octets = Random(number).randbytes(layout.fields.size)
    for at in range(layout.fields.size):  # a changed octet changes the same field: types and offsets are the same
        turned = octets[:at] + bytes([octets[at] ^ 0xFF]) + octets[at + 1 :]
        assert repr(layout.fields.unpack(turned)) == repr(kind.unpacker.unpack(turned))


@rows("layout", LAYOUTS.values(), ids=MESSAGES)
def test_target_fields_are_system_then_component(layout: Layout) -> None:
    system, component = layout.at("target_system"), layout.at("target_component")
    assert component == (system + 1 if system >= 0 else -1)


def test_fields_are_taken_by_name_and_zeros_at_the_end_need_not_be_there() -> None:
    layout = LAYOUTS[layouts.MISSION_COUNT]
    frame = bytes([0xFD, 3, *bytes(8)]) + b"\x02\x01\x07" + b"\0\0"
    assert layout.read(frame) == (0x102, 7, 0, 0)
    assert layout.getter("target_system count")(layout.read(frame)) == (7, 0x102)
    assert layout.getter("count")(layout.read(frame)) == 0x102


@rows(("name", "value"), numbers(enums).items(), ids=numbers(enums))
def test_numbers_are_the_dialects(name: str, value: int) -> None:
    if name not in OWN_WORDS:
        assert value == getattr(dialect, name, NEWER.get(name))


def test_results_of_commands_are_the_dialects() -> None:
    found = numbers(command_results)
    assert found == {name: getattr(dialect, f"MAV_RESULT_{name}", NEWER.get(name)) for name in found}


def test_position_mask_ignores_all_other_fields() -> None:
    assert sum(getattr(dialect, f"POSITION_TARGET_TYPEMASK_{each}_IGNORE") for each in IGNORED) == enums.POSITION_ONLY
    assert enums.POSITION_ONLY - enums.POSITION_AND_YAW == dialect.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    assert enums.NO_PLACE == 2**31 - 1


def test_arducopters_modes_are_the_dialects() -> None:
    theirs = {mode.name: getattr(dialect, f"COPTER_MODE_{mode.name}") for mode in CopterMode}
    assert theirs == dict(CopterMode.__members__)
    assert {mode: mavutil.mode_mapping_acm[mode] for mode in CopterMode} == COPTER_NAMES
    assert all(mode.parameters == (mode, 0) for mode in CopterMode)


#: pymavlink's name of a mode, and PX4's own if it differs; pymavlink lacks ORBIT and PRECISION_LAND
PX4_NAMED = {"ALTCTL": "ALTITUDE", "POSCTL": "POSITION", "LOITER": "HOLD", "RTL": "RETURN", "FOLLOWME": "FOLLOW"}
NOT_OURS = {"RATTITUDE", "RTGS"}


def test_px4s_modes_are_those_that_pymavlink_knows() -> None:
    theirs = {
        PX4_NAMED.get(name, name): (main, sub)
        for name, (_, main, sub) in mavutil.px4_map.items()
        if name not in NOT_OURS
    }
    ours = {mode.name: mode.parameters for mode in Px4Mode}
    assert ours == {**theirs, "ORBIT": (3, 1), "PRECISION_LAND": (4, 9)}
    assert all(mode == main << 16 | sub << 24 for mode in Px4Mode for main, sub in [mode.parameters])
    assert PX4_NAMES[Px4Mode.PRECISION_LAND] == "Precision Land"
    assert PX4_NAMES[Px4Mode.HOLD] == "Hold"
