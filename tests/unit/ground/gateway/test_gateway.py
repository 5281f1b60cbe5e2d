import json
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from reference.gateway_world import (
    SYSTEM,
    GatewayWorld,
    acks,
    command_long,
    item,
    proposals,
    reposition,
    setpoint,
    texts,
    told,
)
from rtshcua.ground.gateway.client_frames import made
from rtshcua.ground.gateway.interface import (
    Action,
    Cancel,
    ClientDown,
    ClientNote,
    FlightEnded,
    FromClient,
    FromPilot,
    FromVehicle,
    ProposalAnswered,
    ProposalChecked,
    Propose,
    Tick,
    ToClient,
    Withdraw,
)
from rtshcua.mavlink import layouts
from rtshcua.mavlink.modes import ARDUPILOT, PX4

TAKEOFF = command_long(22, 0, 0, 0, 0, 0, 0, 503)
LATE_TAKEOFF = command_long(22, 0, 0, 0, 0, 0, 0, 503, confirmation=1)
BEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


def number(actions: list[Action]) -> int:
    (found,) = (each.number for each in actions if isinstance(each, Propose))
    return found


def controls(actions: list[Action], client: int = 1) -> list[int]:
    """`gcs_main` of each CONTROL_STATUS to a client."""
    frames = [each.frame for each in actions if isinstance(each, ToClient) and each.client == client]
    return [frame[11] if frame[1] > 1 else 0 for frame in frames if frame[7:10] == b"\x00\x02\x00"]


def cancels(actions: list[Action]) -> list[int]:
    """The client of each cancellation."""
    return [each.client for each in actions if isinstance(each, Cancel)]


def beat(world: GatewayWorld, client: int = 1) -> None:
    """A client sends regular heartbeats."""
    for _ in range(3):
        world.send(BEAT, client=client)
        world.now_us += 100_000


def records(actions: list[Action]) -> list[Any]:
    return [json.loads(each.text) for each in actions if isinstance(each, ClientNote)]


# ---------------------------------------------------------------- answers to a command


def test_a_command_is_acknowledged_when_its_step_is_dispatched() -> None:
    world = GatewayWorld()
    world.ready()
    actions = world.send(TAKEOFF)
    assert acks(actions) == []
    world.accept(actions)
    actions = world.dispatch(0)
    assert acks(actions) == [(22, 0)]
    permitted = {"client": "script", "effect": "permitted", "skill": "takeoff", "step": 0}
    assert records(actions) == [permitted | {"arguments": {"altitude": "15 m"}}]
    assert acks(world.line(type="effect", event="dispatched", kind=0, step=0)) == []


def test_a_slow_command_is_in_progress_and_told_again() -> None:
    world = GatewayWorld()
    world.ready()
    actions = world.send(TAKEOFF)
    answers = [acks(world.wait(50_000)) for _ in range(190)]
    assert [50 * (at + 1) for at, answer in enumerate(answers) if answer == [(22, 5)]] == [250, 4_250, 8_250]  # ms
    world.accept(actions)
    assert acks(world.dispatch(0)) == [(22, 0)]
    assert acks(world.wait(9_000_000)) == []


def test_a_quick_command_is_never_in_progress() -> None:
    world = GatewayWorld()
    world.ready()
    actions = world.send(TAKEOFF)
    assert acks(world.wait(200_000)) == []
    world.accept(actions)
    assert acks(world.dispatch(0) + world.wait(5_000_000)) == [(22, 0)]


def test_a_repeated_command_is_one_proposal() -> None:
    world = GatewayWorld()
    world.ready()
    actions = world.send(TAKEOFF)
    assert world.send(LATE_TAKEOFF) == []
    world.wait(300_000)
    assert acks(world.send(LATE_TAKEOFF)) == [(22, 5)]
    world.accept(actions)
    world.dispatch(0)
    again = world.send(LATE_TAKEOFF)
    assert (acks(again), proposals(again)) == ([(22, 0)], [])


def test_decisions_of_the_flight_are_answers() -> None:
    """By hand: outcome, reason, and the result."""
    for outcome, reason, result in (
        ("deny", "authority/forbidden", 2), ("fallback", "state/violated", 1), ("defer", "approval/awaited", None),
    ):  # fmt: skip
        world = GatewayWorld()
        world.ready()
        world.accept(world.send(TAKEOFF))
        decided = {
            "type": "decision",
            "kind": 0,
            "step": 0,
            "outcome": outcome,
            "reason": reason,
            "clause": "battery > 30 %",
        }
        actions = world.line(**decided)
        assert acks(actions) == ([] if result is None else [(22, result)])
        assert texts(actions) == [f"takeoff {outcome}: {reason} (battery > 30 %)"]
        assert texts(world.line(**decided)) == [], "once"
        if result is None:
            assert acks(world.dispatch(0)) == [(22, 0)]
    world = GatewayWorld()
    world.ready()
    world.accept(world.send(TAKEOFF))
    assert world.line(type="decision", kind=0, step=0, outcome="allow", reason="admitted", clause=None) == []
    assert world.line(type="decision", kind=2, step=0, outcome="deny", reason="x", clause=None) == [], "a link"
    assert world.line(type="decision", kind=0, step=5, outcome="deny", reason="x", clause=None) == [], "another step"
    assert world.line(type="effect", event="noted", kind=0) == []
    actions = world.line(type="effect", event="refused", kind=0, step=0)
    assert acks(actions) == [(22, 1)]


