"""The UDP link has one peer, the first identified vehicle; no input raises an exception."""

import select
import socket
from collections.abc import Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.clock import SystemClock
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.adapters.vehicle.transport import UdpTransport
from rtshcua.codec.frames import Codec
from rtshcua.mavlink.signing import EPOCH_US, MINUTE, SignedLink, SigningState, timestamp_of
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.ports import Command, Event, LinkLost, Readings, Sent
from virtual.policy import BATTERY, POLICY

HERE = "127.0.0.1"


class Peer:
    """A sender on the link."""

    def __init__(self, to: int, system: int = 1) -> None:
        self.codec = Codec(system, 1)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect((HERE, to))
        self.socket.settimeout(5)

    def beat(self) -> None:
        self.send(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))

    def send(self, message: object) -> None:
        self.socket.send(self.codec.pack(message))

    def hears(self) -> str:
        (frame,) = self.codec.parse(self.socket.recv(65_535))
        return frame.name

    def answers_time(self, link: ConnectedVehicle) -> None:
        """Answer the first TIMESYNC received."""
        while True:
            (frame,) = self.codec.parse(self.socket.recv(65_535))
            if frame.name == "TIMESYNC":
                break
        self.send(mavlink.MAVLink_timesync_message(1, frame.message.ts1))
        poll(link)


@pytest.fixture
def link() -> Iterator[ConnectedVehicle]:
    kept: list[tuple[int, bytes]] = []
    frames = FrameSession()
    transport = UdpTransport(HERE, 0, begins=False)
    made = ConnectedVehicle(
        transport, Driver(POLICY, frames), SystemClock(), lambda utc_us, frame: kept.append((utc_us, frame))
    )
    made.kept = kept  # type: ignore[attr-defined]
    made.frames = frames  # type: ignore[attr-defined]
    yield made
    made.close()


@pytest.fixture
def vehicle(link: ConnectedVehicle) -> Iterator[Peer]:
    peer = Peer(port(link))
    yield peer
    peer.socket.close()


@pytest.fixture
def stranger(link: ConnectedVehicle) -> Iterator[Peer]:
    peer = Peer(port(link), system=1)
    yield peer
    peer.socket.close()


def port(link: ConnectedVehicle) -> int:
    return link._transport.port  # type: ignore[attr-defined, no-any-return]


def poll(link: ConnectedVehicle) -> list[Event]:
    now_us = SystemClock().now().monotonic_us
    return list(link.poll(now_us, 1_000_000))


def test_link_is_silent_until_a_vehicle_is_heard(link: ConnectedVehicle, stranger: Peer) -> None:
    stranger.socket.send(b"\xfd garbage")
    assert poll(link) == []
    stranger.send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))  # a ground station
    assert poll(link) == []
    stranger.socket.setblocking(False)
    with pytest.raises(BlockingIOError):
        stranger.socket.recv(100)
    assert link.kept == []  # type: ignore[attr-defined]
    with pytest.raises(RuntimeError, match="no vehicle"):
        link.begin(Command(1, "hover", MotionKind.HOLD, (), (), 0, 0), 0)


def test_the_first_vehicle_is_answered_and_nobody_else_is_heard(
    link: ConnectedVehicle, vehicle: Peer, stranger: Peer
) -> None:
    vehicle.beat()
    poll(link)
    poll(link)
    assert vehicle.hears() == "HEARTBEAT"
    vehicle.answers_time(link)
    stranger.beat()
    stranger.send(mavlink.MAVLink_battery_status_message(0, 0, 0, 0, [0] * 10, 0, 0, 0, 99))
    assert [event for event in poll(link) if not isinstance(event, LinkLost)] == [], "silence is no word of it"
    for _ in range(2):  # a battery counts from its second report on
        vehicle.send(mavlink.MAVLink_battery_status_message(0, 0, 0, 0, [0] * 10, 0, 0, 0, 57))
    (readings,) = [event for event in poll(link) if isinstance(event, Readings)]
    assert readings.values == ((BATTERY, 5_700),)


