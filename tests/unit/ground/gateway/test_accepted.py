"""What the library accepts of MAVLink: the table by hand, and frames of clients that give the arguments that are meant.

The frames are made by hand (`takeoff` .. `emergency_land`), as the documentation of MAVLink and of both autopilots has
them; they know nothing of the table. They are read back twice: by a reader of the table that was written apart
(`translated`), and by the gateway's own translation.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from math import inf, isnan, nan
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from reference.gateway_world import DEFAULTS, ROWS
from rtshcua.decision.prepare import PreparedPolicy, prepare
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.symbols import collect
from rtshcua.ground.gateway.accepted import (
    COMMAND,
    ITEM,
    MESSAGE,
    MODE,
    AcceptedCommand,
    ArgumentSource,
    FixedField,
    accepted_commands,
)
from rtshcua.ground.gateway.client_frames import received as decoded
from rtshcua.ground.gateway.interface import GatewaySettings, ProposedStep
from rtshcua.ground.gateway.translation import Translation
from rtshcua.ground.gateway.vehicle_seen import VehicleSeen
from rtshcua.ground.language.load import Program, load
from rtshcua.ground.pipeline.program import compile_program
from rtshcua.mavlink import dialect
from rtshcua.mavlink.modes import ARDUPILOT, PX4
from rtshcua.mavlink.quantise import quantise
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import State
from rtshcua.model.flat.zone import project

CHECKOUT = Path(__file__).resolve().parents[4]
#: the height of home above sea, mm
HOME = 488_123
INT32_MAX = (1 << 31) - 1

UNSET = (FixedField("param5", None), FixedField("param6", None))
AT_ZERO = (FixedField("param5", 0), FixedField("param6", 0))
PLACE = ("param5", "param6")
TAKEOFF_ALTITUDE = "MIS_TAKEOFF_ALT above home"
SPEED = ArgumentSource("speed", ("param1",), 1000, "", "default")


def height(datum: str, otherwise: str = "", field: str = "param7") -> ArgumentSource:
    return ArgumentSource("altitude", (field,), 1000, datum, otherwise)


def target(otherwise: str = "") -> ArgumentSource:
    return ArgumentSource("target", PLACE, 10_000_000, "", otherwise)


TIME = ArgumentSource("time", ("param1",), 1_000_000, "", "")
#: by skill: kind, name, number, autopilot, fixed fields, arguments
BY_HAND: Mapping[str, list[tuple[Any, ...]]] = {
    "takeoff": [
        (COMMAND, "MAV_CMD_NAV_TAKEOFF", 22, "px4", (), (height("sea", TAKEOFF_ALTITUDE),)),
        (COMMAND, "MAV_CMD_NAV_TAKEOFF", 22, "ardupilot", (), (height("home"),)),
        (ITEM, "MAV_CMD_NAV_TAKEOFF", 22, "", (), (height("frame"),)),
        (MODE, "TAKEOFF", 33_816_576, "px4", (), (ArgumentSource("altitude", (), 1000, "", TAKEOFF_ALTITUDE),)),
    ],
    "goto": [
        (COMMAND, "MAV_CMD_DO_REPOSITION", 192, "", (), (target(), height("frame", "here"), SPEED)),
        (COMMAND, "MAV_CMD_DO_REPOSITION", 192, "", (), (target("here"), height("frame"), SPEED)),
        (ITEM, "MAV_CMD_NAV_WAYPOINT", 16, "", (), (target(), height("frame"))),
        (
            MESSAGE,
            "SET_POSITION_TARGET_GLOBAL_INT",
            86,
            "",
            (FixedField("type_mask", 504, 504), FixedField("type_mask", 0, 7)),
            (ArgumentSource("target", ("lat_int", "lon_int"), 1, "", ""), height("frame", field="alt")),
        ),
    ],
    "hover": [
        (COMMAND, "MAV_CMD_DO_PAUSE_CONTINUE", 193, "", (FixedField("param1", 0),), ()),
        (COMMAND, "MAV_CMD_NAV_LOITER_UNLIM", 17, "", (), ()),
        (COMMAND, "MAV_CMD_DO_REPOSITION", 192, "", (*UNSET, FixedField("param7", None)), ()),
        (ITEM, "MAV_CMD_NAV_LOITER_TIME", 19, "", AT_ZERO, (TIME,)),
        (ITEM, "MAV_CMD_NAV_LOITER_TIME", 19, "", UNSET, (TIME,)),
        (MODE, "HOLD", 50_593_792, "px4", (), ()),
        (MODE, "LOITER", 5, "ardupilot", (), ()),
        (MODE, "POSHOLD", 16, "ardupilot", (), ()),
        (MODE, "BRAKE", 17, "ardupilot", (), ()),
    ],
    "return_home": [
        (COMMAND, "MAV_CMD_NAV_RETURN_TO_LAUNCH", 20, "", (), ()),
        (ITEM, "MAV_CMD_NAV_RETURN_TO_LAUNCH", 20, "", (), ()),
        (MODE, "RETURN", 84_148_224, "px4", (), ()),
        (MODE, "RTL", 6, "ardupilot", (), ()),
    ],
    "emergency_land": [
        (COMMAND, "MAV_CMD_NAV_LAND", 21, "", (), ()),
        (ITEM, "MAV_CMD_NAV_LAND", 21, "", AT_ZERO, ()),
        (ITEM, "MAV_CMD_NAV_LAND", 21, "", UNSET, ()),
        (MODE, "LAND", 100_925_440, "px4", (), ()),
        (MODE, "LAND", 9, "ardupilot", (), ()),
    ],
}


@cache
def program() -> Program:
    return load([str(CHECKOUT / "missions" / "standard.rts")], lambda path: Path(path).read_bytes(), str(CHECKOUT))


@cache
def policy() -> Policy:
    compiled = compile_program(program(), dialect.load(), mission="standard", issued_at_us=0)
    assert compiled.policy is not None, compiled.diagnostics
    return compiled.policy


@cache
def table() -> tuple[AcceptedCommand, ...]:
    return accepted_commands(program(), dialect.load(), policy())


def test_table_of_the_library_is_that_by_hand() -> None:
    found: dict[str, list[tuple[Any, ...]]] = {}
    for row in table():
        found.setdefault(row.skill, []).append(tuple(row[1:]))
    assert found == BY_HAND


def test_rows_of_the_tests_of_the_gateway_are_those_of_the_library() -> None:
    assert set(ROWS) <= set(table())


def test_skills_that_the_policy_does_not_know_have_no_rows() -> None:
    contracts = tuple(each for each in policy().contracts if each.name != "goto")
    rows = accepted_commands(program(), dialect.load(), structs.replace(policy(), contracts=contracts))
    assert rows == tuple(row for row in table() if row.skill != "goto")


# --------------------------------------------------------------------------- frames of clients, made by hand


class Client(NamedTuple):
    """What a client sends: the autopilot at the other end, and the message."""

    autopilot: str
    message: Any


def long(command: int, *parameters: float) -> Any:
    """A COMMAND_LONG; parameters that are not given are 0."""
    return mavlink.MAVLink_command_long_message(1, 1, command, 0, *(*parameters, *(0.0,) * 7)[:7])


def command_int(command: int, frame: int, p1: float, x: int, y: int, z: float) -> Any:
    return mavlink.MAVLink_command_int_message(1, 1, frame, command, 0, 0, p1, 0, 0, nan, x, y, z)


def item(command: int, frame: int, p1: float, x: int, y: int, z: float) -> Any:
    return mavlink.MAVLink_mission_item_int_message(1, 1, 0, frame, command, 0, 1, p1, 0, 0, nan, x, y, z)


def setpoint(frame: int, mask: int, lat: int, lon: int, alt: float) -> Any:
    return mavlink.MAVLink_set_position_target_global_int_message(0, 1, 1, frame, mask, lat, lon, alt, *(0.0,) * 8)


def mode(custom: int) -> Any:
    return mavlink.MAVLink_set_mode_message(1, 1, custom)


def takeoff(altitude: int) -> Iterator[Client]:
    yield Client("px4", long(22, 0, 0, 0, nan, nan, nan, (altitude + HOME) / 1000))  # QGroundControl
    yield Client("ardupilot", long(22, 0, 0, 0, 0, 0, 0, altitude / 1000))  # MAVSDK, pymavlink, MAVProxy
    yield Client("ardupilot", item(22, 3, 0, 0, 0, altitude / 1000))
    yield Client("px4", item(22, 6, 0, 473977400, 85455900, altitude / 1000))


def goto(target: tuple[int, int], altitude: int, speed: int | None = None) -> Iterator[Client]:
    x, y = target
    p1 = -1.0 if speed is None else speed / 1000
    for autopilot in ("px4", "ardupilot"):
        yield Client(autopilot, command_int(192, 5, p1, x, y, (altitude + HOME) / 1000))  # MAVSDK
        yield Client(autopilot, command_int(192, 6, p1, x, y, altitude / 1000))
        if speed is None:
            yield Client(autopilot, command_int(192, 0, nan, x, y, (altitude + HOME) / 1000))
            yield Client(autopilot, item(16, 3, 0, x, y, altitude / 1000))
            yield Client(autopilot, item(16, 0, 0, x, y, (altitude + HOME) / 1000))
            yield Client(autopilot, setpoint(6, 0xDF8, x, y, altitude / 1000))  # ArduPilot's example
            yield Client(autopilot, setpoint(5, 0x1F8, x, y, (altitude + HOME) / 1000))


def hover(time: int | None = None) -> Iterator[Client]:
    if time is None:
        yield Client("ardupilot", long(193, 0))
        yield Client("ardupilot", long(17))  # mavutil.set_mode_loiter
        yield Client("px4", command_int(192, 0, -1, INT32_MAX, INT32_MAX, nan))  # QGroundControl's pause
        yield Client("px4", long(192, -1, 0, 0, nan, nan, nan, nan))
        yield Client("px4", mode(4 << 16 | 3 << 24))
        yield from (Client("ardupilot", mode(number)) for number in (5, 16, 17))
    else:
        yield Client("ardupilot", item(19, 3, time / 1_000_000, 0, 0, 20))
        yield Client("px4", item(19, 3, time / 1_000_000, INT32_MAX, INT32_MAX, 20))


def return_home() -> Iterator[Client]:
    for autopilot in ("px4", "ardupilot"):
        yield Client(autopilot, long(20))
        yield Client(autopilot, item(20, 2, 0, 0, 0, 0))
    yield Client("px4", mode(4 << 16 | 5 << 24))
    yield Client("ardupilot", mode(6))


def emergency_land() -> Iterator[Client]:
    for autopilot in ("px4", "ardupilot"):
        yield Client(autopilot, long(21, 0, 0, 0, nan, nan, nan, nan))
        yield Client(autopilot, item(21, 3, 0, 0, 0, 0))
    yield Client("px4", mode(4 << 16 | 6 << 24))
    yield Client("ardupilot", mode(9))


# ------------------------------------------------------------------------- frames read back, by the table alone

ABOVE_SEA, ABOVE_HOME = (0, 5), (3, 6)


def received(message: Any) -> Any:
    """A message as it arrives: with numbers as short as on the wire."""
    codec = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    (arrived,) = mavlink.MAVLink(None).parse_buffer(message.pack(codec)) or ()
    return arrived


def place_of(message: Any, field: str) -> tuple[float | int, bool]:
    """The value of a field of a row, and whether it is in 1e-7 degree already."""
    if not field.startswith("param"):
        return getattr(message, field), False
    other = {"param5": "x", "param6": "y", "param7": "z"}.get(field, "")
    integers = message.get_type().endswith("_INT")
    name = other if hasattr(message, other) else field
    return getattr(message, name), integers and other in ("x", "y")


def unset(value: float | int) -> bool:
    return isnan(value) if isinstance(value, float) else value == INT32_MAX


def number_of(kind: str, message: Any) -> int:
    if kind == MODE:
        return int(message.custom_mode) if message.get_type() == "SET_MODE" else -1
    if kind == MESSAGE:
        return int(message.get_msgId())
    wanted = ("COMMAND_LONG", "COMMAND_INT") if kind == COMMAND else ("MISSION_ITEM", "MISSION_ITEM_INT")
    return int(message.command) if message.get_type() in wanted else -1


def matches(row: AcceptedCommand, client: Client) -> bool:
    """Whether a row stands for what a client sends."""
    if row.autopilot not in ("", client.autopilot) or number_of(row.kind, client.message) != row.number:
        return False
    for field, value, mask in row.fixed:
        given, _ = place_of(client.message, field)
        if value is None:
            held = unset(given)
        elif mask == -1:
            held = given == value
        else:
            held = int(given) & mask == value
        if not held:
            return False
    needed = (field for each in row.arguments if not each.otherwise for field in each.fields)
    return not any(unset(place_of(client.message, field)[0]) for field in needed)


def read(source: ArgumentSource, message: Any) -> Any:
    """The argument in canonical integers, "default" or "here"."""
    values = [place_of(message, field) for field in source.fields]
    if not values or any(unset(value) or (source.parameter == "speed" and value <= 0) for value, _ in values):
        return source.otherwise
    made = [quantise(value, 1 if exact else source.scale, 1) for value, exact in values]
    if source.datum:
        frame = getattr(message, "frame", getattr(message, "coordinate_frame", None))
        above_sea = source.datum == "sea" or (source.datum == "frame" and frame in ABOVE_SEA)
        assert above_sea or source.datum == "home" or frame in ABOVE_HOME
        made = [None if each is None else each - HOME * above_sea for each in made]
    return made[0] if len(made) == 1 else tuple(made)


def translated(client: Client) -> tuple[str, dict[str, Any]]:
    """The skill and the arguments without those that are the default, by the first row that matches."""
    client = client._replace(message=received(client.message))
    skills = {row.skill for row in table() if matches(row, client)}
    assert len(skills) == 1, (client, skills)
    row = next(row for row in table() if matches(row, client))
    given = {each.parameter: read(each, client.message) for each in row.arguments}
    return row.skill, {name: value for name, value in given.items() if value != "default"}


@cache
def ranges() -> Mapping[str, Mapping[str, tuple[int, int]]]:
    """The range of each numeric parameter of the library's skills."""
    units = program().units
    context = CheckContext(collect(units), Report({}), dialect.load())
    return {
        skill.name.text: {
            name: (int(each.low), int(each.high))
            for name, each in context.arguments(skill).items()
            if each.low is not None and each.high is not None
        }
        for skill in context.symbols.skills.values()
    }


