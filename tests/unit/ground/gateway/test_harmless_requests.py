from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from reference.gateway_world import SYSTEM, GatewayWorld, acks, command_long, texts, told
from rtshcua.ground.gateway.harmless_requests import REQUEST_EVERY_US
from rtshcua.ground.gateway.interface import Action, ClientDown, RequestAnswered, RequestFrame
from rtshcua.mavlink.modes import ARDUPILOT
from rtshcua.onboard.enforcement.allow_list import is_housekeeping, read_frame


def requests(actions: list[Action]) -> list[Any]:
    """The frames for the flight, each of which the gate passes as housekeeping; LOG_REQUEST_LIST is not in its layouts
    yet.
    """
    found = []
    for each in actions:
        if isinstance(each, RequestFrame):
            message = mavlink.MAVLink(None).decode(bytearray(each.frame))
            assert (message.get_srcSystem(), message.get_srcComponent()) == (SYSTEM, 191)
            frame = read_frame(each.frame)
            if frame is not None or message.get_type() != "LOG_REQUEST_LIST":
                assert frame is not None
                assert is_housekeeping(frame), message
            found.append(message)
    return found


def version() -> Any:
    return mavlink.MAVLink_autopilot_version_message(8192, 1, 2, 3, 4, [0] * 8, [0] * 8, [0] * 8, 5, 6, 7)


def test_what_was_seen_is_answered_at_once() -> None:
    world = GatewayWorld()
    world.vehicle(version())
    for message, name in (
        (command_long(512, 148), "AUTOPILOT_VERSION"), (command_long(520, 1), "AUTOPILOT_VERSION"),
        (command_long(512, 242), "HOME_POSITION"), (command_long(410), "HOME_POSITION"),
        (command_long(512, 33), "GLOBAL_POSITION_INT"),
    ):  # fmt: skip
        actions = world.send(message)
        assert [each.get_type() for each in told(actions)] == [name, "COMMAND_ACK"]
        assert acks(actions) == [(message.command, 0)]
        assert requests(actions + world.wait()) == []
    actions = world.send(mavlink.MAVLink_autopilot_version_request_message(SYSTEM, 1))
    assert [each.get_type() for each in told(actions)] == ["AUTOPILOT_VERSION"]


def test_an_old_report_is_requested_anew_but_the_version_does_not_change() -> None:
    world = GatewayWorld()
    world.vehicle(version())
    world.now_us += 3_000_000
    assert acks(world.send(command_long(512, 148))) == [(512, 0)]
    actions = world.send(command_long(512, 33)) + world.wait()
    assert [(each.command, each.param1) for each in requests(actions)] == [(512, 33)]
    assert acks(actions) == []


def test_a_requested_message_is_acknowledged_when_it_comes() -> None:
    world = GatewayWorld()
    world.client(2, "other")
    actions = world.send(command_long(512, 148)) + world.send(command_long(512, 148), client=2) + world.wait()
    assert [(each.command, each.param1) for each in requests(actions)] == [(512, 148)], "one request for both"
    actions = world.vehicle(version())
    assert acks(actions) == [(512, 0)]
    assert acks(actions, client=2) == [(512, 0)]
    assert acks(world.vehicle(version())) == []


def test_the_vehicles_refusal_is_passed_to_who_waits_longest() -> None:
    world = GatewayWorld()
    world.send(command_long(512, 435))
    world.send(command_long(512, 397))
    assert acks(world.vehicle(mavlink.MAVLink_command_ack_message(512, 0))) == []
    assert acks(world.vehicle(mavlink.MAVLink_command_ack_message(22, 3))) == []
    assert acks(world.vehicle(mavlink.MAVLink_command_ack_message(512, 2))) == [(512, 2)]
    assert acks(world.vehicle(mavlink.MAVLink_command_ack_message(512, 4))) == [(512, 4)]
    assert acks(world.vehicle(mavlink.MAVLink_command_ack_message(512, 4))) == []