def test_refusals_of_the_worker_and_of_the_flight_are_answers() -> None:
    for checked, slug, result in ((None, "busy", 1), (None, "other-policy", 2), ("it ends in the school", "", 2)):
        world = GatewayWorld()
        world.ready()
        proposed = number(world.send(TAKEOFF))
        actions = world.take(ProposalChecked(proposed, checked))
        if checked is None:
            actions = world.take(ProposalAnswered(proposed, slug, "no"))
        assert acks(actions) == [(22, result)]
        assert texts(actions) == [f"takeoff refused: {checked or f'{slug}: no'}"]
        assert proposals(world.send(TAKEOFF)) != [], "it may be asked for again"
    world = GatewayWorld()
    world.ready()
    actions = world.take(ProposalChecked(number(world.send(TAKEOFF)), "too many commands at once", for_now=True))
    assert acks(actions) == [(22, 1)]
    world = GatewayWorld()
    assert world.take(ProposalChecked(9, None)) == []
    assert world.take(ProposalAnswered(9, "accepted")) == []
    world.ready()
    proposed = number(world.send(TAKEOFF))
    assert texts(world.take(ProposalAnswered(proposed, "replayed"))) == ["takeoff refused: replayed"]


def test_nobody_waits_for_ever() -> None:
    world = GatewayWorld()
    world.ready()
    proposed = number(world.send(TAKEOFF))
    actions = world.wait(31_000_000, step_us=500_000)
    assert acks(actions)[-1] == (22, 1)
    assert texts(actions) == ["takeoff rejected: nothing answered in time"]
    assert Withdraw(proposed) in actions, "it does not fly after all"
    world = GatewayWorld()
    world.ready()
    world.accept(world.send(TAKEOFF))
    assert (22, 1) not in acks(world.wait(60_000_000, step_us=500_000)), "an approval may take longer"


def test_what_the_flight_has_is_in_progress_until_the_flight_answers() -> None:
    """It may still fly, so nobody is told that it was rejected or cancelled."""
    for cancelled in (False, True):
        world = GatewayWorld()
        world.ready()
        world.take(ProposalChecked(number(world.send(TAKEOFF)), None, 0))
        actions = command_cancel(world, 22) if cancelled else []
        actions += world.wait(60_000_000, step_us=500_000)
        assert {result for _, result in acks(actions)} == {5}
        actions = world.line(type="mission")
        assert cancels(actions) == ([1] if cancelled else [])
        assert acks(world.line(type="close", ending="ended")) == [(22, 6 if cancelled else 1)]


def test_records_of_cancelled_commands_are_counted_beyond_a_rate() -> None:
    world = GatewayWorld()
    recorded = []
    for _ in range(200):
        recorded += records(world.send(TAKEOFF)) + records(command_cancel(world, 22))
        world.wait(50_000)
    assert len(recorded) <= 20 + 5 * 10 + 1
    assert any(each.get("left_out") for each in recorded)


def test_a_new_target_supersedes_the_one_before() -> None:
    world = GatewayWorld()
    world.fly()
    first = world.send(reposition())
    world.accept(first)
    world.dispatch(0)
    second = world.send(reposition(z=509))
    assert len(proposals(second)) == 1
    world.accept(second, first=1)
    assert acks(world.line(type="effect", event="superseded", kind=0, step=0)) == []
    assert acks(world.dispatch(1)) == [(192, 0)]
    assert len(proposals(world.send(reposition()))) == 1, "the first one is a new target now"


def test_a_proposal_that_was_not_dispatched_is_cancelled_by_a_later_one() -> None:
    world = GatewayWorld()
    world.fly()
    first, second = world.send(reposition()), world.send(reposition(z=509))
    world.accept(first)
    actions = world.take(ProposalChecked(number(second), None, 0)) + world.take(
        ProposalAnswered(number(second), "accepted")
    )
    assert acks(actions) == [(192, 6)]
    assert acks(world.dispatch(0)) == [(192, 0)]


def test_open_proposals_of_a_client_are_bounded() -> None:
    world = GatewayWorld()
    world.fly()
    found = [acks(world.send(reposition(z=505 + at))) for at in range(6)]
    assert found == [[], [], [], [], [(192, 1)], [(192, 1)]]


def test_a_step_refused_while_another_flies_leaves_that_one() -> None:
    world = GatewayWorld()
    world.fly()
    world.accept(world.send(reposition()))
    world.dispatch(0)
    world.accept(world.send(reposition(z=509)), first=1)
    assert acks(world.line(type="effect", event="declined", kind=0, step=1)) == [(192, 1)]
    world.line(type="effect", event="succeeded", kind=0, step=0)


# ---------------------------------------------------------------- repeated setpoints


def test_every_command_for_one_step_is_answered() -> None:
    world = GatewayWorld()
    world.fly()
    world.client(2, "script")
    landing = command_long(21)
    proposed = world.send(landing)
    for message, client in ((SAFE_MODES[2], 1), (landing, 1), (landing, 2)):
        assert proposals(world.send(message, client=client)) == proposals(proposed) * (client == 2)
    world.accept(proposed)
    assert acks(world.dispatch(0)) == [(21, 0), (176, 0)]
    world = GatewayWorld(ARDUPILOT)
    world.fly()
    target = item(0, 16, x=473_983_000, y=85_455_900, z=20)
    target.current = 2
    proposed = world.send(reposition())
    world.send(target)
    world.send(setpoint())
    world.accept(proposed)
    actions = world.dispatch(0)
    assert acks(actions) == [(192, 0)]
    assert [each.type for each in told(actions) if each.get_type() == "MISSION_ACK"] == [0]
    world = GatewayWorld()
    world.fly()
    world.send(landing)
    actions = [each for at in range(40) for each in world.send(landing, sender=(at + 1, 1))]
    assert (21, 1) in acks(actions), "so many are answered, and no more"


def test_a_target_is_flown_to_again_after_the_flight_has_left_it() -> None:
    """By hand: the kind and the number of a link of the contingency, and whether it moves the vehicle."""
    for kind, link, moves in ((2, 0, False), (2, 1, True), (1, 0, True)):
        world = GatewayWorld()
        world.fly()
        world.accept(world.send(reposition()))
        world.dispatch(0)
        world.line(type="effect", event="succeeded", kind=0, step=0)
        world.line(type="effect", event="dispatched", kind=kind, step=-1, link=link)
        actions = world.send(reposition())
        assert (len(proposals(actions)), acks(actions)) == ((1, []) if moves else (0, [(192, 0)]))


