from collections.abc import Sequence
from copy import copy
from math import inf, nan
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from reference.gateway_world import (
    HOME_LATITUDE,
    HOME_LONGITUDE,
    NORTH,
    SYSTEM,
    GatewayWorld,
    acks,
    command_long,
    item,
    proposals,
    reposition,
    texts,
    told,
)
from rtshcua.ground.gateway.interface import (
    Action,
    ClientDown,
    FlightEnded,
    ProposalAnswered,
    ProposalChecked,
    Propose,
    Withdraw,
    Withhold,
)
from rtshcua.ground.gateway.plan_transfer import MOST_ITEMS
from rtshcua.mavlink.modes import ARDUPILOT, PX4, CopterMode
from rtshcua.model.flat.situation import Now

N, E = NORTH
YAW = "yaw is not flown: the autopilot turns the vehicle"
TAKEOFF, WAYPOINT, LOITER, RETURN, LAND, SPEED = 22, 16, 19, 20, 21, 178


def count(number: int, kind: int = 0) -> Any:
    return mavlink.MAVLink_mission_count_message(SYSTEM, 1, number, kind)


def results(actions: list[Action], client: int = 1) -> list[tuple[int, int]]:
    found = [message for message in told(actions, client) if message.get_type() == "MISSION_ACK"]
    return [(message.type, message.mission_type) for message in found]


def requested(actions: list[Action]) -> list[tuple[str, int]]:
    names = ("MISSION_REQUEST", "MISSION_REQUEST_INT")
    return [(message.get_type(), message.seq) for message in told(actions) if message.get_type() in names]


def upload(world: GatewayWorld, items: Sequence[Any], client: int = 1) -> list[Action]:
    """Upload items as asked for; return what the last one led to."""
    actions = world.send(count(len(items)), client)
    for number, each in enumerate(items):
        assert [message.seq for message in told(actions, client) if "REQUEST" in message.get_type()] == [number]
        each.seq = number
        actions = world.send(each, client)
    return actions


def stored(world: GatewayWorld, items: Sequence[Any], client: int = 1) -> None:
    """Upload items, which the worker accepts."""
    (check,) = (each for each in upload(world, items, client) if isinstance(each, Propose))
    assert not check.fly
    assert results(world.take(ProposalChecked(check.number, None)), client) == [(0, 0)]


def steps(actions: list[Action]) -> list[Any]:
    return [each for one in actions if isinstance(one, Propose) for each in one.steps]


def mission(start: int = 0) -> list[Any]:
    """A take-off, two places with a change of speed between, and the return."""
    return [
        item(start, TAKEOFF, z=15),
        item(start + 1, WAYPOINT, x=N, y=E, z=15),
        item(start + 2, SPEED, 1, 3, -1, frame=2, z=nan),
        item(start + 3, WAYPOINT, x=N + 1_000, y=E, z=20),
        item(start + 4, RETURN, nan, nan, nan, nan, frame=2),
    ]


HOME_ITEM = item(0, WAYPOINT, x=HOME_LATITUDE, y=HOME_LONGITUDE, z=488, frame=0)

# ---------------------------------------------------------------- the dialogue


def test_an_upload_is_checked_as_a_whole_before_it_is_acknowledged() -> None:
    world = GatewayWorld()
    world.ready()
    actions = upload(world, mission())
    assert results(actions) == []
    (check,) = (each for each in actions if isinstance(each, Propose))
    assert [(step.skill, dict(step.arguments)) for step in check.steps] == [
        ("takeoff", {"altitude": "15 m"}),
        ("goto", {"target": "47.3983000 N, 8.5455900 E", "altitude": "15 m"}),
        ("goto", {"target": "47.3984000 N, 8.5455900 E", "altitude": "20 m", "speed": "3 m/s"}),
        ("return_home", {}),
    ]
    assert (check.fly, check.role) == (False, "operator")
    actions = world.take(ProposalChecked(check.number, None))
    assert results(actions) == [(0, 0)]
    assert [each.messages for each in actions if isinstance(each, Withhold)] == [frozenset({42, 46})]


@pytest.mark.parametrize(
    ("autopilot", "yaw", "asked"), [(PX4, nan, 0), (PX4, 0.0, 1), (ARDUPILOT, 0.0, 0), (ARDUPILOT, 90.0, 1)]
)
def test_yaw_in_the_items_of_a_mission_is_told_once_it_is_stored(autopilot: int, yaw: float, asked: int) -> None:
    world = GatewayWorld(autopilot)
    world.ready()
    for refusal, said in (("refused", 0), (None, asked), (None, 0)):
        items = mission() if autopilot == PX4 else [copy(HOME_ITEM), *mission(1)]
        for each in items:
            each.param4 = yaw if each.command == WAYPOINT else nan
        (check,) = (each for each in upload(world, items) if isinstance(each, Propose))
        assert texts(world.take(ProposalChecked(check.number, refusal))).count(YAW) == said


