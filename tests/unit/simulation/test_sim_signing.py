"""Signing in the simulated vehicle: what has an effect without a signature, and what has none."""

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.mavlink.signing import EPOCH_US, SignedLink, State
from rtshcua.model.faults import Mode
from rtshcua.simulation.config import SimulationConfig

Pilots = Callable[..., Any]
KEY = b"shared/traces test key, 32 bytes"
OFF = bytes(32)
START = 7_000_000_000


class Signer:
    """A pilot that can sign."""

    def __init__(self, pilot: Any, key: bytes = KEY, timestamp: int = START) -> None:
        self.pilot = pilot
        self.link = SignedLink(key, State(timestamp, {}), EPOCH_US, pilot.simulation.now_us, link=1)

    def frame(self, message: Any) -> bytes:
        return self.link.sign(self.pilot.codec.pack(message), self.pilot.simulation.now_us)

    def put(self, frame: bytes) -> list[Any]:
        answers: list[Any] = self.pilot.take(self.pilot.simulation.receive(frame, self.pilot.simulation.now_us))
        return answers

    def long(self, command: int, *params: float) -> list[int]:
        padded = [*params, *[0.0] * (7 - len(params))]
        answers = self.put(self.frame(mavlink.MAVLink_command_long_message(1, 1, command, 0, *padded)))
        return [f.message.result for f in answers if f.name == "COMMAND_ACK"]


def setup(key: bytes, timestamp: int = START) -> Any:
    return mavlink.MAVLink_setup_signing_message(1, 1, list(key), timestamp)


def keyed(a: Any) -> Signer:
    """A vehicle that insists on this key from now on."""
    if a.px4:
        a.send(mavlink.MAVLink_param_set_message(1, 1, b"MAV_SIGN_CFG", 1e-45, 6))
    a.send(setup(KEY))
    return Signer(a)


def test_as_recorded_on_the_second_channel(pilot: Pilots) -> None:
    a = pilot("ardupilot").ready()
    s = keyed(a)
    assert a.long(512, 148) == []
    assert a.arm() == []
    assert s.long(512, 148) == [0]
    assert s.long(176, 1, 4) == [0]
    assert s.long(400, 1) == [0]
    s.put(s.frame(setup(OFF, 0)))
    assert "ERROR: Won't setup signing when armed" in a.texts()
    assert a.long(400, 0) == []
    assert a.truth.armed
    assert s.long(400, 0) == [0]
    s.put(s.frame(setup(OFF, 0)))
    assert a.long(512, 148) == [0]


def test_as_recorded_on_the_first_channel(pilot: Pilots) -> None:
    a = pilot("ardupilot", usb=True).ready()
    keyed(a)
    assert a.long(512, 148) == [0]
    assert a.mode(Mode.GUIDED) == [0]
    assert a.arm() == [0]


def test_what_it_sends_is_signed_and_rises(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour).ready()
    keyed(a)
    seen = [f for f in a.wait(5) if f.component == 1]
    ground = SignedLink(KEY, State(START, {}), EPOCH_US, 0)
    assert len(seen) > 4
    assert all(f.signed for f in seen)
    assert all(ground.accept(f.frame, 0) for f in seen)
    stamps = [int.from_bytes(f.frame[-12:-6], "little") for f in seen]
    assert stamps == sorted(set(stamps))
    assert stamps[-1] - START == pytest.approx(500_000, rel=0.15)
    assert not any(f.signed for f in a.seen if f.name == "RADIO_STATUS")


def test_replayed_forged_and_old_frames_have_no_effect(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour).ready()
    s = keyed(a)
    good = s.frame(mavlink.MAVLink_command_long_message(1, 1, 512, 0, 148, 0, 0, 0, 0, 0, 0))
    assert [f.name for f in s.put(good) if f.name == "COMMAND_ACK"] == ["COMMAND_ACK"]
    assert s.put(good) == []
    late = s.frame(mavlink.MAVLink_command_long_message(1, 1, 512, 0, 148, 0, 0, 0, 0, 0, 0))
    forged = late[:-1] + bytes([late[-1] ^ 1])
    assert s.put(forged) == []
    assert s.put(late) != []
    assert Signer(a, bytes(31) + b"x").long(512, 148) == []
    assert Signer(a, timestamp=START - 61 * 100_000).long(512, 148) == []


def test_a_radio_need_not_sign(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour).ready()
    keyed(a)
    (received,) = a.codec.parse(a.codec.pack(mavlink.MAVLink_radio_status_message(1, 1, 1, 1, 1, 0, 0)))
    assert a.simulation._autopilot.signing.lets_in(received, 0, optional=False)


def test_px4_does_not_insist_by_default(pilot: Pilots) -> None:
    a = pilot("px4").ready()
    a.send(setup(KEY))
    assert a.long(512, 148) == [0]
    assert all(f.signed for f in a.wait(1) if f.component == 1)


def test_a_key_from_the_start(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour, signing_key=KEY, utc_us=EPOCH_US + START * 10, speed=400).ready()
    assert a.long(512, 148) == []
    assert Signer(a).long(512, 148) == [0]
    stamps = [int.from_bytes(f.frame[-12:-6], "little") for f in a.wait(40) if f.component == 1]
    assert stamps[-1] - stamps[0] == pytest.approx(1_000_000, rel=0.05)  # ten seconds outside
    for wrong in ({"signing_key": b"short"}, {"speed": 0}):
        with pytest.raises(ValueError, match=r"octets|speed"):
            SimulationConfig(**wrong)


def test_a_time_stamp_beyond_48_bits_stops_nothing(pilot: Pilots) -> None:
    a = pilot("ardupilot").ready()
    a.send(setup(KEY, 2**64 - 1))
    assert all(f.signed for f in a.wait(2) if f.component == 1)
