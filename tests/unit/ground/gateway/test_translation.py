from math import inf, nan
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from reference.gateway_world import (
    HOME_LATITUDE,
    HOME_LONGITUDE,
    NORTH,
    SYSTEM,
    GatewayWorld,
    acks,
    command_int,
    command_long,
    proposals,
    reposition,
    setpoint,
    texts,
)
from reference.gateway_world import ROWS as ROWS
from rtshcua.ground.gateway.accepted import AcceptedCommand, ArgumentSource
from rtshcua.ground.gateway.interface import RequestFrame
from rtshcua.ground.gateway.translation import Translation, shadowed_parameters
from rtshcua.mavlink.modes import ARDUPILOT, PX4
from rtshcua.model.flat.zone import project

TARGET = "47.3983000 N, 8.5455900 E"


def one(world: GatewayWorld, message: Any) -> Any:
    """The only proposed step, or the answers."""
    actions = world.send(message)
    found = proposals(actions)
    return found[0][:2] if found else [*acks(actions), *texts(actions)]


def aloft(autopilot: int = PX4) -> GatewayWorld:
    world = GatewayWorld(autopilot)
    world.fly()
    return world


def test_heights_are_above_home_whatever_the_client_says() -> None:
    """The table of the design: PX4's take-off is above sea, ArduPilot's above home, COMMAND_INT by its frame."""
    ground = GatewayWorld()
    ground.ready()
    assert one(ground, command_long(22, nan, 0, 0, nan, nan, nan, 503.0)) == ("takeoff", {"altitude": "15 m"})
    ground = GatewayWorld(ARDUPILOT)
    ground.ready()
    assert one(ground, command_long(22, 0, 0, 0, 0, 0, 0, 10.5)) == ("takeoff", {"altitude": "10.5 m"})
    wanted = ("goto", {"target": TARGET, "altitude": "20 m"})
    for frame, z in ((0, 508.0), (5, 508.0), (3, 20.0), (6, 20.0)):
        assert one(aloft(), reposition(z=z, frame=frame)) == wanted, frame
    for frame in (1, 2, 10, 11, 255):
        assert one(aloft(), reposition(z=20, frame=frame))[0] == (192, 2), frame


def test_a_frame_that_contradicts_the_datum_of_the_table_is_refused() -> None:
    """PX4 reads the height of a take-off above sea whatever its frame, ArduPilot only above home."""
    for autopilot, frame, z, height in (
        (PX4, 5, 503.0, "15 m"), (PX4, 0, 503.0, "15 m"), (PX4, 6, 15.0, None), (PX4, 2, 503.0, None),
        (ARDUPILOT, 6, 15.0, "15 m"), (ARDUPILOT, 3, 15.0, "15 m"), (ARDUPILOT, 5, 15.0, None),
        (ARDUPILOT, 11, 15.0, None),
    ):  # fmt: skip
        world = GatewayWorld(autopilot)
        world.ready()
        found = one(world, command_int(22, frame, x=0, y=0, z=z))
        wanted: Any = ("takeoff", {"altitude": height})
        if height is None:
            wanted = [(22, 2), f"takeoff: heights in frame {frame} are not accepted here"]
        assert found == wanted, (autopilot, frame)


def test_a_height_in_a_command_long_is_above_sea_on_px4_and_refused_on_ardupilot() -> None:
    message = command_long(192, -1, 1, 0, nan, 47.3983, 8.54559, 508.0)
    skill, arguments = one(aloft(), message)
    assert (skill, arguments["altitude"]) == ("goto", "20 m")
    assert one(aloft(ARDUPILOT), message) == [
        (192, 2),
        "goto: COMMAND_LONG does not say above what: use COMMAND_INT",
    ]


def test_places_are_local_millimetres_and_exact_texts() -> None:
    world = aloft()
    actions = world.send(reposition())
    ((_, arguments, values),) = proposals(actions)
    x, y = project(world.policy.policy.projection, *NORTH)
    assert values == (x, y, 20_000, 6_000)
    assert arguments["target"] == TARGET
    assert "speed" not in arguments
    ((_, _, values),) = proposals(aloft().send(command_int(192, 6, 2.5, 1, 0, 0, x=NORTH[0], y=NORTH[1], z=20)))
    assert values == (x, y, 20_000, 2_500)
    assert one(aloft(), command_int(192, 6, 0, 1, 0, 0, x=NORTH[0], y=NORTH[1], z=20))[1] == {
        "target": TARGET, "altitude": "20 m",
    }  # fmt: skip


def test_the_southern_and_the_western_hemisphere_have_letters() -> None:
    found = one(aloft(), reposition(latitude=-12_345, longitude=-1))
    assert found == [(192, 2), "goto: target is further away than any zone can be"]


def test_what_is_unset_means_what_the_table_says() -> None:
    here = {"target": "47.3977400 N, 8.5455900 E", "altitude": "20 m"}
    nowhere = {"x": 0x7FFFFFFF, "y": 0x7FFFFFFF}
    assert one(aloft(), command_int(192, 6, nan, 1, z=20, **nowhere)) == ("goto", here)
    there = {"target": TARGET, "altitude": "10 m"}
    assert one(aloft(), command_int(192, 6, nan, 1, x=NORTH[0], y=NORTH[1], z=nan)) == ("goto", there)
    assert one(aloft(), command_int(192, 6, nan, 1, z=nan, **nowhere)) == ("hover", {})
    assert one(aloft(), command_long(192, -1, 1, 0, nan, nan, nan, nan)) == ("hover", {})