def test_a_mission_that_is_refused_as_a_whole_is_not_stored() -> None:
    world = GatewayWorld()
    world.ready()
    (check,) = (each for each in upload(world, mission()) if isinstance(each, Propose))
    actions = world.take(ProposalChecked(check.number, "altitude 50 m is not permitted; nearest 40 m"))
    assert results(actions) == [(14, 0)]
    assert texts(actions) == ["mission refused: altitude 50 m is not permitted; nearest 40 m"]
    actions = world.send(command_long(300))
    assert (acks(actions), texts(actions)) == ([(300, 1)], ["there is no mission to start"])


def test_px4_asks_with_the_integer_message_and_ardupilot_with_the_legacy_one() -> None:
    for autopilot, name, again_us, patience_us in (
        (PX4, "MISSION_REQUEST_INT", 250_000, 5_000_000),
        (ARDUPILOT, "MISSION_REQUEST", 1_000_000, 8_000_000),
    ):
        world = GatewayWorld(autopilot)
        assert requested(world.send(count(3))) == [(name, 0)]
        assert requested(world.wait(again_us)) == []
        assert requested(world.wait(100_000)) == [(name, 0)]
        actions = world.wait(patience_us)
        assert results(actions) == [(15, 0)]
        assert len(requested(actions)) >= 4
        assert requested(world.wait(2_000_000)) == []


def test_a_repeated_item_changes_nothing_and_one_out_of_turn_is_passed_over() -> None:
    world = GatewayWorld()
    world.send(count(3))
    first = item(0, TAKEOFF, z=15)
    assert requested(world.send(first)) == [("MISSION_REQUEST_INT", 1)]
    assert world.send(first) == []
    assert world.send(item(2, RETURN)) == []
    assert requested(world.send(item(1, WAYPOINT, x=N, y=E, z=15))) == [("MISSION_REQUEST_INT", 2)]


def test_an_item_without_an_upload_is_out_of_sequence() -> None:
    world = GatewayWorld()
    assert results(world.send(item(0, TAKEOFF, z=15))) == [(13, 0)]
    world.send(count(1))
    actions = world.take(ClientDown(1))
    assert actions == []
    assert results(world.send(item(0, TAKEOFF, z=15))) == []


def test_an_item_of_another_sender_is_no_part_of_the_upload() -> None:
    world = GatewayWorld()
    world.send(count(2))
    assert results(world.send(item(0, TAKEOFF, z=15), sender=(7, 7))) == [(13, 0)]


def test_a_client_may_give_up_its_upload() -> None:
    world = GatewayWorld()
    world.send(count(2))
    world.send(mavlink.MAVLink_mission_ack_message(SYSTEM, 1, 0))
    assert requested(world.wait(300_000)) == [("MISSION_REQUEST_INT", 0)]
    world.send(mavlink.MAVLink_mission_ack_message(SYSTEM, 1, 15))
    assert requested(world.wait(600_000)) == []


def test_fences_rally_points_and_partial_uploads_are_refused() -> None:
    world = GatewayWorld()
    for kind, what in ((1, "fence"), (2, "rally points"), (255, "plan"), (9, "plan")):
        world.now_us += 6_000_000
        actions = world.send(count(4, kind))
        assert (results(actions), texts(actions)) == ([(14, kind)], [f"{what}: changes are refused"])
    actions = world.send(mavlink.MAVLink_mission_write_partial_list_message(SYSTEM, 1, 0, 2, 0))
    assert results(actions) == [(3, 0)]


def test_what_has_nothing_to_clear_is_cleared() -> None:
    """MAVSDK and QGroundControl clear all kinds before an upload. By hand: the kind, its answer, what is left."""
    for kind, result, left in ((0, 0, 0), (1, 0, 5), (2, 0, 5), (255, 0, 0), (9, 14, 5)):
        for message in (count(0, kind), mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, kind)):
            world = GatewayWorld()
            world.ready()
            stored(world, mission())
            actions = world.send(message)
            assert results(actions) == [(result, kind)]
            assert texts(actions) == (["plan: changes are refused"] if result else [])
            (listed,) = told(world.send(mavlink.MAVLink_mission_request_list_message(SYSTEM, 1, 0)))
            assert listed.count == left, kind


def test_the_number_of_items_is_bounded() -> None:
    world = GatewayWorld()
    assert results(world.send(count(MOST_ITEMS + 1))) == [(4, 0)]
    assert requested(world.send(count(MOST_ITEMS))) == [("MISSION_REQUEST_INT", 0)]