@pytest.mark.parametrize("key", ["the link's", "another"])
def test_vehicle_with_late_signing_clock_is_accepted_after_a_greeting(key: str) -> None:
    """ArduPilot received nothing for over a minute: it counts frames, and accepts a later timestamp."""
    now, frames = SystemClock().now(), FrameSession()
    ours = SignedLink(bytes(range(32)), SigningState(0, {}), now.utc_us, now.monotonic_us)
    theirs = SignedLink(
        bytes(range(32)) if key == "the link's" else bytes(32), SigningState(timestamp_of(now.utc_us) - 2 * MINUTE, {}),
        EPOCH_US, 0, as_library=True,
    )  # fmt: skip
    frames.sign_with(ours)
    transport = UdpTransport(HERE, 0, begins=False)
    link = ConnectedVehicle(transport, Driver(POLICY, frames, verifier=ours), SystemClock(), lambda utc_us, frame: None)
    vehicle = Peer(transport.port)
    beat = vehicle.codec.pack(mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3))
    for _ in range(3):
        vehicle.socket.send(theirs.sign(beat, 0))
        poll(link)
    assert link.driver.flavour is None
    if key == "another":
        vehicle.socket.setblocking(False)
        with pytest.raises(BlockingIOError):
            vehicle.socket.recv(65_535)
    else:
        assert theirs.accept(vehicle.socket.recv(65_535), 0), "one heartbeat a second is enough"
        vehicle.socket.send(theirs.sign(beat, 0))
        poll(link)
        assert link.driver.flavour is not None
    link.close()
    vehicle.socket.close()


def test_sent_frames_are_kept_and_reported(link: ConnectedVehicle, vehicle: Peer) -> None:
    vehicle.beat()
    poll(link)
    hold, now_us = Command(9, "hover", MotionKind.HOLD, (), (), 0, 0), SystemClock().now().monotonic_us
    link.frames.open(hold)  # type: ignore[attr-defined]
    link.begin(hold, now_us)
    vehicle.beat()
    assert [event.token for event in poll(link) if isinstance(event, Sent)] == [9]
    kept = [Codec(1, 1).parse(frame)[0].name for _, frame in link.kept]  # type: ignore[attr-defined]
    assert kept[0] == "HEARTBEAT"
    assert "COMMAND_INT" in kept, "PX4 is stopped by a DO_REPOSITION"


def test_a_busy_port_is_an_os_error(link: ConnectedVehicle) -> None:
    with pytest.raises(OSError, match="in use"):
        UdpTransport(HERE, port(link), begins=False)


def crowd(link: ConnectedVehicle) -> str | None:
    """The notice of another vehicle, once all frames have arrived."""
    for _ in range(3):
        link.poll(SystemClock().now().monotonic_us, 20_000)
    return link.driver.link.crowd


@pytest.mark.parametrize(("system", "autopilot", "says"), [(2, 3, "systems 1 and 2"), (1, 12, "two vehicles send")])
def test_a_second_vehicle_keeps_the_first_from_being_ready(
    link: ConnectedVehicle, vehicle: Peer, system: int, autopilot: int, says: str
) -> None:
    vehicle.beat()
    assert crowd(link) is None
    other = Peer(port(link))
    other.codec = Codec(system, 1)
    other.send(mavlink.MAVLink_heartbeat_message(2, autopilot, 0, 0, 4, 3))
    assert says in (crowd(link) or "")
    assert link.driver.unready == link.driver.link.crowd
    other.socket.close()


def test_ground_station_is_not_taken_for_a_vehicle(link: ConnectedVehicle, vehicle: Peer) -> None:
    vehicle.beat()
    crowd(link)
    other = Peer(port(link))
    for codec, kind, autopilot in ((Codec(255, 190), 6, 8), (Codec(2, 1), 26, 8), (Codec(2, 51), 2, 3)):
        other.codec = codec
        other.send(mavlink.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 4, 3))
    assert crowd(link) is None
    other.socket.close()


