"""The mission protocol of the simulated vehicle: uploads, downloads and clearing in both flavours."""

from collections.abc import Callable
from math import nan
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec
from rtshcua.simulation.config import AutopilotKind, SimulationConfig
from rtshcua.simulation.mission_protocol import from_message
from rtshcua.simulation.world import Simulation
from virtual import plans as p

MISSION = [p.takeoff(10), p.waypoint(30, 0, 12), p.waypoint(30, 25, 12), p.RETURN]
Pilots = Callable[..., Any]


@pytest.mark.parametrize("kind", [p.MISSION, p.FENCE, p.RALLY])
def test_uploaded_items_are_downloaded_unchanged(pilot: Pilots, flavour: str, kind: int) -> None:
    a = pilot(flavour).ready()
    rows = {
        p.MISSION: p.mission(a, MISSION),
        p.FENCE: p.square(60),
        p.RALLY: [(5100, 3, (0, 0, 0, 0), 10, 10, 20)],
    }[kind]
    assert p.upload(a, rows, kind)[1] == 0
    for whole in (True, False):
        items = p.download(a, kind, whole)
        assert len(items) == len(rows)
        for number, (sent, got) in enumerate(zip(rows, items, strict=True)):
            if kind == p.MISSION and number == 0 and not a.px4:
                continue
            expected = p.item(a, sent, number, kind)
            assert (got.command, got.frame, got.seq, got.mission_type) == (sent[0], sent[1], number, kind)
            scale = 1 if whole or sent[1] == 2 else 1e7
            assert (got.x * scale, got.y * scale) == pytest.approx((expected.x, expected.y), abs=40)
            assert got.z == pytest.approx(expected.z, abs=1e-3)
            assert got.param1 == expected.param1


def test_px4_requests_int_items_after_the_first_one(pilot: Pilots) -> None:
    a = pilot("px4").ready()
    assert p.upload(a, p.square(60), p.FENCE) == (["MISSION_REQUEST", "MISSION_REQUEST_INT"], 0)
    assert p.upload(a, p.square(60), p.FENCE) == (["MISSION_REQUEST_INT"], 0)


def test_px4_switches_the_request_form_when_refused(pilot: Pilots) -> None:
    """MAVSDK answers a legacy request with an ACK of UNSUPPORTED and waits for the other form."""
    a = pilot("px4").ready()
    asked = a.send(mavlink.MAVLink_mission_count_message(1, 1, 1, p.RALLY))
    refusal = mavlink.MAVLink_mission_ack_message(1, 1, mavlink.MAV_MISSION_UNSUPPORTED, p.RALLY)
    asked += a.send(refusal) + a.send(refusal)
    assert p.names(asked) == ["MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_REQUEST"]
    a.send(mavlink.MAVLink_mission_ack_message(1, 1, mavlink.MAV_MISSION_OPERATION_CANCELLED, p.RALLY))
    assert "MISSION_REQUEST" not in p.names(a.wait(1))


def test_arducopter_always_uses_the_legacy_request(pilot: Pilots) -> None:
    a = pilot("ardupilot").ready()
    for _ in range(2):
        assert p.upload(a, p.square(60), p.FENCE) == (["MISSION_REQUEST"], 0)
    assert a.texts().count("Fence Indexed OK") == 2
    assert p.upload(a, p.mission(a, MISSION)) == (["MISSION_REQUEST"], 0)
    assert "Flight plan received" in a.texts()


def test_slot_0_of_arducopter_is_home(pilot: Pilots) -> None:
    a = pilot("ardupilot").ready()
    only = p.download(a)
    assert [m.command for m in only] == [16]
    p.upload(a, [p.waypoint(500, 500, 3), *MISSION])
    first = p.download(a)[0]
    home = a.config.home
    assert (first.x, first.y, first.z) == (home.latitude, home.longitude, home.amsl_mm / 1000)


def test_float_items_are_accepted(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour).ready()
    a.send(mavlink.MAVLink_mission_count_message(1, 1, 3, p.FENCE))
    for number, (x, y) in enumerate([(47.3976, 8.5454), (47.3979, 8.5454), (47.3979, 8.5458)]):
        message = mavlink.MAVLink_mission_item_message(1, 1, number, 0, 5001, 0, 1, 3, 0, 0, 0, x, y, 0, p.FENCE)
        replies = a.send(message)
    assert p.names(replies) == ["MISSION_ACK"]
    assert [m.x for m in p.download(a, p.FENCE)] == pytest.approx([473_976_000, 473_979_000, 473_979_000], abs=40)