def test_a_mission_can_be_read_back_in_both_forms_and_cleared() -> None:
    world = GatewayWorld()
    world.ready()
    stored(world, mission())
    (answer,) = told(world.send(mavlink.MAVLink_mission_request_list_message(SYSTEM, 1, 0)))
    assert (answer.get_type(), answer.count) == ("MISSION_COUNT", 5)
    (answer,) = told(world.send(mavlink.MAVLink_mission_request_int_message(SYSTEM, 1, 1, 0)))
    assert (answer.get_type(), answer.seq, answer.command, answer.x, answer.z) == ("MISSION_ITEM_INT", 1, 16, N, 15)
    (answer,) = told(world.send(mavlink.MAVLink_mission_request_message(SYSTEM, 1, 1, 0)))
    assert (answer.get_type(), answer.seq, round(answer.x * 1e4)) == ("MISSION_ITEM", 1, 473_983)
    assert results(world.send(mavlink.MAVLink_mission_request_int_message(SYSTEM, 1, 9, 0))) == [(13, 0)]
    (answer,) = told(world.send(mavlink.MAVLink_mission_request_list_message(SYSTEM, 1, 1)))
    assert (answer.count, answer.mission_type) == (0, 1)
    assert results(world.send(mavlink.MAVLink_mission_request_int_message(SYSTEM, 1, 0, 1))) == [(13, 1)]
    world.send(mavlink.MAVLink_mission_ack_message(SYSTEM, 1, 0))
    actions = world.send(mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, 0))
    assert results(actions) == [(0, 0)]
    assert [each.messages for each in actions if isinstance(each, Withhold)] == [frozenset()]
    (answer,) = told(world.send(mavlink.MAVLink_mission_request_list_message(SYSTEM, 1, 0)))
    assert answer.count == 0
    assert results(world.send(count(0))) == [(0, 0)]


def test_items_with_floats_are_read_back_as_integers() -> None:
    world = GatewayWorld()
    world.ready()
    legacy = mavlink.MAVLink_mission_item_message(SYSTEM, 1, 0, 6, 22, 0, 1, 0, 0, 0, 0, nan, 8.5, 15, 0)
    there = mavlink.MAVLink_mission_item_message(SYSTEM, 1, 1, 6, 16, 0, 1, 0, 0, 0, 0, 47.3983, 8.54559, 15, 0)
    stored(world, [legacy, there])
    (answer,) = told(world.send(mavlink.MAVLink_mission_request_int_message(SYSTEM, 1, 1, 0)))
    assert abs(answer.x - N) < 20
    (answer,) = told(world.send(mavlink.MAVLink_mission_request_int_message(SYSTEM, 1, 0, 0)))
    assert (answer.x, answer.y) == (0x7FFFFFFF, 85_000_000)


def test_the_check_of_an_upload_that_was_replaced_says_nothing_about_the_next() -> None:
    world = GatewayWorld()
    world.ready()
    first, second = (
        next(each.number for each in upload(world, items) if isinstance(each, Propose))
        for items in (mission(), mission()[:2])
    )
    assert world.take(ProposalChecked(first, None)) == []
    assert results(world.take(ProposalChecked(second, "no"))) == [(14, 0)]
    third = next(each.number for each in upload(world, mission()) if isinstance(each, Propose))
    world.send(count(1))
    assert results(world.take(ProposalChecked(third, None))) == [], "another upload began"


def test_an_item_after_the_last_one_is_passed_over_while_the_mission_is_checked() -> None:
    world = GatewayWorld()
    world.ready()
    upload(world, mission())
    assert world.send(item(4, RETURN)) == []


# ---------------------------------------------------------------- what items mean


def meaning(*items: Any, autopilot: int = PX4) -> Any:
    """The steps of an upload, or its MISSION_ACK and text."""
    world = GatewayWorld(autopilot)
    world.fly()
    actions = upload(world, [HOME_ITEM, *items] if autopilot == ARDUPILOT else items)
    found = [(step.skill, dict(step.arguments)) for step in steps(actions)]
    return found or (results(actions)[0][0], *texts(actions))


THERE = {"target": "47.3983000 N, 8.5455900 E", "altitude": "15 m"}


def test_items_that_stay_or_land_at_a_place_fly_there_first() -> None:
    there = {"x": N, "y": E}
    assert meaning(item(0, LOITER, 7, **there, z=15)) == [("goto", THERE), ("hover", {"time": "7 s"})]
    assert meaning(item(0, LOITER, 7)) == [("hover", {"time": "7 s"})]
    assert meaning(item(0, WAYPOINT, x=N - 9, y=E, z=15), item(1, LAND, **there))[1:] == [
        ("goto", THERE),
        ("emergency_land", {}),
    ]
    assert meaning(item(0, LAND)) == [("emergency_land", {})]