def test_other_answers_of_the_vehicle_are_no_refusals_of_a_request() -> None:
    """By hand: result and target of a COMMAND_ACK, and what the client gets. The flight is component 191."""
    table = (
        (2, (255, 190), []), (2, (SYSTEM, 1), []), (5, (SYSTEM, 191), []), (2, (SYSTEM, 191), [(512, 2)]),
        (3, (0, 0), [(512, 3)]),
    )  # fmt: skip
    for result, to, answers in table:
        world = GatewayWorld()
        world.send(command_long(512, 242_000))
        world.wait(100_000)
        assert acks(world.vehicle(mavlink.MAVLink_command_ack_message(512, result, 0, 0, *to))) == answers


def test_which_of_several_messages_of_one_number_is_part_of_the_request() -> None:
    world = GatewayWorld()
    sent = mavlink.MAVLink_storage_information_message(0, 2, 2, 0, 0, 0, 0, 0, 0)
    world.vehicle(sent)
    for wanted in (1, 3):
        assert acks(world.send(command_long(512, 261, wanted))) == []
    world.send(command_long(512, 261, 3))
    asked = [(each.param1, each.param2) for each in requests(world.wait(500_000))]
    assert asked == [(261, 1), (261, 3)]
    assert acks(world.vehicle(sent)) == [(512, 0)] * 3


def test_after_another_start_of_the_vehicle_nothing_is_taken_as_known() -> None:
    world = GatewayWorld(needed_us={30: 200_000})
    world.vehicle(mavlink.MAVLink_system_time_message(0, 60_000))
    world.vehicle(version())
    world.vehicle(parameter(b"P", 1, 0, 1))
    assert acks(world.send(command_long(511, 30, 100_000))) == [(511, 0)]
    assert len(requests(world.wait(200_000))) == 1
    world.vehicle(mavlink.MAVLink_system_time_message(0, 61_000))
    world.send(command_long(511, 30, 100_000))
    assert requests(world.wait(200_000)) == [], "it is as often already"
    world.vehicle(mavlink.MAVLink_system_time_message(0, 1_000))
    world.send(command_long(511, 30, 100_000))
    world.send(command_long(511, 30, 200_000))
    world.send(command_long(512, 148))
    world.send(mavlink.MAVLink_param_request_read_message(SYSTEM, 1, b"P", -1))
    asked = [each.get_type() for each in requests(world.wait(500_000))]
    assert asked == ["COMMAND_LONG", "COMMAND_LONG", "PARAM_REQUEST_READ"]


def test_a_silent_vehicle_is_told_after_a_second() -> None:
    world = GatewayWorld()
    world.send(command_long(512, 435))
    assert acks(world.wait(950_000)) == []
    assert acks(world.wait(100_000)) == [(512, 4)]


def test_requests_that_are_not_open_are_denied() -> None:
    world = GatewayWorld()
    world.client(1, "script", requests=frozenset())
    for message in (command_long(512, 435), command_long(511, 30, 100_000)):
        world.now_us += 6_000_000
        assert acks(world.send(message)) == [(message.command, 2)]
    for message, kind in (
        (mavlink.MAVLink_param_request_read_message(SYSTEM, 1, b"A", -1), "parameters"),
        (mavlink.MAVLink_param_request_list_message(SYSTEM, 1), "parameters"),
        (mavlink.MAVLink_request_data_stream_message(SYSTEM, 1, 0, 4, 1), "rates"),
        (mavlink.MAVLink_timesync_message(0, 5), "time"),
        (mavlink.MAVLink_log_request_list_message(SYSTEM, 1, 0, 9), "logs"),
    ):
        world.now_us += 6_000_000
        actions = world.send(message) + world.wait()
        assert requests(actions) == []
        assert texts(actions) == [f"requests of {kind} are not open to script"]


def test_numbers_that_are_no_message_are_denied() -> None:
    world = GatewayWorld()
    for number in (-1, 1.5, float("nan"), float("inf"), 1 << 24):
        assert acks(world.send(command_long(512, number))) == [(512, 2)], number


def test_a_rate_is_raised_but_never_lowered() -> None:
    """30 is needed every 500 ms. By hand: the interval asked for, and the one requested."""
    world = GatewayWorld(needed_us={30: 500_000})
    for asked, requested in ((1_000_000, []), (500_000, []), (100_000, [100_000]), (200_000, []), (1, [20_000]),
                             (-1, []), (0, []), (float("nan"), []), (3e9, [])):  # fmt: skip
        actions = world.send(command_long(511, 30, asked))
        assert acks(actions) == [(511, 0)], asked
        assert [(each.param1, each.param2) for each in requests(actions + world.wait(60_000))] == [
            (30, interval) for interval in requested
        ]