def test_lost_items_are_requested_again_and_then_abandoned(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour).ready()
    replies = a.send(mavlink.MAVLink_mission_count_message(1, 1, 4, p.FENCE))
    assert p.names(replies) == ["MISSION_REQUEST"]
    again = p.names(a.wait(4))
    assert again == ["MISSION_REQUEST"] * (15 if a.px4 else 3)
    a.send(p.item(a, p.square(60)[0], 0, p.FENCE))
    later = a.wait(12)
    acks = [f.message.type for f in later if f.name == "MISSION_ACK"]
    assert acks == ([] if a.px4 else [15])
    assert p.names(a.wait(10)) == []
    assert p.download(a, p.FENCE) == []
    assert p.upload(a, p.square(60), p.FENCE)[1] == 0


def test_item_out_of_order_is_refused(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour).ready()
    rows = p.square(60)
    stray = a.send(p.item(a, rows[0], 0, p.FENCE))
    assert p.names(stray) == ([] if a.px4 else ["MISSION_ACK"])
    a.send(mavlink.MAVLink_mission_count_message(1, 1, 4, p.FENCE))
    early = a.send(p.item(a, rows[2], 2, p.FENCE))
    assert [f.message.type for f in early if f.name == "MISSION_ACK"] == ([] if a.px4 else [13])
    for number in range(4):
        replies = a.send(p.item(a, rows[number], number, p.FENCE))
    assert [f.message.type for f in replies if f.name == "MISSION_ACK"] == [0]


@pytest.mark.parametrize(
    ("kind", "rows", "result"),
    [
        (p.MISSION, [(16, 10, (0, 0, 0, 0), 1, 1, 5)] * 2, 2),  # a frame above terrain
        (p.MISSION, [(183, 2, (0, 0, 0, 0), 0, 0, 0)] * 2, 3),  # a command that it does not fly
        (p.MISSION, [(16, 2, (0, 0, 0, 0), 0, 0, 0)] * 2, 3),  # a waypoint nowhere
        (p.FENCE, p.square(60)[:3], 1),  # four vertices announced, three sent
        (p.FENCE, p.fence((0, 0), (1, 1)), 1),  # two vertices
        (p.FENCE, [(5003, 0, (0, 0, 0, 0), 0, 0, 0)], 1),  # a circle of no radius
        (p.FENCE, [(16, 0, (0, 0, 0, 0), 0, 0, 0)], 3),
        (p.RALLY, [(16, 0, (0, 0, 0, 0), 0, 0, 0)], 3),
    ],
)
def test_refused_upload_keeps_the_stored_plan(
    pilot: Pilots, flavour: str, kind: int, rows: list[Any], result: int
) -> None:
    a = pilot(flavour).ready()
    assert p.upload(a, p.square(30), p.FENCE)[1] == 0
    assert p.upload(a, rows, kind)[1] == result
    assert len(p.download(a, p.FENCE)) == 4


def test_invalid_places_are_refused(flavour: str, pilot: Pilots) -> None:
    a = pilot(flavour).ready()
    for x, y in ((nan, 8.5), (95.0, 8.5), (47.0, 181.0)):
        a.send(mavlink.MAVLink_mission_count_message(1, 1, 1, p.RALLY))
        message = mavlink.MAVLink_mission_item_message(1, 1, 0, 3, 5100, 0, 1, 0, 0, 0, 0, x, y, 0, p.RALLY)
        assert [f.message.type for f in a.send(message) if f.name == "MISSION_ACK"] == [10]
    huge = mavlink.MAVLink_mission_item_message(1, 1, 0, 2, 20, 0, 1, 0, 0, 0, 0, 3e9, 0, 0, p.MISSION)
    assert from_message(huge) is None


def test_too_many_items_and_unknown_kinds_are_refused(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour).ready()

    def result(message: Any) -> list[int]:
        return [f.message.type for f in a.send(message) if f.name == "MISSION_ACK"]

    assert result(mavlink.MAVLink_mission_count_message(1, 1, 5000, p.MISSION)) == [4]
    assert result(mavlink.MAVLink_mission_count_message(1, 1, 1, 7)) == [3]
    assert result(mavlink.MAVLink_mission_request_list_message(1, 1, 7)) == [3]
    assert result(mavlink.MAVLink_mission_clear_all_message(1, 1, 7)) == [3]
    assert result(mavlink.MAVLink_mission_request_int_message(1, 1, 99, p.MISSION)) == [13]
    assert result(mavlink.MAVLink_mission_request_partial_list_message(1, 1, 0, 1, p.MISSION)) == [3]
    assert result(mavlink.MAVLink_mission_write_partial_list_message(1, 1, 0, 1, p.MISSION)) == [3]