def test_a_place_of_landing_is_reached_at_the_height_of_the_last_step_that_had_one() -> None:
    there = {"x": N, "y": E}
    assert meaning(item(0, 22, z=15), item(1, LAND, **there)) == [
        ("takeoff", {"altitude": "15 m"}), ("goto", THERE), ("emergency_land", {})
    ]  # fmt: skip
    on = item(0, WAYPOINT, x=N - 9, y=E, z=503, frame=0), item(1, LAND, **there, z=3)
    assert meaning(*on)[1:] == [("goto", THERE), ("emergency_land", {})], "whatever its frame"
    for autopilot in (PX4, ARDUPILOT):
        assert meaning(item(int(autopilot == ARDUPILOT), LAND, **there), autopilot=autopilot)[0] == 5


def test_after_a_take_off_at_a_place_px4_flies_there_and_arducopter_does_not() -> None:
    for frame, height in ((6, 15), (0, 503)):
        there = item(0, TAKEOFF, x=N, y=E, z=height, frame=frame)
        assert meaning(there) == [("takeoff", {"altitude": "15 m"}), ("goto", THERE)]
        assert meaning(there, autopilot=ARDUPILOT) == [("takeoff", {"altitude": "15 m"})]
    floats = mavlink.MAVLink_mission_item_message(SYSTEM, 1, 0, 3, TAKEOFF, 0, 1, 0, 0, 0, 0, N / 1e7, E / 1e7, 15, 0)
    assert [skill for skill, _ in meaning(floats)] == ["takeoff", "goto"]
    for x, y in ((0, 0), (2**31 - 1, 2**31 - 1), (HOME_LATITUDE + 500, HOME_LONGITUDE - 500)):
        assert meaning(item(0, TAKEOFF, x=x, y=y, z=15)) == [("takeoff", {"altitude": "15 m"})], "no other place"
    assert len(meaning(item(0, TAKEOFF, x=HOME_LATITUDE, y=HOME_LONGITUDE - 501, z=15))) == 2


def test_a_place_of_take_off_is_compared_with_where_the_vehicle_stands() -> None:
    world = GatewayWorld(PX4)
    world.ready()
    world.vehicle(mavlink.MAVLink_global_position_int_message(0, N, E, 488_000, 0, 0, 0, 0, 0))
    for place, expected in (((N, E), ["takeoff"]), ((HOME_LATITUDE, HOME_LONGITUDE), ["takeoff", "goto"])):
        actions = upload(world, [item(0, TAKEOFF, x=place[0], y=place[1], z=15)])
        assert [step.skill for step in steps(actions)] == expected


def test_items_of_a_take_off_elsewhere_are_reported_as_one() -> None:
    world = GatewayWorld(PX4)
    world.ready()
    stored(world, [item(0, TAKEOFF, x=N, y=E, z=15), item(1, RETURN)])
    world.accept(world.send(command_long(300)))
    seen = states(world.dispatch(0))
    for step in range(3):
        seen += states(world.line(type="effect", event="succeeded", kind=0, step=step))
        if step < 2:
            seen += states(world.dispatch(step + 1))
    assert seen == [("current", 0, 3), ("reached", 0, 0), ("current", 1, 3), ("reached", 1, 0), ("current", 1, 5)]


def test_slot_0_of_ardupilot_is_home() -> None:
    assert meaning(item(0, WAYPOINT, x=N, y=E, z=15), autopilot=ARDUPILOT) == [("goto", THERE)]
    assert meaning(autopilot=ARDUPILOT) == (5, "mission refused: the mission has no item that flies")


def test_what_cannot_be_a_step_is_refused_with_the_item() -> None:
    """By hand: the result of MISSION_ACK, and the reason."""
    table: tuple[tuple[Any, int, str], ...] = (
        (item(0, 92, 1), 3, "item 0: command 92 has no mapping"),
        (item(0, 2000), 3, "item 0: command 2000 has no mapping"),
        (item(0, WAYPOINT, 5, x=N, y=E, z=15), 6, "item 0: waits at a waypoint are refused: use NAV_LOITER_TIME"),
        (item(0, SPEED, 3, 5), 6, "item 0: only the horizontal speed can be changed"),
        (item(0, SPEED, 1, nan), 6, "item 0: only the horizontal speed can be changed"),
        (item(0, SPEED, 1, 5), 5, "the mission has no item that flies"),
        (item(0, WAYPOINT, x=N, y=E, z=inf), 5, "item 0: goto: altitude is not a number in range"),
        (item(0, WAYPOINT, x=N, y=E, z=15, frame=10), 5, "item 0: goto: its frame has no latitude and longitude"),
        (item(0, WAYPOINT, x=0x7FFFFFFF, y=0x7FFFFFFF, z=15), 3, "item 0: command 16 has no mapping"),
        (item(0, LOITER, x=2_000_000_000, y=E), 5, "item 0: goto: the position is not on the globe"),
    )
    for each, result, text in table:
        assert meaning(each) == (result, f"mission refused: {text}"), text


