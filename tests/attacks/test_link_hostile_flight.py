"""A whole flight on a link with a key, among hostile frames: the log equals, line by line, the one without them."""

import pytest

from hostile.attacker import Attacker
from rtshcua.mavlink.framing import message_id
from rtshcua.mavlink.radio import RADIO_STATUS
from rtshcua.mavlink.signing import SignedLink, SigningState
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.ports import Ending
from rtshcua.virtual.vehicle import START, VirtualClock, VirtualVehicle
from virtual import case
from virtual.flight import UTC_US, Flight, Flown

KEY = bytes(range(1, 33))
MOST = 500  # frames overheard that are replayed
EVERY = 15  # datagrams of the vehicle


def fly(flavour: str, *, hostile: bool, theirs: bytes = KEY, most_s: int = 600) -> Flown:
    """Up, one leg, home; with a key at both ends."""
    link = SignedLink(KEY, SigningState(0, {}), UTC_US, START.monotonic_us)
    frames = FrameSession()
    frames.sign_with(link)
    config = case.simulated(flavour, signing_key=theirs, utc_us=UTC_US)
    clock = VirtualClock(Now(START.monotonic_us, UTC_US, 1_000))
    vehicle = VirtualVehicle(case.policy(), config, clock, frames, link)
    overheard: list[bytes] = []
    radio = SignedLink(theirs, SigningState(0, {}), UTC_US, START.monotonic_us, link=2)

    def through_the_air(datagram: bytes) -> list[bytes]:
        if message_id(datagram, 0) == RADIO_STATUS:  # this one's radio has the key, too
            datagram = radio.sign(datagram, clock.now().monotonic_us)
        overheard.append(datagram)
        if len(overheard) % EVERY or not hostile:
            return [datagram]
        attacker = Attacker(overheard[-MOST:], len(overheard), impersonate=True)
        return [*(attacker.datagram() for _ in range(3)), datagram, overheard[-1 - EVERY // 2]]

    vehicle.hurt = through_the_air
    return Flight(case.seal(case.mission(case.short_steps())), config, vehicle=vehicle).fly(most_s=most_s)


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["ardupilot", pytest.param("px4", marks=pytest.mark.soak)])
def test_a_flight_among_hostile_frames_is_the_same_flight(flavour: str) -> None:
    quiet, hostile = fly(flavour, hostile=False), fly(flavour, hostile=True)
    assert quiet.ending is Ending.COMPLETED
    assert hostile.lines == quiet.lines
    link = hostile.vehicle.driver.link._verifier
    assert isinstance(link, SignedLink)
    assert min(link.counts.unsigned, link.counts.forged, link.counts.stale) > 20


def test_a_vehicle_with_another_key_is_never_heard() -> None:
    flown = fly("ardupilot", hostile=False, theirs=bytes(range(2, 34)), most_s=700)
    assert flown.ending is Ending.REFUSED
    assert flown.vehicle.driver.flavour is None
    assert flown.vehicle.sent == 0