def test_the_requests_of_a_stream_are_those_of_its_messages() -> None:
    world = GatewayWorld(ARDUPILOT)
    actions = world.send(mavlink.MAVLink_request_data_stream_message(SYSTEM, 1, 11, 4, 1)) + world.wait(100_000)
    assert [(each.command, each.param1, each.param2) for each in requests(actions)] == [(511, 74, 250_000)]
    for stream, rate, on in ((11, 4, 1), (11, 2, 1), (11, 50, 0), (11, 0, 1), (99, 4, 1)):
        message = mavlink.MAVLink_request_data_stream_message(SYSTEM, 1, stream, rate, on)
        assert requests(world.send(message) + world.wait(100_000)) == [], (stream, rate, on)
    world.send(mavlink.MAVLink_request_data_stream_message(SYSTEM, 1, 0, 10, 1))
    found = requests(world.wait(5_000_000))
    assert len(found) > 15
    assert {each.param2 for each in found} == {100_000}


def test_request_frames_are_spaced_and_bounded() -> None:
    world = GatewayWorld()
    results = [acks(world.send(command_long(511, number, 100_000)))[0][1] for number in range(100)]
    assert results == [0] * 64 + [1] * 36
    assert len(requests(world.wait(1_000_000, step_us=10_000))) == 1_000_000 // REQUEST_EVERY_US
    results = [acks(world.send(command_long(512, number)))[:1] for number in range(300, 400)]
    assert [(512, 1)] in results
    world.take(ClientDown(1))
    assert requests(world.wait(5_000_000)) == []
    assert world.take(RequestAnswered(1, "refused")) == []


def test_a_rate_that_the_flight_cannot_take_yet_is_asked_for_again() -> None:
    world = GatewayWorld()
    assert acks(world.send(command_long(511, 74, 250_000))) == [(511, 0)]
    for tries in range(4):
        found = world.wait(600_000 if tries == 0 else 500_000 << tries - 1, step_us=50_000)
        assert [each.param1 for each in requests(found)] == [74], tries
        (asked,) = (each.number for each in found if isinstance(each, RequestFrame))
        assert world.take(RequestAnswered(asked, "busy")) == []
    found = world.wait(4_000_000, step_us=50_000)
    (asked,) = (each.number for each in found if isinstance(each, RequestFrame))
    assert world.take(RequestAnswered(asked, "accepted")) == []
    assert requests(world.wait(2_000_000)) == []


def test_a_rate_that_the_flight_does_not_change_is_told_and_may_be_asked_for_again() -> None:
    world = GatewayWorld()
    for _ in range(2):
        world.send(command_long(511, 74, 250_000))
        (asked,) = (each.number for each in world.wait(100_000) if isinstance(each, RequestFrame))
        actions = world.take(RequestAnswered(asked, "rate"))
        assert texts(actions) == ["the rate of message 74 stays as it is (rate)"]
        world.wait(6_000_000)


def test_a_rate_that_was_not_set_leaves_what_another_client_has() -> None:
    """By hand: a slower rate stands, a faster one is refused or its client goes before the flight answers."""
    for gone in (False, True):
        world = GatewayWorld()
        world.client(2, "other")
        world.send(command_long(511, 74, 500_000), client=2)
        (first,) = (each.number for each in world.wait(100_000) if isinstance(each, RequestFrame))
        world.take(RequestAnswered(first, "accepted"))
        world.send(command_long(511, 74, 50_000))
        (asked,) = (each.number for each in world.wait(100_000) if isinstance(each, RequestFrame))
        world.take(ClientDown(1) if gone else RequestAnswered(asked, "rate"))
        world.send(command_long(511, 74, 1_000_000), client=2)
        assert requests(world.wait(500_000)) == [], "it is never lowered"
        world.send(command_long(511, 74, 100_000), client=2)
        assert [each.param2 for each in requests(world.wait(500_000))] == [100_000]