def test_speeds_of_a_mission_hold_until_the_next_one() -> None:
    there = {"x": N, "y": E, "z": 15}
    found = meaning(
        item(0, WAYPOINT, **there), item(1, SPEED, 1, 2.5), item(2, WAYPOINT, **there), item(3, SPEED, 0, -1),
        item(4, WAYPOINT, **there), item(5, SPEED, 1, -2), item(6, WAYPOINT, **there),
    )  # fmt: skip
    assert [arguments.get("speed") for _, arguments in found] == [None, "2.5 m/s", "2.5 m/s", None]
    found = meaning(item(0, SPEED, 1, 1e38), item(1, WAYPOINT, **there))
    assert found == (5, "mission refused: item 1: goto: speed is not a number in range")


# ---------------------------------------------------------------- flying it


def states(actions: list[Action], client: int = 1) -> list[tuple[str, int, int]]:
    found = []
    for message in told(actions, client):
        if message.get_type() == "MISSION_CURRENT":
            found.append(("current", message.seq, message.mission_state))
        elif message.get_type() == "MISSION_ITEM_REACHED":
            found.append(("reached", message.seq, 0))
    return found


@pytest.mark.parametrize(
    ("autopilot", "start"),
    [(PX4, command_long(300)), (PX4, command_long(176, 1, 4, 4)), (ARDUPILOT, command_long(176, 1, 3))],
)
def test_a_started_mission_flies_and_reports_its_items(autopilot: int, start: Any) -> None:
    world = GatewayWorld(autopilot)
    world.ready()
    before = [HOME_ITEM] if autopilot == ARDUPILOT else []
    stored(world, [*before, *mission()])
    first = len(before)
    actions = world.send(start)
    assert [skill for skill, *_ in proposals(actions)] == ["takeoff", "goto", "goto", "return_home"]
    assert acks(actions) == []
    world.accept(actions)
    actions = world.dispatch(0)
    assert acks(actions) == [(start.command, 0)]
    assert states(actions) == [("current", first, 3)]
    seen: list[Any] = []
    for step in range(4):
        seen += states(world.line(type="effect", event="succeeded", kind=0, step=step))
        if step < 3:
            seen += states(world.dispatch(step + 1))
    assert seen == [
        ("reached", first, 0), ("current", first + 1, 3), ("reached", first + 1, 0), ("current", first + 3, 3),
        ("reached", first + 3, 0), ("current", first + 4, 3), ("reached", first + 4, 0), ("current", first + 4, 5),
    ]  # fmt: skip
    assert ("current", first + 4, 5) in states(world.wait(1_100_000)), "once a second"


def test_a_mission_without_a_take_off_gets_one_on_the_ground() -> None:
    world = GatewayWorld()
    world.ready()
    places = [item(0, WAYPOINT, x=N, y=E, z=15), item(1, RETURN)]
    (check,) = (each for each in upload(world, places) if isinstance(each, Propose))
    assert [step.skill for step in check.steps] == ["takeoff", "goto", "return_home"]
    assert dict(check.steps[0].arguments) == {"altitude": "15 m"}
    world.take(ProposalChecked(check.number, None))
    actions = world.send(command_long(300))
    assert [skill for skill, *_ in proposals(actions)] == ["takeoff", "goto", "return_home"]
    world.accept(actions)
    assert states(world.dispatch(0)) == [("current", 0, 3)]
    assert states(world.line(type="effect", event="succeeded", kind=0, step=0)) == []


