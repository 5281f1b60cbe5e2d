"""Signing in the simulated vehicle: which unsigned frames have an effect."""

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from recorded.trace import Trace
from rtshcua.mavlink.signing import EPOCH_US, SignedLink, SigningState
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.config import SimulationConfig

Pilots = Callable[..., Any]
KEY = b"shared/traces test key, 32 bytes"
OFF = bytes(32)
START = 7_000_000_000


class Signer:
    """A pilot that can sign."""

    def __init__(self, pilot: Any, key: bytes = KEY, timestamp: int = START) -> None:
        self.pilot = pilot
        self.link = SignedLink(
            key, SigningState(timestamp + ahead(pilot), {}), EPOCH_US, pilot.simulation.now_us, link=1
        )

    def frame(self, message: Any) -> bytes:
        return self.link.sign(self.pilot.codec.pack(message), self.pilot.simulation.now_us)

    def put(self, frame: bytes) -> list[Any]:
        answers: list[Any] = self.pilot.take(self.pilot.simulation.receive(frame, self.pilot.simulation.now_us))
        return answers

    def long(self, command: int, *params: float) -> list[int]:
        padded = [*params, *[0.0] * (7 - len(params))]
        answers = self.put(self.frame(mavlink.MAVLink_command_long_message(1, 1, command, 0, *padded)))
        return [f.message.result for f in answers if f.name == "COMMAND_ACK"]


def ahead(pilot: Any) -> int:
    """Return how far time stamps begin ahead of the time of the key: for ArduCopter a minute, as recorded."""
    return 0 if pilot.px4 else 6_000_000


def setup(key: bytes, timestamp: int = START) -> Any:
    return mavlink.MAVLink_setup_signing_message(1, 1, list(key), timestamp)


def keyed(a: Any) -> Signer:
    """Return a vehicle that requires this key from now on."""
    a.send(setup(KEY))
    return Signer(a)


def test_second_channel_matches_the_recording(pilot: Pilots) -> None:
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


def test_time_stamps_begin_as_recorded(pilot: Pilots) -> None:
    trace = Trace("arducopter-signing")
    given = next(h.message.initial_timestamp for h in trace.heard if h.name == "SETUP_SIGNING")
    real = next(h.received for h in trace.of_vehicle if h.received.signed and h.received.component == 1)
    a = pilot("ardupilot").ready()
    keyed(a)
    own = next(f for f in a.wait(1) if f.signed)
    began = [stamp(real) - given, stamp(own) - START]
    assert began[0] == 6_000_000
    assert began[1] == pytest.approx(began[0], abs=100_000), "within a second of it"


def stamp(received: Any) -> int:
    return int.from_bytes(received.frame[-12:-6], "little")


def test_first_channel_matches_the_recording(pilot: Pilots) -> None:
    a = pilot("ardupilot", usb=True).ready()
    keyed(a)
    assert a.long(512, 148) == [0]
    assert a.mode(FlightMode.GUIDED) == [0]
    assert a.arm() == [0]


def signing(pilot: Pilots, flavour: str, **config: Any) -> Any:
    """Return a ready vehicle that accepts a key."""
    return pilot(flavour, release=(1, 18) if flavour == "px4" else None, **config).ready()


def test_sent_frames_are_signed_with_rising_time_stamps(pilot: Pilots, flavour: str) -> None:
    a = signing(pilot, flavour)
    keyed(a)
    seen = [f for f in a.wait(5) if f.component == 1]
    ground = SignedLink(KEY, SigningState(START, {}), EPOCH_US, 0)
    assert len(seen) > 4
    assert all(f.signed for f in seen)
    assert all(ground.accept(f.frame, 0) for f in seen)
    stamps = [int.from_bytes(f.frame[-12:-6], "little") for f in seen]
    assert stamps == sorted(set(stamps))
    passed = 500_000 if a.px4 else len(seen)  # ArduCopter counts its frames, as recorded
    assert stamps[-1] - START - ahead(a) == pytest.approx(passed, rel=0.15, abs=2)
    assert not any(f.signed for f in a.seen if f.name == "RADIO_STATUS")