def test_a_stream_of_one_target_is_one_proposal() -> None:
    world = GatewayWorld()
    world.fly()
    world.offboard()
    world.done.clear()
    found = []
    for at in range(100):  # 10 s at 10 Hz
        world.now_us += 100_000
        actions = world.send(setpoint())
        found += proposals(actions)
        if at == 3:
            world.take(ProposalChecked(1, None, 0))
            world.take(ProposalAnswered(1, "accepted"))
            world.dispatch(0)
        if at == 50:
            world.line(type="effect", event="succeeded", kind=0, step=0)
    assert len(found) == 1, "also after it was reached"
    assert acks(world.done) == []


def test_a_moving_target_is_proposed_at_most_twice_a_second() -> None:
    world = GatewayWorld()
    world.fly()
    world.offboard()
    found = 0
    for at in range(100):
        world.now_us += 100_000
        actions = world.send(setpoint(z=10 + at / 10))
        if proposals(actions):
            world.accept(actions, first=found)
            world.dispatch(found)
            found += 1
    assert found == 20


def test_setpoints_wait_for_the_answer_to_the_one_before() -> None:
    world = GatewayWorld()
    world.fly()
    world.offboard()
    assert len(proposals(world.send(setpoint()))) == 1
    world.now_us += 600_000
    assert proposals(world.send(setpoint(z=21))) == []


SAFE = (command_long(21), command_long(20), command_long(193, 0))
SAFE_MODES = tuple(command_long(176, 1, 4, sub) for sub in (3, 5, 6))  # Hold, Return, Land
DISARMS = command_long(400, 0)


# ---------------------------------------------------------------- what is withdrawn


@pytest.mark.parametrize("message", [DISARMS, *SAFE, *SAFE_MODES])
def test_what_is_not_handed_in_is_withdrawn_by_a_client_that_disarms_stops_or_lands(message: Any) -> None:
    world = GatewayWorld()
    world.ready()
    proposed = number(world.send(TAKEOFF))
    actions = world.send(message)
    assert Withdraw(proposed) in actions
    said = acks(actions)
    assert said[0] == (22, 6)
    assert said[1:] == [(int(message.command), 1 if message in SAFE else 0)], "on the ground nothing lands or stops"
    assert acks(world.take(ProposalChecked(proposed, None))) == [], "it is forgotten"


@pytest.mark.parametrize("message", [DISARMS, *SAFE, *SAFE_MODES])
def test_what_is_with_the_flight_is_cancelled_and_the_client_is_not_told_that_it_is_safe(message: Any) -> None:
    """The flight has the bundle, but has not announced its mission."""
    world = GatewayWorld()
    world.ready()
    world.accept(world.send(TAKEOFF))
    actions = world.send(message)
    assert (int(message.command), 0) not in acks(actions)
    assert not cancels(actions), "nothing can be cancelled yet"
    assert cancels(world.line(type="mission")) == [1]
    assert cancels(world.wait(5_000_000)) == [], "once"
    assert acks(world.line(type="close", ending="cancelled")) == [(22, 6)]
    assert acks(world.send(DISARMS)) == [(400, 0)]


def command_cancel(
    world: GatewayWorld, command: int, client: int = 1, target: tuple[int, int] = (1, 1)
) -> list[Action]:
    values = {"command": command, "target_system": target[0], "target_component": target[1]}
    return world.take(FromClient(client, made(layouts.COMMAND_CANCEL, values, (245, 190), 0)))


def test_a_command_that_waits_for_a_flight_is_cancelled() -> None:
    world = GatewayWorld()
    world.client(2, "other")
    assert acks(world.send(TAKEOFF)) == [(22, 5)]
    assert acks(command_cancel(world, 22, 2), 2) == []
    assert texts(command_cancel(world, 22, 2), 2) == [], "once"
    assert acks(command_cancel(world, 192)) == []
    assert command_cancel(world, 22, target=(1, 100)) == []
    actions = command_cancel(world, 22)
    assert (acks(actions), texts(actions)) == ([(22, 6)], [])
    world.ready()
    assert proposals(world.wait(1_000_000)) == []


def test_a_command_is_cancelled_before_its_step_is_handed_in() -> None:
    world = GatewayWorld()
    world.ready()
    proposed = number(world.send(TAKEOFF))
    actions = command_cancel(world, 22)
    assert Withdraw(proposed) in actions
    assert (acks(actions), texts(actions)) == ([(22, 6)], ["takeoff withdrawn: script cancels the command"])
    assert cancels(world.line(type="mission")) == []
    assert texts(command_cancel(world, 22)) == ["command 22 is not in progress: stop, return or land"]


def test_a_command_that_the_flight_has_is_cancelled_with_the_flight() -> None:
    world = GatewayWorld()
    world.ready()
    world.accept(world.send(TAKEOFF))
    assert acks(command_cancel(world, 22)) == []
    assert cancels(world.line(type="mission")) == [1]
    assert acks(command_cancel(world, 22)) == [], "repeated until it is answered"
    assert acks(world.line(type="close", ending="cancelled")) == [(22, 6)]


def test_a_command_that_was_answered_is_not_cancelled() -> None:
    world = GatewayWorld()
    world.fly()
    world.accept(world.send(reposition()))
    assert acks(world.dispatch(0)) == [(192, 0)]
    actions = command_cancel(world, 192)
    assert (acks(actions), cancels(actions)) == ([], [])
    assert texts(actions) == ["command 192 is not in progress: stop, return or land"]
    assert [each["effect"] for each in records(actions)] == ["absorbed"]


def test_a_pilots_request_for_another_vehicle_gives_no_control_here() -> None:
    world = GatewayWorld()
    world.client(9, "tower", pilot=True)
    for target in ((2, 1), (1, 100)):
        asks = command_long(32100, 1)
        asks.target_system, asks.target_component = target
        actions = world.send(asks, client=9, sender=(250, 1), pilot=True)
        assert [each["effect"] for each in records(actions)] == ["passed"]
        assert controls(actions) == []
        assert acks(actions, 9) == []