def test_a_paused_mission_goes_on_where_it_was() -> None:
    world = GatewayWorld()
    world.ready()
    stored(world, mission())
    world.accept(world.send(command_long(300)))
    world.dispatch(0)
    world.line(type="effect", event="succeeded", kind=0, step=0)
    world.fly()
    world.dispatch(1)
    assert acks(world.send(command_long(300))) == [(300, 0)], "it flies already"
    pause = world.send(command_long(176, 1, 4, 3))
    assert [skill for skill, *_ in proposals(pause)] == ["hover"]
    world.accept(pause, first=2)
    world.line(type="effect", event="superseded", kind=0, step=1)
    assert states(world.dispatch(2)) == []
    assert states(world.wait(1_100_000))[-1:] == [("current", 1, 4)]
    actions = world.send(command_long(300))
    assert [skill for skill, *_ in proposals(actions)] == ["goto", "goto", "return_home"]
    world.accept(actions, first=3)
    world.line(type="effect", event="superseded", kind=0, step=2)
    assert states(world.dispatch(3)) == [("current", 1, 3)]
    world.line(type="effect", event="succeeded", kind=0, step=3)
    world.dispatch(4)
    world.accept(world.send(command_long(193, 0)), first=5)
    world.line(type="effect", event="superseded", kind=0, step=4)
    world.dispatch(5)
    assert [skill for skill, *_ in proposals(world.send(command_long(300)))] == ["goto", "return_home"]


def test_a_repeated_start_before_the_answer_is_one_proposal() -> None:
    world = GatewayWorld()
    world.ready()
    stored(world, mission())
    assert len(proposals(world.send(command_long(300)))) == 4
    assert world.send(command_long(300, confirmation=1)) == []
    world.wait(300_000)
    assert acks(world.send(command_long(300, confirmation=2))) == [(300, 5)]


def test_a_refused_start_is_answered() -> None:
    world = GatewayWorld()
    world.ready()
    stored(world, mission())
    (propose,) = (each for each in world.send(command_long(300)) if isinstance(each, Propose))
    actions = world.take(ProposalChecked(propose.number, "wind is too strong"))
    assert acks(actions) == [(300, 2)]
    assert texts(actions) == ["takeoff refused: wind is too strong"]
    actions = world.send(command_long(300))
    (propose,) = (each for each in actions if isinstance(each, Propose))
    world.take(ProposalChecked(propose.number, None, 0))
    assert acks(world.take(ProposalAnswered(propose.number, "replayed", "flown before"))) == [(300, 2)]


def test_only_the_first_item_can_be_chosen() -> None:
    world = GatewayWorld()
    world.ready()
    set_current = mavlink.MAVLink_mission_set_current_message(SYSTEM, 1, 0)
    assert texts(world.send(set_current)) == ["a mission starts at its first item"], "there is no mission"
    stored(world, mission())
    assert states(world.send(set_current)) == [("current", 0, 2)]
    assert states(world.send(mavlink.MAVLink_mission_set_current_message(SYSTEM, 1, 2))) == [("current", 0, 2)]
    assert acks(world.send(command_long(224, 0))) == [(224, 0)]
    assert acks(world.send(command_long(224, 3))) == [(224, 2)]
    world.accept(world.send(command_long(300)))
    world.dispatch(0)
    actions = world.send(command_long(224, 0))
    assert (acks(actions), texts(actions)) == ([(224, 1)], ["the mission flies: stop it first"])
    for clears in (count(0), mavlink.MAVLink_mission_clear_all_message(SYSTEM, 1, 0), count(0, 255)):
        actions = world.send(clears)
        assert (results(actions), texts(actions)) == ([(14, 0)], ["mission refused: it flies: stop it first"])
    world.line(type="effect", event="failed", kind=0, step=0)
    world.line(type="mission")
    assert acks(world.send(command_long(224, 0))) == [(224, 0)]
    assert states(world.wait(1_100_000))[-1] == ("current", 0, 2)


def test_a_mission_that_begins_with_a_hold_gives_another_client_no_control() -> None:
    world = GatewayWorld()
    world.fly()
    world.client(2, "other")
    world.accept(world.send(reposition()))
    world.dispatch(0)
    stored(world, [item(0, LOITER, 7), item(1, WAYPOINT, x=N, y=E, z=15)], client=2)
    actions = world.send(command_long(300), client=2)
    assert (acks(actions, 2), texts(actions, 2)) == ([(300, 1)], ["hover rejected: script is in control"])
    stored(world, [item(0, LOITER, 7), item(1, RETURN)], client=2)
    assert [each for each, *_ in proposals(world.send(command_long(300), client=2))] == ["hover", "return_home"]


def test_a_part_of_a_mission_is_not_started() -> None:
    """By hand: parameters 1 and 2 of MISSION_START, and whether it is the whole mission of five items."""
    table = (
        (0, 0, True), (nan, nan, True), (0, 4, True), (0, -1, True), (2, 2, False), (1, 0, False), (0, 2, False),
        (0, 3, False), (inf, 0, False),
    )  # fmt: skip
    for first, last, whole in table:
        world = GatewayWorld()
        world.ready()
        stored(world, mission())
        actions = world.send(command_long(300, first, last))
        assert (proposals(actions) != []) is whole, (first, last)
        assert acks(actions) == ([] if whole else [(300, 2)])
        assert texts(actions) == ([] if whole else ["a part of a mission is refused: start the whole one"])