def test_clear_all_empties_plans(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour).ready()
    p.upload(a, p.mission(a, MISSION))
    p.upload(a, p.square(60), p.FENCE)
    assert p.names(a.send(mavlink.MAVLink_mission_clear_all_message(1, 1, p.FENCE))) == ["MISSION_ACK"]
    assert (len(p.download(a)), p.download(a, p.FENCE)) == (len(p.mission(a, MISSION)), [])
    a.send(mavlink.MAVLink_mission_clear_all_message(1, 1, p.ALL))
    assert p.download(a) == []
    p.upload(a, p.square(60), p.FENCE)
    assert p.upload(a, [], p.FENCE) == ([], 0)
    assert p.download(a, p.FENCE) == []


def test_second_sender_is_refused_during_an_upload(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour).ready()
    other = Codec(254, 190)
    a.send(mavlink.MAVLink_mission_count_message(1, 1, 4, p.FENCE))

    def ask(message: Any) -> list[int]:
        frames = a.take(a.simulation.receive(other.pack(message), a.simulation.now_us))
        return [f.message.type for f in frames if f.name == "MISSION_ACK" and f.message.target_system == 254]

    busy = 1 if a.px4 else 14
    assert ask(mavlink.MAVLink_mission_count_message(1, 1, 1, p.FENCE)) == [busy]
    assert ask(mavlink.MAVLink_mission_clear_all_message(1, 1, p.FENCE)) == [busy]
    assert ask(mavlink.MAVLink_mission_request_list_message(1, 1, p.FENCE)) == [busy]
    a.send(mavlink.MAVLink_mission_ack_message(1, 1, 15, p.FENCE))  # the first one gives up
    assert ask(mavlink.MAVLink_mission_clear_all_message(1, 1, p.FENCE)) == [0]


def test_px4_repeats_lost_items_of_a_download(pilot: Pilots) -> None:
    a = pilot("px4").ready()
    p.upload(a, p.square(60), p.FENCE)
    ask = mavlink.MAVLink_mission_request_int_message(1, 1, 0, p.FENCE)
    assert [f.message.type for f in a.send(ask) if f.name == "MISSION_ACK"] == [1]
    a.send(mavlink.MAVLink_mission_request_list_message(1, 1, p.FENCE))
    assert p.names(a.wait(0.6)) == ["MISSION_COUNT"] * 2
    a.send(ask)
    again = a.wait(0.6)
    assert [f.message.seq for f in again if f.name == "MISSION_ITEM_INT"] == [0, 0]
    assert len(p.names(a.wait(20))) < 20
    assert p.names(a.wait(1)) == []


def test_arducopter_sends_single_items_on_request(pilot: Pilots) -> None:
    a = pilot("ardupilot").ready()
    p.upload(a, p.square(60), p.FENCE)
    assert p.names(a.send(mavlink.MAVLink_mission_request_int_message(1, 1, 2, p.FENCE))) == ["MISSION_ITEM_INT"]


_MESSAGES = st.one_of(
    st.builds(mavlink.MAVLink_mission_count_message, st.just(1), st.just(1), st.integers(0, 6), st.integers(0, 4)),
    st.builds(
        mavlink.MAVLink_mission_item_int_message,
        st.just(1), st.just(1), st.integers(0, 5), st.sampled_from([0, 2, 3, 6]),
        st.sampled_from([16, 20, 21, 22, 177, 178, 5001, 5003, 5100]), st.just(0), st.just(1),
        *[st.floats(width=32) | st.just(3.0)] * 4,
        st.integers(-(2**31), 2**31 - 1) | st.just(473_980_000), st.just(85_455_900),
        st.floats(width=32), st.integers(0, 3),
    ),
    st.builds(mavlink.MAVLink_mission_request_message, st.just(1), st.just(1), st.integers(0, 6), st.integers(0, 3)),
    st.builds(mavlink.MAVLink_mission_request_list_message, st.just(1), st.just(1), st.integers(0, 3)),
    st.builds(mavlink.MAVLink_mission_clear_all_message, st.just(1), st.just(1), st.sampled_from([0, 1, 2, 255])),
    st.builds(mavlink.MAVLink_mission_set_current_message, st.just(1), st.just(1), st.integers(0, 9)),
    st.builds(mavlink.MAVLink_command_long_message, st.just(1), st.just(1), st.sampled_from([300, 400, 22, 224]),
              st.just(0), *[st.floats(width=32) | st.just(1.0)] * 7),
)  # fmt: skip


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(list(AutopilotKind)),
    st.lists(st.tuples(_MESSAGES, st.sampled_from([0, 20_000, 400_000])), max_size=20),
)
def test_any_order_of_messages_is_survived(kind: AutopilotKind, script: list[tuple[Any, int]]) -> None:
    simulation, codec = Simulation(SimulationConfig(flavour=kind)), Codec(255, 190)
    simulation.advance(1_500_000)
    for message, pause in script:
        simulation.receive(codec.pack(message), simulation.now_us + pause)
    simulation.advance(simulation.now_us + 300_000)
    assert simulation.truth().up_mm < 1_000_000