def test_a_pilots_command_cancel_is_recorded_and_gives_no_control() -> None:
    world = GatewayWorld()
    world.client(9, "tower", pilot=True)
    values = {"command": 32_100, "target_system": 1, "target_component": 1}
    actions = world.take(FromPilot(9, made(layouts.COMMAND_CANCEL, values, (250, 1), 0)))
    assert [(each["effect"], each["command"]) for each in records(actions)] == [("passed", 32_100)]
    assert (acks(actions, 9), controls(actions)) == ([], [])


@pytest.mark.parametrize("message", [DISARMS, *SAFE])
def test_a_take_off_that_waits_for_approval_is_cancelled(message: Any) -> None:
    world = GatewayWorld()
    world.ready()
    world.accept(world.send(TAKEOFF))
    world.line(type="mission")
    world.line(type="decision", kind=0, step=0, outcome="defer", reason="approval/awaited")
    actions = world.send(message)
    assert (cancels(actions), (400, 0) in acks(actions)) == ([1], False)


def test_a_disarming_while_another_clients_take_off_is_under_way_is_no_success() -> None:
    world = GatewayWorld()
    world.client(2, "other")
    world.ready()
    proposed = world.send(TAKEOFF)
    actions = world.send(DISARMS, client=2)
    assert (acks(actions, 2), texts(actions, 2)) == (
        [(400, 1)], ["disarming is refused: takeoff is under way: land"]
    )  # fmt: skip
    assert acks(world.send(SAFE_MODES[0], client=2), 2) == [(176, 1)]
    world.accept(proposed)
    assert acks(world.dispatch(0)) == [(22, 0)]


@pytest.mark.parametrize("message", SAFE_MODES)
def test_a_mode_that_stops_or_lands_withdraws_what_waits_for_a_flight(message: Any) -> None:
    world = GatewayWorld()
    world.send(TAKEOFF)
    assert acks(world.send(message)) == [(22, 6), (176, 0)]
    world.ready()
    assert proposals(world.wait(100_000)) == []


@pytest.mark.parametrize("message", [*SAFE, *SAFE_MODES])
def test_no_target_from_before_supersedes_a_step_that_stops_or_lands(message: Any) -> None:
    """Whoever asked for the target: the one who lands, by any connection, or another client."""
    for lands, name in ((1, "script"), (2, "script"), (2, "other")):
        world = GatewayWorld()
        world.fly()
        world.client(2, name)
        pending = [number(world.send(reposition(z=508 + at))) for at in range(4)]
        actions = world.send(message, client=lands)
        assert len(proposals(actions)) == 1
        assert [each.number for each in actions if isinstance(each, Withdraw)] == pending
        assert acks(actions) == [(192, 6)] * 4


def test_a_return_that_waits_is_not_withdrawn_by_a_landing() -> None:
    world = GatewayWorld()
    world.fly()
    world.send(command_long(20))
    assert not [each for each in world.send(command_long(21)) if isinstance(each, Withdraw)]


def piloted() -> GatewayWorld:
    world = GatewayWorld()
    world.client(9, "tower", pilot=True)
    return world


def control(world: GatewayWorld, wanted: int, station: int = 9, system: int = 255, to: int = SYSTEM) -> list[Action]:
    """A pilot requests or releases control."""
    message = mavlink.MAVLink_command_long_message(to, 1, 32_100, 0, 0, wanted, 0, 0, 0, 0, 0)
    return world.send(message, client=station, sender=(system, 190), pilot=True)


def test_nothing_that_waits_flies_once_the_pilot_is_in_control() -> None:
    world = piloted()
    world.send(TAKEOFF)
    assert acks(control(world, 1)) == [(22, 6)], "it waited for a flight"
    world = piloted()
    world.ready()
    proposed = number(world.send(TAKEOFF))
    actions = control(world, 1)
    assert (acks(actions), texts(actions)) == ([(22, 6)], ["takeoff withdrawn: the pilot is in control"])
    assert Withdraw(proposed) in actions
    world = piloted()
    world.ready()
    world.accept(world.send(TAKEOFF))
    assert cancels(control(world, 1) + world.line(type="mission")) == [1]
    world = piloted()
    world.fly()
    for message in (reposition(), command_long(21)):
        proposed = number(world.send(message))
        assert Withdraw(proposed) in control(world, 1), "landings too"
        control(world, 0)


def test_nobody_arms_while_the_pilot_is_in_control() -> None:
    """No take-off could follow."""
    world = piloted()
    world.ready()
    control(world, 1)
    actions = world.send(command_long(400, 1))
    assert acks(actions) == [(400, 1)]
    assert texts(actions) == ["Arming denied: the pilot is in control"]
    control(world, 0)
    world.wait(1_000_000)
    assert acks(world.send(command_long(400, 1))) == [(400, 0)]


def test_a_pilot_is_answered_and_told_who_is_in_control() -> None:
    world = piloted()
    world.client(8, "other tower", pilot=True)
    assert controls(world.wait(1_000_000), 9) == [0]
    actions = control(world, 1)
    assert acks(actions, 9) == [(32_100, 0)]
    assert [controls(actions, each) for each in (1, 8, 9)] == [[255]] * 3
    assert acks(control(world, 1), 9) == [(32_100, 0)], "again"
    assert acks(control(world, 0, to=7), 9) == [], "of another vehicle"
    released = control(world, 0)
    assert (acks(released, 9), controls(released, 9)) == ([(32_100, 0)], [0])
    assert acks(control(world, 0), 9) == [(32_100, 0)]