def test_what_stands_for_here_needs_a_fresh_position() -> None:
    world = aloft()
    world.now_us += 2_100_000
    nowhere = {"x": 0x7FFFFFFF, "y": 0x7FFFFFFF}
    message = command_int(192, 6, nan, 1, z=20, **nowhere)
    assert one(world, message) == [(192, 1), "goto: the vehicle's position is unknown"]
    message = command_int(192, 6, nan, 1, x=NORTH[0], y=NORTH[1], z=nan)
    assert one(world, message) == [(192, 1), "goto: the vehicle's height is unknown"]


def test_an_unknown_height_of_home_is_rejected_for_now() -> None:
    world = GatewayWorld()
    world.gateway._state.seen._frames.pop(242)
    world.ready()
    assert one(world, command_long(22, 0, 0, 0, 0, 0, 0, 500)) == [
        (22, 1),
        "takeoff: the height of home is unknown yet",
    ]


def test_the_take_off_altitude_comes_from_the_parameter() -> None:
    """Unset: the client's own value, else the vehicle's, else it is requested."""
    assert shadowed_parameters(ROWS) == {"MIS_TAKEOFF_ALT"}
    takeoff = command_long(22, *[nan] * 7)
    world = GatewayWorld()
    world.ready()
    assert one(world, takeoff) == [(22, 1), "takeoff: MIS_TAKEOFF_ALT is not known yet: name the altitude"]
    (request,) = (each for each in world.wait() if isinstance(each, RequestFrame))
    read = mavlink.MAVLink(None).decode(bytearray(request.frame))
    assert (read.get_type(), read.param_id, read.param_index) == ("PARAM_REQUEST_READ", "MIS_TAKEOFF_ALT", -1)
    world.vehicle(mavlink.MAVLink_param_value_message(b"MIS_TAKEOFF_ALT", 12.0, 9, 100, 5))
    assert one(world, takeoff) == ("takeoff", {"altitude": "12 m"})
    world = GatewayWorld()
    world.ready()
    world.send(mavlink.MAVLink_param_set_message(SYSTEM, 1, b"MIS_TAKEOFF_ALT", 7.5, 9))
    assert one(world, takeoff) == ("takeoff", {"altitude": "7.5 m"})
    assert one(world, command_long(176, 1, 4, 2)) == [], "the same take-off as a mode is the same one"
    world = GatewayWorld()
    world.ready()
    world.send(mavlink.MAVLink_param_set_message(SYSTEM, 1, b"MIS_TAKEOFF_ALT", inf, 9))
    assert one(world, takeoff) == [(22, 2), "takeoff: MIS_TAKEOFF_ALT is not a number in range"]


def test_impossible_numbers_are_refused() -> None:
    for z in (inf, -inf, 3e38, 1e20):
        assert one(aloft(), reposition(z=z))[0] == (192, 2), z
    for x, y in ((900_000_001, 0), (-900_000_001, 0), (0, 1_800_000_001), (-(1 << 31), -(1 << 31))):
        assert one(aloft(), reposition(latitude=x, longitude=y))[0] == (192, 2), (x, y)
    for five, six in ((inf, 8.5), (47.4, -inf), (1e9, 1e9), (91.0, 8.0)):
        assert one(aloft(), command_long(192, -1, 1, 0, 0, five, six, 508.0))[0] == (192, 2), (five, six)
    assert one(aloft(), command_int(192, 6, inf, 1, x=NORTH[0], y=NORTH[1], z=20))[0] == (192, 2)


def test_only_masks_of_the_table_are_positions() -> None:
    wanted = ("goto", {"target": TARGET, "altitude": "20 m"})
    for mask, proposed in (
        (0xDF8, True),
        (0x1F8, True),
        (0xDF8 | 1, False),
        (0xDC7, False),
        (0, False),
        (0xFFFF, False),
    ):
        world = aloft()
        world.offboard()
        world.done.clear()
        actions = world.send(setpoint(mask=mask))
        assert ([each[:2] for each in proposals(actions)] == [wanted]) is proposed, mask
        assert acks(actions) == []


def test_rows_of_another_autopilot_do_not_count() -> None:
    assert one(aloft(ARDUPILOT), command_long(176, 1, 5)) == ("hover", {})
    assert one(aloft(PX4), command_long(176, 1, 4, 5)) == ("return_home", {})
    assert one(aloft(PX4), command_long(176, 1, 9, 0)) == [(176, 2), "mode 589824 has no mapping"]


def test_a_skill_without_a_rule_of_the_policy_is_denied() -> None:
    world = aloft()
    del world.gateway._state.translation._contracts["goto"]
    assert one(world, reposition()) == [(192, 2), "goto: no rule of bridge_inspection names this skill"]


def test_a_parameter_without_a_value_is_denied() -> None:
    world = aloft()
    world.gateway._state.translation._defaults = {}
    assert one(world, command_long(193, 0)) == [(193, 2), "hover: time is missing"]


def test_home_is_the_place_that_the_vehicle_reported() -> None:
    assert (HOME_LATITUDE, HOME_LONGITUDE) == (473_977_400, 85_455_900)


def test_a_choice_or_a_zone_cannot_be_given_by_a_field() -> None:
    world = aloft()
    inspect = ArgumentSource("area", ("param1",), 1, "", "")
    row = AcceptedCommand("inspect_area", "command", "MAV_CMD_USER_1", 31010, "", (), (inspect,))
    rows = (*ROWS, row)
    world.gateway._state.translation = Translation(
        world.gateway._state.settings._replace(accepted=rows), world.gateway._state.seen
    )
    assert one(world, command_long(31010, 1)) == [(31010, 2), "inspect_area: area cannot be given by a MAVLink field"]