#: within 5 km of home or so, 1e-7 degree
PLACES = st.tuples(st.integers(473_500_000, 474_400_000), st.integers(84_900_000, 86_000_000))


@cache
def translation(autopilot: int) -> Translation:
    """The gateway's own, which has seen the height of home."""
    prepared = prepare(policy())
    assert isinstance(prepared, PreparedPolicy)
    seen = VehicleSeen(1)
    home = mavlink.MAVLink_home_position_message(473_977_400, 85_455_900, HOME, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0)
    seen.take(home.pack(mavlink.MAVLink(None, 1, 1)), 0)
    return Translation(GatewaySettings(1, autopilot, prepared, DEFAULTS, table(), lambda now: no_state()), seen)


def no_state() -> State:
    raise AssertionError("a translation decides nothing")


def by_gateway(client: Client) -> tuple[str, tuple[int, ...]]:
    """The skill and the cells of its arguments, as the gateway translates the frame."""
    message = decoded(client.message.pack(mavlink.MAVLink(None, 255, 190)))
    assert message is not None
    made = translation(PX4 if client.autopilot == "px4" else ARDUPILOT)
    (row,) = {
        row.skill: row for kind in (MODE, MESSAGE, ITEM, COMMAND)
        if (row := made.row(kind, number_of(kind, client.message), message)) is not None
    }.values()  # fmt: skip
    step = made.step(row, message, {}, 0)
    assert isinstance(step, ProposedStep), step
    return step.skill, step.values


