"""The answer times of the simulated vehicle, compared with the recordings."""

from collections.abc import Callable
from functools import cache
from random import Random
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from recorded.trace import CLIENT, Trace
from rtshcua.codec.frames import Codec
from rtshcua.model import faults
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.answers import Delays, Inbox, Lanes
from rtshcua.simulation.config import Answers, AutopilotKind, SimulationConfig
from rtshcua.simulation.world import FLAVOURS, Simulation

S = 1_000_000
RECORDED = {
    AutopilotKind.PX4: (
        "px4-commands",
        "px4-hover-does-not-stop",
        "px4-pilot-goto",
        "px4-pilot-pause",
        "px4-takeover-race",
    ),
    AutopilotKind.ARDUPILOT: (
        "arducopter-commands",
        "arducopter-dropout",
        "arducopter-pilot-goto",
        "arducopter-signing",
    ),
}
STALLED = "arducopter-dropout"


@cache
def measured(kind: AutopilotKind) -> dict[int, list[int]]:
    """Return the recorded answer times by lane, microseconds."""
    lanes, taken = FLAVOURS[kind].lanes, dict[int, list[int]]()
    for name in RECORDED[kind]:
        asked: dict[object, tuple[int, int]] = {}
        for heard in Trace(name, wall=True).heard:
            m = heard.message
            if heard.received.component == CLIENT:
                key = getattr(m, "command", getattr(m, "param_id", None))
                if heard.name in ("COMMAND_LONG", "COMMAND_INT", "PARAM_SET", "PARAM_REQUEST_READ"):
                    asked[key] = heard.at_us, lanes.of(heard.received)
                continue
            if heard.received.component != 1 or getattr(m, "target_component", CLIENT) not in (0, CLIENT):
                continue
            key = {"COMMAND_ACK": "command", "PARAM_VALUE": "param_id"}.get(heard.name)
            if key is None or getattr(m, key) not in asked:
                continue
            at_us, lane = asked.pop(getattr(m, key))
            if name != STALLED or heard.at_us - at_us < 300_000:  # a stall of five seconds
                taken.setdefault(lane, []).append(heard.at_us - at_us)
    return taken


@pytest.mark.parametrize("kind", list(AutopilotKind))
def test_delays_match_the_recordings(kind: AutopilotKind) -> None:
    chance, taken = Random(5), measured(kind)
    assert sum(map(len, taken.values())) == {AutopilotKind.PX4: 107, AutopilotKind.ARDUPILOT: 110}[kind]
    for lane, delays in enumerate(FLAVOURS[kind].lanes.delays):
        real, drawn = sorted(taken[lane]), sorted(delays.draw(chance) for _ in range(20_000))
        assert (drawn[0], drawn[-1]) == (pytest.approx(real[0], abs=1_000), pytest.approx(real[-1], rel=0.02))
        for part in (0.1, 0.3, 0.5, 0.7, 0.9):
            recorded, own = real[int(part * len(real))], drawn[int(part * len(drawn))]
            if len(real) > 20:
                assert own == pytest.approx(recorded, rel=0.1, abs=400), part


def test_inbox_keeps_the_order_within_each_lane() -> None:
    codec = Codec(255, 190)
    beat = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    frames = [codec.parse(codec.pack(beat))[0] for _ in range(40)]
    slow, quick = Delays((0, 5_000), (100, 90_000)), Delays((0, 1_000), (100, 2_000))
    inbox = Inbox(Lanes(lambda frame: frame.sequence % 2, (slow, quick)), Random(3))
    assert inbox.next_us is None
    for number, frame in enumerate(frames):
        inbox.put(frame, number * 1_000)
    next_us = inbox.next_us
    assert next_us is not None
    assert 2_000 <= next_us <= 3_000
    taken = list(inbox.due(200_000))
    assert inbox.next_us is None
    assert [at for at, _ in taken] == sorted(at for at, _ in taken)
    order = [frame.sequence for _, frame in taken]
    for lane in (0, 1):
        assert [number for number in order if number % 2 == lane] == list(range(lane, 40, 2))
    assert order != sorted(order)