# ---------------------------------------------------------------- ArduPilot's guided item


def guided(command: int = WAYPOINT, z: float = 15) -> Any:
    message = item(0, command, x=N, y=E, z=z)
    message.current = 2
    return message


def test_a_guided_item_is_flown_to_at_once_and_acknowledged_as_a_mission() -> None:
    world = GatewayWorld(ARDUPILOT)
    world.fly()
    actions = world.send(guided())
    assert [each[:2] for each in proposals(actions)] == [("goto", THERE)]
    world.accept(actions)
    assert results(world.dispatch(0)) == [(0, 0)]
    assert results(world.send(guided())) == [(0, 0)], "the same target again"
    assert results(world.send(guided(z=60))) == [(14, 0)]
    actions = world.send(guided(command=2000))
    assert (results(actions), texts(actions)) == ([(3, 0)], ["item 2000 has no mapping"])
    actions = world.send(guided(z=16))
    (propose,) = (each for each in actions if isinstance(each, Propose))
    assert results(world.take(ProposalChecked(propose.number, "no"))) == [(14, 0)]


def test_all_connections_of_a_client_have_its_mission() -> None:
    """As where a ground station plans, and an agent behind the same address sets the mode."""
    world = GatewayWorld(ARDUPILOT)
    world.client(2, "other")
    world.ready()
    stored(world, [HOME_ITEM, *mission(1)])
    world.client(3, "script")
    world.take(ClientDown(1))
    sent = world.send(mavlink.MAVLink_mission_request_list_message(SYSTEM, 1), 3)
    assert [message.count for message in told(sent, 3) if message.get_type() == "MISSION_COUNT"] == [6]
    sent = world.send(mavlink.MAVLink_mission_request_list_message(SYSTEM, 1), 2)
    assert [message.count for message in told(sent, 2) if message.get_type() == "MISSION_COUNT"] == [0]
    flown = steps(world.send(mavlink.MAVLink_set_mode_message(SYSTEM, 1, CopterMode.AUTO), 3))
    assert [each.skill for each in flown] == ["takeoff", "goto", "goto", "return_home"]


def test_a_client_that_connects_again_goes_on_with_its_mission() -> None:
    """Its progress, the answer to its command, its value of a parameter, and its control are those of its name."""
    world = GatewayWorld()
    world.client(2, "other")
    world.ready()
    stored(world, mission())
    world.send(mavlink.MAVLink_param_set_message(SYSTEM, 1, b"MIS_TAKEOFF_ALT", 12.0, 9))
    world.accept(world.send(command_long(300)))
    world.take(ClientDown(1))
    world.client(3, "script")
    actions = world.dispatch(0)
    assert (acks(actions, 3), states(actions, 3)) == ([(300, 0)], [("current", 0, 3)])
    actions = world.line(type="effect", event="succeeded", kind=0, step=0)
    assert states(actions, 3) == [("reached", 0, 0), ("current", 1, 3)]
    world.client(4, "script")
    world.fly()
    actions = world.dispatch(1)
    assert acks(world.send(command_long(300), 4), 4) == [(300, 0)], "it flies already"
    assert texts(world.send(command_long(193, 0), 2), 2) == [], "a hover is safer"
    assert texts(world.send(reposition(), 2), 2) == ["goto rejected: script is in control"]
    assert [skill for skill, *_ in proposals(world.send(reposition(), 4))] == ["goto"]
    world = GatewayWorld()
    world.send(mavlink.MAVLink_param_set_message(SYSTEM, 1, b"MIS_TAKEOFF_ALT", 12.0, 9))
    world.take(ClientDown(1))
    world.client(3, "script")
    world.ready()
    taken_off = world.send(command_long(22, 0, 0, 0, 0, nan, nan, nan), 3)
    assert proposals(taken_off) == [("takeoff", {"altitude": "12 m"}, (12_000,))]


# ---------------------------------------------------------------- a renewed policy


def renewed(world: GatewayWorld, **changes: Any) -> list[Action]:
    """The gateway under a renewed policy, between two flights; what the first second led to."""
    world.take(FlightEnded())
    actions = world.gateway.renew(world.settings._replace(**changes), Now(world.now_us, 0, 0))
    return actions + world.wait(1_100_000)