def test_only_the_pilot_who_has_control_releases_it_and_his_station_keeps_it_behind_a_radio() -> None:
    world = piloted()
    world.client(8, "other tower", pilot=True)
    control(world, 1)
    for station, system in ((9, 254), (8, 255)):
        actions = control(world, 0, station, system)
        assert acks(actions, station) == [(32_100, 2)]
        assert texts(actions, station) == ["another pilot is in control"]
    world.take(ClientDown(8))
    assert texts(world.send(TAKEOFF)) == ["takeoff rejected: the pilot is in control"]
    radio = mavlink.MAVLink_radio_status_message(1, 1, 1, 1, 1, 1, 1)
    world.send(radio, client=9, sender=(51, 68), pilot=True)
    world.take(ClientDown(9))
    world.wait(300_000)
    assert acks(world.send(TAKEOFF)) == [(22, 5)], "he is gone"
    world.client(8, "other tower", pilot=True)
    control(world, 1, 8, 254)
    assert controls(world.wait(1_000_000)) == [254]
    assert controls(control(world, 1, 8, 253)) == [253], "another pilot takes it"


def test_a_take_off_of_a_dead_client_is_withdrawn_on_the_ground() -> None:
    """By hand: whether the flight has it already, and whether the client disconnects."""
    for handed_in in (False, True):
        for gone in (False, True):
            world = GatewayWorld()
            world.ready()
            beat(world)
            proposed = number(world.send(TAKEOFF))
            if handed_in:
                world.take(ProposalChecked(proposed, None))
            actions = world.take(ClientDown(1)) if gone else world.wait(6_000_000)
            assert (Withdraw(proposed) in actions) is not handed_in
            if handed_in:
                world.take(ProposalAnswered(proposed, "accepted"))
                assert cancels(world.line(type="mission")) == [1]


def test_a_dead_connection_withdraws_nothing_while_another_one_of_its_client_lives() -> None:
    world = GatewayWorld()
    world.client(2, "script")
    world.ready()
    beat(world)
    world.send(TAKEOFF)
    assert not [each for each in world.take(ClientDown(1)) if isinstance(each, Withdraw)]


def test_a_program_that_sends_no_heartbeats_is_not_judged_by_those_of_the_one_before() -> None:
    """At an address with one peer both are one client; a radio on the way lives longer than either."""
    radio = mavlink.MAVLink_radio_status_message(1, 1, 1, 1, 1, 1, 1)
    for message, sender, cancelled in ((reposition(z=509), (245, 190), False), (radio, (51, 68), True)):
        world = GatewayWorld()
        world.fly()
        beat(world)
        for _ in range(6):
            world.wait(1_000_000)
            world.send(message if cancelled else LATE_TAKEOFF, sender=sender)
        if not cancelled:
            world.accept(world.send(message))
            world.dispatch(0)
            assert cancels(world.wait(10_000_000)) == []
        else:
            assert [each.said["effect"] for each in world.done if isinstance(each, ClientNote)] == ["dead"]


def test_a_radio_is_never_in_control() -> None:
    world = GatewayWorld()
    world.fly()
    world.accept(world.send(reposition()))
    world.dispatch(0)
    world.send(mavlink.MAVLink_radio_status_message(1, 1, 1, 1, 1, 1, 1), sender=(51, 68))
    assert controls(world.wait(1_000_000)) == [245]


# ---------------------------------------------------------------- which setpoints are heeded


@pytest.mark.parametrize("autopilot", [PX4, ARDUPILOT])
def test_setpoints_are_ignored_after_a_safe_step_until_their_mode_is_asked_for(autopilot: int) -> None:
    modes = {PX4: ((4, 5), (4, 6), (4, 3)), ARDUPILOT: ((6, 0), (9, 0), (5, 0))}[autopilot]
    for message in (*SAFE, *(command_long(176, 1, *mode) for mode in modes)):
        world = GatewayWorld(autopilot)
        world.fly()
        world.client(2, "script")
        if autopilot == PX4:
            actions = world.send(setpoint())
            assert (proposals(actions), texts(actions)) == ([], ["setpoints wait until you ask for mode OFFBOARD"])
        world.offboard(client=2)
        world.now_us += 200_000
        first = world.send(setpoint())
        assert len(proposals(first)) == 1
        world.accept(first)
        world.dispatch(0)
        world.wait(1_000_000)
        safe = world.send(message)
        world.accept(safe, 1)
        world.dispatch(1)
        for _ in range(20):
            world.wait(200_000)
            assert proposals(world.send(setpoint(z=25)) + world.send(setpoint(z=26), client=2)) == []
        world.offboard()
        world.wait(200_000)
        assert len(proposals(world.send(setpoint(z=25)))) == 1


# ---------------------------------------------------------------- where a step makes no sense


def test_on_the_ground_only_a_take_off_is_taken() -> None:
    world = GatewayWorld()
    actions = world.send(reposition())
    assert (acks(actions), texts(actions)) == (
        [(192, 1)], ["goto rejected: the vehicle is on the ground: take off first"]
    )  # fmt: skip
    world.ready()
    world.line(type="vehicle", ready=False, unready="no position")
    assert texts(world.send(TAKEOFF)) == ["takeoff rejected: no position"]
    world.report(airborne=True, armed=True)
    assert texts(world.send(TAKEOFF)) == ["takeoff rejected: the vehicle flies under another control"]


def test_a_command_waits_for_the_next_flight_for_a_bounded_time() -> None:
    world = GatewayWorld()
    assert acks(world.send(TAKEOFF)) == [(22, 5)]
    assert acks(world.send(TAKEOFF)) == [(22, 5)], "the same once more"
    actions = world.wait(9_900_000)
    assert (acks(actions), proposals(actions)) == ([(22, 5), (22, 5)], []), "every four seconds"
    actions = world.wait(200_000)
    assert (acks(actions), texts(actions)) == ([(22, 1)], ["takeoff rejected: no flight is ready yet"])
    world.send(TAKEOFF)
    world.ready()
    assert [each for each, *_ in proposals(world.wait(100_000))] == ["takeoff"], "once"
    assert proposals(world.wait(11_000_000)) == []