def acknowledged(p: Any, command: int, *params: float) -> int:
    """Return the microseconds until the acknowledgement."""
    start_us = p.simulation.now_us
    answered = p.long(command, *params)
    while not answered:
        answered = acks(p.wait(0.001), command)
    return int(p.simulation.now_us - start_us)


def acks(received: list[Any], command: int) -> list[int]:
    return [f.message.result for f in received if f.name == "COMMAND_ACK" and f.message.command == command]


def test_command_is_answered_within_milliseconds(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour, answers=Answers.RECORDED)
    p.wait(2)
    took = []
    for _ in range(60):
        took.append(acknowledged(p, mavlink.MAV_CMD_DO_CHANGE_SPEED, 1, 5, -1))
        p.wait(0.1)
    took.sort()
    assert took[0] > 0
    assert 6_000 <= took[30] <= 13_000 if p.px4 else 4_000 <= took[30] <= 8_000
    assert took[-1] > 2 * took[30] if p.px4 else took[-1] <= 25_000
    assert len(set(took)) > 5


def test_at_once_answers_without_delay(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour)
    p.wait(2)
    assert acknowledged(p, mavlink.MAV_CMD_DO_CHANGE_SPEED, 1, 5, -1) == 0
    assert p.simulation.next_us is None


def test_requests_overtake_commands_on_px4_only(pilot: Callable[..., Any], flavour: str) -> None:
    """A request right after a mode command may be answered with the old mode, as measured on PX4."""
    p = pilot(flavour, answers=Answers.RECORDED, noise=False)
    p.wait(2)
    modes = [FlightMode.LAND, FlightMode.POSITION] if p.px4 else [FlightMode.LAND, FlightMode.ALTITUDE]
    old = 0
    for turn in range(60):
        mode = modes[turn % 2]
        p.mode(mode)
        p.seen.clear()
        p.long(512, 0)
        while not any(f.name == "COMMAND_ACK" and f.message.command == 512 for f in p.seen):
            p.wait(0.001)
        told = [f.message.custom_mode for f in p.seen if f.name == "HEARTBEAT"][-1]
        old += told != p.simulation._autopilot.flavour.modes.numbers[mode]
        p.wait(0.5)
        assert p.truth.mode is mode
    assert old > 5 if p.px4 else old == 0


def test_messages_during_a_halt_are_answered_afterwards(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour, answers=Answers.RECORDED)
    p.wait(2.019)
    p.simulation.inject(faults.Stall(p.simulation.now_us, S))
    p.long(512, 0)
    p.wait(0.9)
    p.seen.clear()
    p.wait(0.5)
    assert acks(p.seen, 512) == [0]


def test_streams_start_at_random_phases(pilot: Callable[..., Any], flavour: str) -> None:
    def first(seed: int, answers: Answers) -> int:
        simulation, codec = (
            Simulation(SimulationConfig(AutopilotKind(flavour), seed=seed, answers=answers)),
            Codec(0, 0),
        )
        while True:
            for datagram in simulation.advance(simulation.now_us + 20_000):
                if any(f.name == "HEARTBEAT" and f.component == 1 for f in codec.parse(datagram)):
                    return simulation.now_us

    assert {first(seed, Answers.AT_ONCE) for seed in range(8)} == {20_000}
    begun = [first(seed, Answers.RECORDED) for seed in range(8)]
    assert max(begun) - min(begun) > 300_000
    assert max(begun) <= 1_020_000


def test_the_same_seed_gives_the_same_bytes(flavour: str) -> None:
    def said(seed: int) -> list[bytes]:
        config = SimulationConfig(AutopilotKind(flavour), seed=seed, answers=Answers.RECORDED)
        simulation, codec, heard = Simulation(config), Codec(255, 190), []
        for turn in range(100):
            message = mavlink.MAVLink_command_long_message(1, 1, 512, 0, turn % 3, 0, 0, 0, 0, 0, 0)
            heard += simulation.receive(codec.pack(message), turn * 37_000)
        return heard

    assert said(1) == said(1) != said(2)