def test_the_system_that_was_named_is_flown_and_others_may_speak() -> None:
    frames = FrameSession()
    link = ConnectedVehicle(
        UdpTransport(HERE, 0, begins=False), Driver(POLICY, frames, system=2), SystemClock(), lambda *_: None
    )
    peers = [Peer(port(link)), Peer(port(link))]
    peers[1].codec = Codec(2, 1)
    for peer in (peers[0], peers[1], peers[0]):
        peer.beat()
        assert crowd(link) is None
    assert link.driver.flavour is not None
    assert link.driver.seen.heartbeat_us is not None
    assert peers[1].hears() == "HEARTBEAT"
    peers[0].socket.setblocking(False)
    with pytest.raises(BlockingIOError):
        peers[0].socket.recv(100)
    for peer in peers:
        peer.socket.close()
    link.close()


def test_frames_are_kept_in_order_between_polls(link: ConnectedVehicle, vehicle: Peer) -> None:
    kept: list[tuple[int, bytes]] = link.kept  # type: ignore[attr-defined]
    vehicle.beat()
    poll(link)
    assert kept == []
    vehicle.beat()
    poll(link)
    (came,) = Codec(1, 191).parse(kept[0][1])
    assert (came.name, came.component) == ("HEARTBEAT", 1)
    before = len(kept)
    link.close()
    assert len(kept) > before
    assert [at for at, _ in kept] == sorted(at for at, _ in kept)
    assert {Codec(1, 191).parse(frame)[0].component for _, frame in kept} == {1, 191}


def test_awaited_datagrams_are_handled_one_by_one(
    link: ConnectedVehicle, vehicle: Peer, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicle.beat()
    poll(link)
    poll(link)
    vehicle.answers_time(link)
    both = [mavlink.MAVLink_battery_status_message(0, 0, 0, 0, [0] * 10, 0, 0, 0, left) for left in (57, 56)]
    vehicle.send(both[0])  # a battery counts from its second report on
    poll(link)

    def taken() -> list[int | None]:
        return [value for event in poll(link) if isinstance(event, Readings) for _, value in event.values]

    for message in both:  # queued frames are read together
        vehicle.send(message)
    assert taken() == [5_700, 5_600]
    look = select.select
    nothing: tuple[list[Any], ...] = ([], [], [])
    monkeypatch.setattr(select, "select", lambda *asked: look(*asked) if asked[-1] else nothing)  # later frames
    for message in both:
        vehicle.send(message)
    assert [taken(), taken()] == [[5_700], [5_600]]


class Moment:
    """A clock that only changes when it is set."""

    def __init__(self) -> None:
        self.us = 10_000_000

    def now(self) -> Now:
        return Now(self.us, self.us, 0)

    def heard(self, boot_us: int) -> None:
        pass

    def real_seconds(self, us: int) -> float:
        return 0.0

    def us_in(self, seconds: float) -> int:
        return int(seconds * 1e6)


@pytest.mark.parametrize("waits", [True, False])
def test_unread_datagrams_are_not_a_silence(waits: bool) -> None:
    """This process was delayed, and the vehicle's frames wait in the socket."""
    clock = Moment()
    link = ConnectedVehicle(
        UdpTransport(HERE, 0, begins=False), Driver(POLICY, FrameSession()), clock, lambda utc_us, frame: None
    )
    peer = Peer(port(link))
    peer.beat()
    link.poll(clock.us, 0)
    clock.us += 3_000_000
    if waits:
        peer.beat()
    lost = [event for event in link.poll(clock.us, 0) if isinstance(event, LinkLost)]
    assert bool(lost) is not waits
    peer.socket.close()
    link.close()