def test_a_client_reads_why_the_vehicle_is_not_ready() -> None:
    """Where it waited for the flight, and where the vehicle is no longer ready."""
    world = GatewayWorld()
    world.send(TAKEOFF)
    world.line(type="hello")
    world.line(type="waiting")
    assert proposals(world.wait(500_000)) == [], "the flight has not said yet whether the vehicle is ready"
    world.line(type="vehicle", ready=False, unready="no position")
    actions = world.wait(100_000)
    assert (acks(actions), texts(actions)) == ([(22, 1)], ["takeoff rejected: no position"])
    world.line(type="vehicle", ready=True)
    assert proposals(world.send(TAKEOFF)) != []
    for _ in range(2):
        told = world.line(type="vehicle", ready=False, unready="no position")
    assert texts(world.done) == [*texts(world.done)[:-1], "takeoff waits: no position"]
    assert texts(told) == [], "once"


def test_commands_that_wait_for_a_flight_are_bounded_and_go_with_their_client() -> None:
    world = GatewayWorld()
    heights = [command_long(22, 0, 0, 0, 0, 0, 0, 495 + number) for number in range(6)]
    assert [acks(world.send(each)) for each in heights] == [[(22, 5)]] * 6, "the last one counts"
    world.client(2, "other")
    assert acks(world.send(heights[0], client=2), 2) == [(22, 5)]
    world.take(ClientDown(1))
    world.ready()
    assert [each.client for each in world.wait(100_000) if isinstance(each, Propose)] == [2]
    world = GatewayWorld()
    for each in heights:
        world.send(each)
    world.ready()
    (one,) = (each for each in world.wait(100_000) if isinstance(each, Propose))
    assert one.steps[0].values == (12_000,)


@pytest.mark.parametrize("message", [command_long(400, 0), command_long(21), command_long(20)])
def test_a_client_that_lands_or_disarms_withdraws_what_waits(message: Any) -> None:
    world = GatewayWorld()
    world.send(TAKEOFF)
    assert (22, 6) in acks(world.send(message))
    world.ready()
    assert proposals(world.wait(100_000)) == []


def test_the_command_of_a_dead_client_waits_no_longer() -> None:
    world = GatewayWorld()
    for _ in range(4):
        world.send(BEAT)
        world.wait(1_000_000)
    world.send(TAKEOFF)
    world.wait(6_000_000)
    world.ready()
    assert proposals(world.wait(500_000)) == []


# ---------------------------------------------------------------- two clients


def two(rank: int = 0) -> GatewayWorld:
    world = GatewayWorld()
    world.client(2, "other", rank=rank)
    world.fly()
    world.accept(world.send(reposition()))
    world.dispatch(0)
    return world


def test_who_sends_last_does_not_win() -> None:
    world = two()
    actions = world.send(reposition(z=509), client=2)
    assert acks(actions, 2) == [(192, 1)]
    assert texts(actions, 2) == ["goto rejected: script is in control"]
    assert proposals(actions) == []


def test_a_higher_rank_supersedes() -> None:
    assert len(proposals(two(rank=1).send(reposition(z=509), client=2))) == 1
    lower = two(rank=-1)
    assert proposals(lower.send(reposition(z=509), client=2)) == []


def test_what_stops_or_lands_is_anybodys_that_the_policy_permits() -> None:
    for message, skill in (
        (command_long(20), "return_home"),
        (command_long(21), "emergency_land"),
        (command_long(193), "hover"),
    ):
        assert [each for each, *_ in proposals(two().send(message, client=2))] == [skill]


def test_nobody_stops_the_landing_of_another() -> None:
    """MAVSDK asks ArduPilot to hold before it arms: a program that begins must not end what comes down. By hand: the
    step that flies, the one that another client asks for, and whether it is taken.
    """
    hover, back, land = (command_long(number) for number in (193, 20, 21))
    table = (
        (land, hover, False), (land, back, False), (land, land, True),
        (back, hover, False), (back, land, True), (hover, back, True), (hover, hover, True),
    )  # fmt: skip
    for flies, asked, taken in table:
        world = GatewayWorld()
        world.client(2, "other")
        world.fly()
        world.accept(world.send(flies))
        world.dispatch(0)
        assert bool(proposals(world.send(asked, client=2))) is taken, (flies, asked)
        assert taken or proposals(world.send(hover)), "its own client may"


def test_a_landing_that_waits_for_its_dispatch_is_not_superseded_either() -> None:
    world = GatewayWorld()
    world.client(2, "other")
    world.fly()
    world.accept(world.send(command_long(21)))
    assert proposals(world.send(command_long(193), client=2)) == []


def test_a_landing_whose_client_is_gone_goes_on() -> None:
    world = GatewayWorld()
    world.client(2, "other")
    world.fly()
    world.accept(world.send(command_long(21)))
    world.dispatch(0)
    world.take(ClientDown(1))
    for message in (reposition(), command_long(193)):
        actions = world.send(message, client=2)
        assert proposals(actions) == []
        assert any("script is in control" in text for text in texts(actions, 2))
    world.client(3, "script")
    assert proposals(world.send(reposition(), client=3)) != [], "its own, connected again"


def test_what_makes_the_flight_safer_gives_no_control() -> None:
    world = two()
    hover = number(world.send(command_long(193), client=2))
    assert texts(world.send(reposition(z=509), client=2), 2) == ["goto rejected: script is in control"]
    world.take(ProposalChecked(hover, None, 1))
    world.take(ProposalAnswered(hover, "accepted"))
    world.dispatch(1)
    assert texts(world.send(reposition(z=510), client=2), 2) == ["goto rejected: script is in control"]
    assert proposals(world.send(reposition(z=511))) != [], "who is in control may go on"


def test_control_is_kept_for_a_time_after_the_last_step() -> None:
    world = two()
    world.line(type="effect", event="succeeded", kind=0, step=0)
    world.wait(9_000_000, step_us=500_000)
    assert proposals(world.send(reposition(z=509), client=2)) == []
    world.wait(1_500_000)
    assert len(proposals(world.send(reposition(z=509), client=2))) == 1


