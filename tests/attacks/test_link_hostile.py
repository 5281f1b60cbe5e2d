"""A hostile link: garbage, truncated and altered frames, replays, spoofed ids, unsigned frames, floods.

Nothing is raised, nothing is dispatched, and no other system's frame is accepted. With a key, only signed frames
are accepted or remembered. `bench/hostile_link.py` sends a million of these.
"""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from hostile.attacker import Attacker
from hostile.target import AUTOPILOT, Target

FRAMES = 4_000


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
@pytest.mark.parametrize("keyed", [False, True], ids=["without-key", "with-key"])
def test_foreign_frames_change_nothing(flavour: str, keyed: bool) -> None:
    target = Target(flavour, keyed=keyed)
    attacker = Attacker(target.heard, seed=3, impersonate=keyed)
    before = target.known()
    for _ in range(FRAMES):
        target.receive(attacker.datagram())
    assert target.known() == before
    assert target.sent == []
    assert target.events == []
    assert (target.driver.link.crowd is None) == keyed, "without a key, another vehicle is heard, and nothing begins"


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_vehicle_is_heard_during_flood(flavour: str) -> None:
    target = Target(flavour, keyed=True)
    attacker = Attacker(target.heard, seed=5, impersonate=True)
    for mode in range(60):
        for _ in range(20):
            target.receive(attacker.datagram())
        target.receive(target.says(mavlink.MAVLink_heartbeat_message(2, AUTOPILOT[flavour], 81, mode, 3, 3)))
        assert target.driver.seen.mode == mode


def test_without_a_key_the_vehicles_own_id_can_be_borrowed() -> None:
    """A known limit: without a key, frames prove nothing. The flight is bounded nevertheless."""
    target = Target("px4", keyed=False)
    attacker = Attacker(target.heard, seed=3, impersonate=True)
    before = target.known()
    for _ in range(FRAMES):
        target.receive(attacker.datagram())
    assert target.known() != before
    assert target.moved() == [], "and even so nothing moves that no permit stands behind"


@pytest.mark.parametrize("keyed", [False, True], ids=["without-key", "with-key"])
def test_reflected_frames_are_ignored(keyed: bool) -> None:
    """Correctly signed and fresh, but by us."""
    target = Target("px4", keyed=keyed)
    sent = [frame for at_s in range(1, 5) for frame in target.driver.tick(at_s * 1_000_000)[1]]
    assert len(sent) >= 4
    before = target.known()
    for frame in sent:
        target.receive(frame)
    assert target.known() == before
    assert target.link.counts.strayed == (len(sent) if keyed else 0)


def test_a_stream_is_not_locked_out_by_forged_timestamps() -> None:
    target = Target("ardupilot", keyed=True)
    late = bytearray(target.says(mavlink.MAVLink_heartbeat_message(2, 3, 0, 4, 0, 3), ahead_us=3_600_000_000))
    late[-1] ^= 1
    target.receive(bytes(late))
    target.receive(target.says(mavlink.MAVLink_heartbeat_message(2, 3, 0, 9, 0, 3)))
    assert target.driver.seen.mode == 9


def test_recorded_frames_replayed_after_a_restart_are_refused() -> None:
    first = Target("ardupilot", keyed=True)
    recorded = [first.says(mavlink.MAVLink_heartbeat_message(2, 3, 0, mode, 0, 3)) for mode in range(5)]
    for each in recorded:
        first.receive(each)
    again = Target("ardupilot", keyed=True, stored=first.link.state, greet=False)
    for each in [*first.heard, *recorded]:
        again.receive(each)
    assert again.driver.flavour is None
    assert again.link.counts.accepted == 0