def test_a_renewed_policy_keeps_missions_parameters_and_what_is_shown() -> None:
    world = GatewayWorld()
    world.ready()
    stored(world, mission())
    world.send(mavlink.MAVLink_param_set_message(SYSTEM, 1, b"MIS_TAKEOFF_ALT", 12.0, 9))
    world.send(command_long(400, 1))
    world.accept(world.send(command_long(300)))
    world.dispatch(0)
    world.line(type="effect", event="succeeded", kind=0, step=0)
    actions = renewed(world)
    (check,) = (each for each in actions if isinstance(each, Propose))
    assert (check.fly, [step.skill for step in check.steps]) == (False, ["takeoff", "goto", "goto", "return_home"])
    assert ("current", 1, 4) in states(actions), "its progress"
    assert texts(actions + world.take(ProposalChecked(check.number, None))) == []
    assert [message.base_mode >> 7 for message in told(world.report()) if message.get_type() == "HEARTBEAT"] == [1]
    world.ready()
    assert len(proposals(world.send(command_long(300)))) == 4
    taken_off = world.send(command_long(22, 0, 0, 0, 0, nan, nan, nan))
    assert proposals(taken_off) == [("takeoff", {"altitude": "12 m"}, (12_000,))]


def test_a_mission_that_a_renewed_policy_does_not_permit_is_withdrawn_with_the_reason() -> None:
    world = GatewayWorld()
    world.ready()
    stored(world, mission())
    (check,) = (each for each in renewed(world) if isinstance(each, Propose))
    actions = world.take(ProposalChecked(check.number, "the vehicle does not report its position", for_now=True))
    assert texts(actions) == []
    (check,) = (each for each in world.wait(1_100_000) if isinstance(each, Propose))
    actions = world.take(ProposalChecked(check.number, "the way home is too long"))
    assert texts(actions) == ["mission withdrawn, the policy was renewed: the way home is too long"]
    assert [each.messages for each in actions if isinstance(each, Withhold)] == [frozenset()]
    assert texts(world.send(command_long(300))) == ["there is no mission to start"]


def test_a_client_that_is_away_reads_later_that_its_mission_was_withdrawn() -> None:
    """Also where no item of it can be read under the renewed policy."""
    world = GatewayWorld()
    world.ready()
    stored(world, mission())
    world.take(ClientDown(1))
    assert not any(isinstance(each, Propose) for each in renewed(world, accepted=()))
    world.client(2, "script")
    assert texts(world.done, 2) == ["mission withdrawn, the policy was renewed: item 0: command 22 has no mapping"]
    world.client(3, "script")
    assert texts(world.done, 3) == []


def test_an_upload_and_a_command_that_wait_meet_a_renewed_policy() -> None:
    """The check of the upload ended with the former policy; the command goes on waiting for the next flight."""
    world = GatewayWorld()
    upload(world, mission())
    world.send(command_long(22, 0, 0, 0, 0, 0, 0, 503))
    assert results(renewed(world)) == [(14, 0)]
    world.ready()
    assert [skill for skill, *_ in proposals(world.wait(100_000))] == ["takeoff"]


def test_missions_of_absent_clients_are_each_checked_again() -> None:
    world = GatewayWorld()
    world.ready()
    world.client(2, "other")
    for client in (1, 2):
        stored(world, mission(), client)
    for client in (1, 2):
        world.take(ClientDown(client))
    actions = renewed(world)
    checks = [each for each in actions if isinstance(each, Propose)]
    assert [(each.client, each.fly) for each in checks] == [(0, False)] * 2
    assert not any(isinstance(each, Withdraw) for each in actions)
    for check in checks:
        world.take(ProposalChecked(check.number, "the way home is too long"))
    for client, name in ((3, "script"), (4, "other")):
        world.client(client, name)
        assert texts(world.done, client) == ["mission withdrawn, the policy was renewed: the way home is too long"]


@pytest.mark.parametrize("gone", [True, False])
def test_check_of_an_upload_that_nobody_waits_for_is_withdrawn(gone: bool) -> None:
    world = GatewayWorld()
    (first,) = (each for each in upload(world, mission()) if isinstance(each, Propose))
    actions = world.take(ClientDown(1)) if gone else upload(world, mission())
    assert Withdraw(first.number) in actions
    assert results(world.take(ProposalChecked(first.number, None))) == []


def test_mission_that_cannot_be_read_for_now_stays_under_a_renewed_policy() -> None:
    """The vehicle restarted, and did not say yet how high its home is."""
    world = GatewayWorld()
    world.ready()
    stored(world, [item(0, WAYPOINT, x=N, y=E, z=503, frame=5)])
    for boot_ms in (100_000, 0):
        world.vehicle(mavlink.MAVLink_system_time_message(0, boot_ms))
    actions = renewed(world)
    assert texts(actions) == []
    (check,) = (each for each in actions if isinstance(each, Propose))
    assert not check.fly