def test_replayed_forged_and_old_frames_have_no_effect(pilot: Pilots, flavour: str) -> None:
    a = signing(pilot, flavour)
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


def test_radio_frames_need_no_signature(pilot: Pilots, flavour: str) -> None:
    a = signing(pilot, flavour)
    keyed(a)
    autopilot = a.simulation._autopilot
    assert autopilot.flavour.obeys_unsigned(autopilot, "RADIO_STATUS")
    assert not autopilot.flavour.obeys_unsigned(autopilot, "COMMAND_LONG")
    assert autopilot.flavour.obeys_unsigned(autopilot, "HEARTBEAT") is a.px4


def version(a: Any) -> tuple[int, ...]:
    a.long(512, 148)
    told = next(f.message.flight_sw_version for f in reversed(a.seen) if f.name == "AUTOPILOT_VERSION")
    return tuple(told.to_bytes(4)[:2])


def test_px4_1_16_ignores_keys(pilot: Pilots) -> None:
    a = pilot("px4", usb=True).ready()
    assert version(a) == (1, 16)
    s = keyed(a)
    assert a.long(512, 148) == [0]
    assert s.long(512, 148) == [0], "it does not look at signatures"
    assert not any(f.signed for f in a.wait(1))


def test_px4_1_17_takes_a_key_over_usb_and_obeys_its_parameter(pilot: Pilots) -> None:
    a = pilot("px4", release=(1, 17)).ready()
    a.send(setup(KEY))
    assert not any(f.signed for f in a.wait(1))
    a = pilot("px4", release=(1, 17), usb=True).ready()
    assert version(a) == (1, 17)
    s = keyed(a)
    assert all(f.signed for f in a.wait(1) if f.component == 1)
    for value, obeyed in ((0, [0]), (1, [0]), (2, [])):  # 1: but for USB
        s.put(s.frame(mavlink.MAVLink_param_set_message(1, 1, b"MAV_SIGN_CFG", value * 1.5e-45, 6)))
        assert a.long(512, 148) == obeyed
    assert s.long(512, 148) == [0]


def test_px4_1_18_takes_a_key_over_any_link_while_disarmed(pilot: Pilots) -> None:
    a = signing(pilot, "px4", usb=True)
    assert version(a) == (1, 18)
    s = keyed(a)
    assert a.long(512, 148) == []
    a.send(setup(OFF, 0))
    assert a.long(512, 148) == [], "another key comes signed with the one that it has"
    assert s.long(400, 1) == [0]
    s.put(s.frame(setup(OFF, 0)))
    assert "MAVLink signing: rejected while armed" in [text.strip() for text in a.texts()]
    assert s.long(400, 0) == [0]
    s.put(s.frame(setup(OFF, 0)))
    assert a.long(512, 148) == [0]


def test_configured_key_signs_from_the_start(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour, signing_key=KEY, utc_us=EPOCH_US + START * 10, speed=400).ready()
    assert a.long(512, 148) == []
    assert Signer(a).long(512, 148) == [0]
    stamps = [int.from_bytes(f.frame[-12:-6], "little") for f in a.wait(40) if f.component == 1]
    passed = 1_000_000 if a.px4 else len(stamps)  # ten seconds of real time
    assert stamps[-1] - stamps[0] == pytest.approx(passed, rel=0.05)
    for wrong in (
        {"signing_key": b"short"},
        {"speed": 0},
        {"release": (1, 16), "signing_key": KEY},
        {"release": (1, 300)},
    ):
        with pytest.raises(ValueError, match=r"octets|speed|1\.17|from 0 to 255"):
            SimulationConfig(**wrong)


def test_time_stamp_beyond_48_bits_does_not_stop_signing(pilot: Pilots) -> None:
    a = pilot("ardupilot").ready()
    a.send(setup(KEY, 2**64 - 1))
    assert all(f.signed for f in a.wait(2) if f.component == 1)