def cells(skill: str, arguments: Mapping[str, Any]) -> tuple[int, ...]:
    """The cells of arguments in the order of the library's parameters."""
    if skill == "goto":
        place = project(policy().projection, *arguments["target"])
        return (*place, arguments["altitude"], arguments.get("speed", 6_000))
    if skill == "hover":
        return (arguments.get("time", 10_000_000),)
    return tuple(arguments.values())


@given(st.data())
def test_frames_of_clients_give_the_arguments_that_are_meant(data: st.DataObject) -> None:
    def drawn(skill: str, parameter: str) -> int:
        low, high = ranges()[skill][parameter]
        return data.draw(st.integers(low, high), label=f"{skill}.{parameter}")

    meant: list[tuple[str, Callable[..., Iterator[Client]], dict[str, Any]]] = [
        ("takeoff", takeoff, {"altitude": drawn("takeoff", "altitude")}),
        ("goto", goto, {"target": data.draw(PLACES), "altitude": drawn("goto", "altitude")}),
        ("goto", goto, {"target": data.draw(PLACES), "altitude": 20_000, "speed": drawn("goto", "speed")}),
        ("hover", hover, {}),
        ("hover", hover, {"time": drawn("hover", "time") // 1_000_000 * 1_000_000}),
        ("return_home", return_home, {}),
        ("emergency_land", emergency_land, {}),
    ]
    for skill, clients, arguments in meant:
        for client in clients(**arguments):
            assert translated(client) == (skill, arguments), client.message
            assert by_gateway(client) == (skill, cells(skill, arguments)), client.message


def test_every_row_of_the_library_is_met_by_a_client_or_a_substitute() -> None:
    """Rows that no frame above matches first are those of unset places and of the autopilot's own altitude."""
    clients = [*takeoff(20_000), *goto((473977400, 85455900), 20_000), *hover(), *hover(10_000_000), *return_home()]
    clients += emergency_land()
    met = {row for each in clients for row in table() if matches(row, each._replace(message=received(each.message)))}
    left = {(row.skill, row.kind, row.name) for row in set(table()) - met}
    assert left == {
        ("takeoff", MODE, "TAKEOFF"),
        ("emergency_land", ITEM, "MAV_CMD_NAV_LAND"),  # without a place, as INT32_MAX
    }


@pytest.mark.parametrize(
    ("client", "expected"),
    [
        (Client("px4", long(22, *(nan,) * 7)), ("takeoff", {"altitude": TAKEOFF_ALTITUDE})),  # MAVSDK
        (Client("px4", mode(4 << 16 | 2 << 24)), ("takeoff", {"altitude": TAKEOFF_ALTITUDE})),
        (
            Client("px4", command_int(192, 6, nan, INT32_MAX, INT32_MAX, 30.0)),
            ("goto", {"target": "here", "altitude": 30_000}),
        ),
        (
            Client("px4", command_int(192, 6, nan, 473977400, 85455900, nan)),
            ("goto", {"target": (473977400, 85455900), "altitude": "here"}),
        ),
        (Client("px4", item(21, 3, 0, INT32_MAX, INT32_MAX, 0)), ("emergency_land", {})),
    ],
)
def test_fields_that_are_unset_mean_their_substitutes(client: Client, expected: tuple[str, dict[str, Any]]) -> None:
    assert translated(client) == expected


@pytest.mark.parametrize(
    "client",
    [
        Client("ardupilot", long(22, 0, 0, 0, 0, 0, 0, nan)),  # a takeoff to nowhere
        Client("px4", long(193, 1)),  # continue
        Client("px4", setpoint(6, 0xFFF, 473977400, 85455900, 20.0)),  # no position
        Client("px4", setpoint(6, 0xDC7, 473977400, 85455900, 20.0)),  # a velocity
        Client("px4", item(21, 3, 0, 473977400, 85455900, 0)),  # a landing elsewhere
        Client("ardupilot", item(19, 3, 10, 473977400, 85455900, 20)),  # a hover elsewhere
        Client("px4", mode(5)),  # ArduPilot's
        Client("ardupilot", mode(4)),  # GUIDED means no motion
        Client("px4", long(400, 1)),  # arming
    ],
)
def test_other_frames_mean_no_skill(client: Client) -> None:
    client = client._replace(message=received(client.message))
    assert not [row for row in table() if matches(row, client)]


def test_infinite_altitude_is_no_number() -> None:
    client = Client("ardupilot", received(long(22, 0, 0, 0, 0, 0, 0, inf)))
    (row,) = [row for row in table() if matches(row, client)]
    assert read(row.arguments[0], client.message) is None