def test_control_status_says_who_is_in_control() -> None:
    world = GatewayWorld()
    world.client(2, "other")
    world.fly()
    assert set(controls(world.wait(1_100_000))) == {0}
    world.send(BEAT, sender=(44, 1))
    world.accept(world.send(reposition(), sender=(44, 1)))
    world.dispatch(0)
    assert controls(world.wait(1_000_000), client=2) == [44]
    assert len(controls(world.wait(5_000_000))) == 5


def test_a_client_that_requests_control_is_told_who_has_it() -> None:
    world = GatewayWorld()
    actions = world.send(command_long(32100, 0, 1))
    assert (acks(actions), texts(actions)) == (
        [(32100, 2)], ["nobody is in control: a step that is flown gives control"]
    )  # fmt: skip
    world = two()
    assert acks(world.send(command_long(32100, 0, 1))) == [(32100, 0)]
    assert texts(world.send(command_long(32100, 0, 1), client=2), 2) == ["script is in control"]


def test_a_pilot_in_control_keeps_every_client_out_until_he_releases() -> None:
    world = GatewayWorld()
    world.client(9, "tower", pilot=True)
    world.fly()
    actions = world.send(command_long(32100, 0, 1), client=9, sender=(250, 1), pilot=True)
    assert controls(actions) == [250]
    assert records(actions) == [{"client": "tower", "effect": "absorbed", "message": 76, "command": 32100}]
    actions = world.send(reposition())
    assert (acks(actions), texts(actions)) == ([(192, 1)], ["goto rejected: the pilot is in control"])
    assert texts(world.send(command_long(32100, 0, 1))) == ["the pilot is in control"]
    world.send(command_long(32100, 0, 0), client=9, sender=(250, 1), pilot=True)
    assert len(proposals(world.send(reposition()))) == 1
    assert controls(world.send(command_long(32100, 1, 0, 10, 250), client=9, sender=(250, 1), pilot=True)) == [250]
    released = world.send(command_long(32100, 0, 1, 10, 250), client=9, sender=(250, 1), pilot=True)
    assert 250 not in controls(released), "of the dialect since 2026 the action comes first"
    world.send(command_long(32100, 0, 1), client=9, sender=(250, 1), pilot=True)
    world.take(ClientDown(9))
    assert controls(world.wait(1_100_000)) != [250], "a pilot who is gone holds nothing"


def test_what_a_pilot_commands_is_recorded_and_his_telemetry_is_not() -> None:
    world = GatewayWorld()
    world.client(9, "tower", pilot=True)
    assert world.send(BEAT, client=9, pilot=True) == []
    assert records(world.send(mavlink.MAVLink_set_mode_message(1, 1, 5), client=9, pilot=True)) == [
        {"client": "tower", "effect": "passed", "message": 11}
    ]
    assert world.send(BEAT, client=8, pilot=True) == [], "an unknown pilot"
    assert world.send(TAKEOFF, client=9) == [], "a pilot's frame goes to the vehicle, and nowhere else"


def test_a_takeover_is_told_to_every_client() -> None:
    world = two()
    actions = world.line(type="effect", event="taken-over", step=0, kind=0)
    for client in (1, 2):
        assert texts(actions, client) == ["the pilot took over: the flight of your steps ended"]


# ---------------------------------------------------------------- the end of flights and clients


def test_the_end_of_the_flight_ends_what_waits() -> None:
    world = GatewayWorld()
    world.ready()
    world.accept(world.send(TAKEOFF))
    actions = world.line(type="close", ending="aborted")
    assert (acks(actions), texts(actions)) == ([(22, 1)], ["takeoff ended with the flight: aborted"])
    world.ready()
    world.accept(world.send(TAKEOFF))
    actions = world.take(FlightEnded())
    assert texts(actions) == ["takeoff ended with the flight"]
    assert world.take(FlightEnded()) == []
    assert world.line(type="other") == []


def test_a_dead_client_ends_its_flight_and_a_living_one_does_not() -> None:
    world = two()
    world.send(BEAT)
    world.send(BEAT, client=2)
    for _ in range(10):
        world.send(BEAT)
        assert not [each for each in world.wait(1_000_000) if isinstance(each, Cancel)]
    world.send(BEAT, client=2)
    actions = world.wait(5_500_000)
    assert [each for each in actions if isinstance(each, Cancel)] == [Cancel(1, "script is silent")]
    assert texts(actions, 2) == ["script is silent: the flight is cancelled"]
    assert not [each for each in world.wait(5_000_000) if isinstance(each, Cancel)], "once"


def test_a_dead_client_whose_step_was_the_last_ends_the_flight_if_nobody_else_beats() -> None:
    for others, cancelled in (((), True), ((2,), False)):
        world = two()
        world.line(type="effect", event="succeeded", kind=0, step=0)
        for _ in range(4):
            world.send(BEAT)
            for each in others:
                world.send(BEAT, client=each)
            world.wait(1_000_000)
        actions = []
        for _ in range(5):
            for each in others:
                world.send(BEAT, client=each)
            actions += world.wait(1_000_000)
        assert (Cancel(1, "script is silent") in actions) is cancelled


def test_all_clients_that_die_together_end_the_flight() -> None:
    for disconnect in (False, True):
        world = two()
        world.line(type="effect", event="succeeded", kind=0, step=0)
        for _ in range(4):
            world.send(BEAT)
            world.send(BEAT, client=2)
            world.wait(1_000_000)
        actions = world.take(ClientDown(1)) + world.take(ClientDown(2)) if disconnect else []
        actions += world.wait(6_000_000)
        assert [each for each in actions if isinstance(each, Cancel)] == [Cancel(1, "script is silent")]


def test_one_old_heartbeat_of_another_client_keeps_no_flight_up() -> None:
    world = two()
    world.line(type="effect", event="succeeded", kind=0, step=0)
    world.send(BEAT, client=2)
    for _ in range(4):
        world.send(BEAT)
        world.wait(1_000_000)
    assert Cancel(1, "script is silent") in world.wait(6_000_000)