def test_home_is_repeated_at_the_interval_that_a_client_asks_for() -> None:
    """The flight changes no rate of it. It is requested once where it was not seen."""

    def homes(actions: list[Action]) -> int:
        return len([message for message in told(actions) if message.get_type() == "HOME_POSITION"])

    world = GatewayWorld()
    assert acks(world.send(command_long(511, 148, 500_000))) == [(511, 0)]
    assert [(each.command, each.param1) for each in requests(world.wait(2_000_000, step_us=50_000))] == [(512, 148)]
    assert acks(world.send(command_long(511, 242, 500_000))) == [(511, 0)]
    assert homes(world.wait(5_000_000, step_us=50_000)) in (9, 10, 11)
    world.send(command_long(511, 242, 1_000))
    assert homes(world.wait(1_000_000, step_us=50_000)) in (4, 5), "not more often than every 200 ms"
    world.send(command_long(511, 242, -1))
    assert homes(world.wait(5_000_000, step_us=50_000)) == 0
    world.send(command_long(511, 242, 500_000))
    world.take(ClientDown(1))
    assert homes(world.wait(5_000_000, step_us=50_000)) == 0


def test_the_list_of_messages_that_are_awaited_is_bounded() -> None:
    world = GatewayWorld()
    results = []
    for number in range(300, 400):
        results.append(acks(world.send(command_long(512, number)) + world.wait(1, step_us=1)))
        world.now_us += 1
        world.gateway._state.requests._next_us = 0
    assert results.count([(512, 1)]) == 36


def parameter(name: bytes, value: float, index: int, count: int) -> Any:
    return mavlink.MAVLink_param_value_message(name, value, 9, count, index)


def test_parameters_are_read_by_name_and_index_from_what_was_seen() -> None:
    world = GatewayWorld()
    world.vehicle(parameter(b"RTL_ALT", 15, 7, 2))
    for name, index in ((b"RTL_ALT", -1), (b"", 7)):
        (answer,) = told(world.send(mavlink.MAVLink_param_request_read_message(SYSTEM, 1, name, index)))
        assert (answer.param_id, answer.param_value, answer.param_index) == ("RTL_ALT", 15, 7)
    for name, index in ((b"OTHER", -1), (b"", 3)):
        actions = world.send(mavlink.MAVLink_param_request_read_message(SYSTEM, 1, name, index)) + world.wait(60_000)
        assert [(each.param_id, each.param_index) for each in requests(actions)] == [(name.decode(), index)]


def test_a_complete_list_of_parameters_is_sent_in_parts_and_an_incomplete_one_requested() -> None:
    world = GatewayWorld()
    ask = mavlink.MAVLink_param_request_list_message(SYSTEM, 1)
    assert [each.get_type() for each in requests(world.send(ask) + world.wait(60_000))] == ["PARAM_REQUEST_LIST"]
    assert requests(world.send(ask) + world.wait(60_000)) == [], "not so soon again"
    for index in range(60):
        world.vehicle(parameter(f"P{index}".encode(), index, index, 60))
    actions = world.send(ask)
    assert told(actions) == []
    parts = [len(told(world.wait(50_000))) for _ in range(4)]
    assert parts == [25, 25, 10, 0]
    world.now_us += 11_000_000
    world.vehicle(parameter(b"P60", 60, 60, 100))
    assert [each.get_type() for each in requests(world.send(ask) + world.wait(60_000))] == ["PARAM_REQUEST_LIST"]


def test_clocks_and_logs_are_requested_by_frames_of_our_own() -> None:
    world = GatewayWorld()
    actions = world.send(mavlink.MAVLink_timesync_message(0, 77)) + world.wait(60_000)
    assert [(each.tc1, each.ts1) for each in requests(actions)] == [(0, 77)]
    assert requests(world.send(mavlink.MAVLink_timesync_message(5, 77)) + world.wait(60_000)) == [], "an answer"
    actions = world.send(mavlink.MAVLink_log_request_list_message(SYSTEM, 1, 0, 0xFFFF)) + world.wait(60_000)
    assert [(each.start, each.end) for each in requests(actions)] == [(0, 0xFFFF)]