def test_a_landing_that_is_refused_after_the_death_of_its_client_ends_the_flight() -> None:
    world = two()
    world.line(type="effect", event="succeeded", kind=0, step=0)
    world.accept(world.send(command_long(21)))
    beat(world)
    assert Cancel(1, "script is silent") in world.take(ClientDown(1)), "it was not dispatched"
    world = two()
    world.accept(world.send(command_long(21)), 1)
    world.dispatch(1)
    beat(world)
    assert not [each for each in world.take(ClientDown(1)) if isinstance(each, Cancel)]
    assert Cancel(1, "script is silent") in world.line(type="effect", event="failed", kind=0, step=1) + world.wait(
        50_000
    )


def test_a_dead_client_does_not_end_its_landing() -> None:
    for message, cancelled in ((command_long(21), False), (command_long(20), False), (command_long(193), True)):
        world = GatewayWorld()
        world.fly()
        beat(world)
        world.accept(world.send(message))
        world.dispatch(0)
        assert (Cancel(1, "script is silent") in world.take(ClientDown(1))) is cancelled


def test_a_dead_client_without_a_step_ends_nothing() -> None:
    world = two()
    world.send(BEAT, client=2)
    assert not [each for each in world.wait(6_000_000) if isinstance(each, Cancel)]
    assert not [each for each in world.take(ClientDown(2)) if isinstance(each, Cancel)]


def test_a_script_without_heartbeats_may_be_silent() -> None:
    world = two()
    assert not [each for each in world.wait(20_000_000, step_us=500_000) if isinstance(each, Cancel)]
    assert not [each for each in world.take(ClientDown(1)) if isinstance(each, Cancel)]


@pytest.mark.parametrize("times_us", [[0], [0, 500_000], [0, 4_000_000, 4_000_000, 4_000_000]])
def test_a_script_that_beats_now_and_then_may_be_silent(times_us: list[int]) -> None:
    world = two()
    for each in times_us:
        world.wait(each)
        world.send(BEAT)
    assert not [each for each in world.wait(20_000_000, step_us=500_000) if isinstance(each, Cancel)]


def test_a_client_that_disconnects_ends_its_flight() -> None:
    world = two()
    beat(world)
    assert Cancel(1, "script is silent") in world.take(ClientDown(1))
    assert world.take(ClientDown(1)) == []


def test_a_mission_taken_after_the_death_of_its_client_is_cancelled() -> None:
    world = GatewayWorld()
    world.ready()
    beat(world)
    proposed = number(world.send(TAKEOFF))
    world.take(ProposalChecked(proposed, None))
    world.take(ClientDown(1))
    assert world.take(ProposalAnswered(proposed, "accepted")) == [], "nothing can be cancelled yet"
    assert Cancel(1, "script is silent") in world.line(type="mission") + world.wait(50_000)


def test_unknown_clients_and_frames_of_other_systems_are_passed_over() -> None:
    world = GatewayWorld()
    frame = TAKEOFF.pack(mavlink.MAVLink(None, 255, 190))
    assert world.take(FromClient(77, frame)) == []
    assert world.take(FromVehicle(BEAT.pack(mavlink.MAVLink(None, 9, 1)))) == []
    assert world.take(FromVehicle(BEAT.pack(mavlink.MAVLink(None, SYSTEM, 191)))) == []
    assert world.take(FromVehicle(b"")) == []
    assert told(world.take(Tick())) == []


def test_the_number_of_clients_is_bounded() -> None:
    world = GatewayWorld()
    for client in range(2, 400):
        world.client(client, "crowd")
    assert len(world.gateway._state.clients) == 256


def test_what_is_kept_of_the_vehicle_is_bounded() -> None:
    world = GatewayWorld()
    sender = mavlink.MAVLink(None, SYSTEM, 1)
    value = mavlink.MAVLink_param_value_message(b"P", 1, 9, 1, 0).pack(sender)
    for kind in range(3_000):
        world.take(FromVehicle(value[:7] + (1_000 + kind).to_bytes(3, "little") + value[10:]))
    for index in range(5_000):
        world.vehicle(mavlink.MAVLink_param_value_message(f"P{index}".encode(), 1, 9, 5_000, index))
    seen = world.gateway._state.seen
    assert (len(seen._frames), len(seen.parameters)) == (512, 4_096)
    world.take(FromVehicle(value[:-1] + bytes([value[-1] ^ 1])))
    assert "P" not in seen.parameters, "a damaged frame"


def test_pilot_keeps_control_while_only_the_relay_ended() -> None:
    world = piloted()
    control(world, 1)
    world.take(ClientDown(1, relay_ended=True))
    world.take(ClientDown(9, relay_ended=True))
    world.client(1, "script")
    world.client(2, "other tower", pilot=True)
    world.client(3, "tower", pilot=True)
    world.ready()
    assert texts(world.send(TAKEOFF)) == ["takeoff rejected: the pilot is in control"]
    control(world, 0, station=2)
    control(world, 0, station=3, system=254)
    assert controls(world.wait(1_000_000)) == [255], "another station, and another sender of this one"
    world.send(BEAT, client=3, sender=(255, 190), pilot=True)
    assert controls(control(world, 0, station=3)) == [0]
    control(world, 1, station=3)
    world.take(ClientDown(3))
    assert controls(world.wait(1_000_000)) == [0], "the station is gone"


def test_each_sender_of_a_connection_is_answered_when_the_flight_is_ready() -> None:
    world = GatewayWorld()
    for system in (250, 251):
        world.send(TAKEOFF, sender=(system, 190))
    world.ready()
    world.accept(world.wait(200_000))
    world.dispatch(0)
    answers = [each for each in told(world.done) if each.get_type() == "COMMAND_ACK"]
    assert {each.target_system for each in answers if each.result == 0} == {250, 251}
