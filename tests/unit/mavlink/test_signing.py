"""Signing: compared with pymavlink, with a recorded ArduCopter, and with each rule of the specification."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec
from rtshcua.mavlink import signing, tlog
from rtshcua.mavlink.framing import FLAG_SIGNED, checksum, unsigned, with_flags
from rtshcua.mavlink.signing import (  # fmt: skip
    EPOCH_US,
    LEAD,
    MINUTE,
    MOST_STREAMS,
    SignedLink,
    SigningState,
    stream_of,
    timestamp_of,
)

KEY = bytes(range(32))
UTC = EPOCH_US + 11 * 366 * 86_400_000_000
RECORDED = Path(__file__).parent / "data" / "arducopter-signed.tlog"
RECORDED_KEY = b"shared/traces test key, 32 bytes"
NEW = SigningState(0, {})


def link(key: bytes = KEY, stored: SigningState = NEW, utc_us: int = UTC, number: int = 0) -> SignedLink:
    return SignedLink(key, stored, utc_us, 0, number)


def frame(mode: int = 0, system: int = 1, component: int = 1) -> bytes:
    return Codec(system, component).pack(mavlink.MAVLink_heartbeat_message(2, 12, 29, mode, 3, 3))


def theirs(key: bytes = KEY, timestamp: int = 0, number: int = 0) -> Any:
    """pymavlink's own end of a signed link, as (1, 1)."""
    end = mavlink.MAVLink(None, 1, 1)
    end.signing.secret_key, end.signing.timestamp, end.signing.link_id = key, timestamp, number
    end.signing.sign_outgoing = True
    return end


def at(timestamp: int, other: SignedLink | None = None, of: bytes | None = None) -> bytes:
    """A correctly signed frame with a timestamp."""
    sender = other or link(stored=SigningState(timestamp - 1, {}), utc_us=0)
    return sender.sign(of or frame(), 0)


def test_pymavlink_verifies_what_we_sign() -> None:
    ours, end = link(number=5), theirs(timestamp=timestamp_of(UTC))
    for now_us in (0, 0, 3, 1_000_000, 1_000_000):
        message = end.decode(bytearray(ours.sign(frame(now_us), now_us)))
        assert message._signed
        assert (message.custom_mode, message.get_link_id()) == (now_us, 5)
    assert list(end.signing.stream_timestamps) == [(5, 1, 1)]


def test_we_verify_what_pymavlink_signs() -> None:
    ours, end = link(), theirs(timestamp=timestamp_of(UTC), number=9)
    for mode in range(5):
        signed = mavlink.MAVLink_heartbeat_message(2, 12, 29, mode, 3, 3).pack(end)
        assert ours.accept(signed, 0)
        assert unsigned(signed) == frame(mode)
    assert ours.state.streams == {(1, 1, 9): timestamp_of(UTC) + 4}


def test_a_recorded_ardupilot_is_verified() -> None:
    entries = list(tlog.read(RECORDED.read_bytes()))
    ours = SignedLink(RECORDED_KEY, NEW, entries[0].at_us, 0)
    assert [ours.accept(entry.frame, 0) for entry in entries] == [True] * len(entries)
    assert not any(ours.accept(entry.frame, 0) for entry in entries), "a second time it is a replay"
    assert not any(link().accept(entry.frame, 0) for entry in entries), "under another key"


@given(st.binary(max_size=300))
def test_the_checksum_is_pymavlinks(octets: bytes) -> None:
    assert checksum(octets) == mavlink._x25crc_slow(octets).crc


@given(st.integers(0, 0xFFFF_FFFF), st.integers(0, 255))
def test_flags_change_the_checksum_with_them(mode: int, component: int) -> None:
    plain = frame(mode, component=component)
    flagged = with_flags(plain, FLAG_SIGNED)
    assert mavlink._x25crc_slow(flagged[1:-2] + bytes([50])).crc == int.from_bytes(flagged[-2:], "little")
    assert with_flags(flagged, 0) == plain == unsigned(plain)


def test_a_wrong_checksum_stays_wrong() -> None:
    broken = bytearray(frame())
    broken[-1] ^= 4
    assert Codec(1, 1).parse(unsigned(link().sign(bytes(broken), 0))) == []


def test_timestamps_follow_the_clock_and_always_rise() -> None:
    ours, end = link(), theirs()
    stamps = []
    for now_us in (0, 0, 0, 5, 40, 1_000_000, 900_000):
        signed = ours.sign(frame(), now_us)
        assert end.decode(bytearray(signed))._signed
        stamps.append(int.from_bytes(signed[-12:-6], "little") - timestamp_of(UTC))
    assert stamps == [1, 2, 3, 4, 5, 100_000, 100_001]


def test_timestamps_start_after_the_later_of_clock_and_stored() -> None:
    for utc_us, stored in ((UTC, 0), (UTC, timestamp_of(UTC) + 77), (0, timestamp_of(UTC))):
        ours = link(stored=SigningState(stored, {}), utc_us=utc_us)
        assert int.from_bytes(ours.sign(frame(), 0)[-12:-6], "little") == max(timestamp_of(utc_us), stored) + 1


def test_any_flipped_bit_is_refused() -> None:
    signed = link().sign(frame(7), 0)
    ours = link()
    for bit in range(8 * len(signed)):
        turned = bytearray(signed)
        turned[bit // 8] ^= 1 << bit % 8
        assert not ours.accept(bytes(turned), 0), bit
    assert ours.counts.accepted == 0
    assert ours.state == SigningState(timestamp_of(UTC), {}), "and nothing is remembered of them"
    assert ours.accept(signed, 0)


def test_unsigned_or_foreign_frame_is_refused() -> None:
    ours = link()
    assert not ours.accept(frame(), 0)
    assert not ours.accept(link(bytes(32)).sign(frame(), 0), 0)
    assert not ours.accept(with_flags(frame(), FLAG_SIGNED) + bytes(13), 0)
    assert (ours.counts.unsigned, ours.counts.forged, ours.counts.accepted) == (1, 2, 0)


def test_forged_future_timestamp_locks_nobody_out() -> None:
    """pymavlink stores the timestamp before it checks the signature; here the check comes first."""
    ours, end = link(), theirs(timestamp=timestamp_of(UTC))
    forged = bytearray(at(timestamp_of(UTC) + 1_000_000))
    forged[-1] ^= 1
    good = at(timestamp_of(UTC) + 5)
    assert not ours.accept(bytes(forged), 0)
    assert ours.accept(good, 0)
    with pytest.raises(mavlink.MAVError):
        end.decode(forged)
    with pytest.raises(mavlink.MAVError):
        end.decode(bytearray(good))


def test_a_replay_is_refused_within_its_stream_alone() -> None:
    ours, now = link(), timestamp_of(UTC)
    first = at(now + 10)
    assert ours.accept(first, 0)
    assert not ours.accept(first, 0)
    assert not ours.accept(at(now + 9, of=frame(1)), 0)
    assert ours.accept(at(now + 9, of=frame(component=2)), 0), "another component"
    assert ours.accept(at(now + 9, of=frame(system=2)), 0), "another system"
    assert ours.accept(at(now + 11), 0)
    assert ours.counts.stale == 2


def test_own_signed_frame_is_refused() -> None:
    ours = link()
    sent = [ours.sign(frame(mode), 0) for mode in range(3)]
    before = ours.state
    assert not any(ours.accept(each, 0) for each in sent)
    assert (ours.counts.strayed, ours.state) == (3, before)
    assert ours.accept(at(timestamp_of(UTC) + 9, of=frame(component=2)), 0)
    adapter = link()
    adapter.sign(frame(component=191), 0)
    assert not adapter.accept(at(timestamp_of(UTC) + 9, of=frame(component=191)), 0)
    assert adapter.accept(at(timestamp_of(UTC) + 9, of=frame(component=1)), 0)
    assert adapter.accept(at(timestamp_of(UTC) + 9, of=frame(system=191, component=191)), 0)


def test_frame_of_another_link_is_refused() -> None:
    """An autopilot signs on each of its channels; we only accept one of them, also after a restart."""
    now = timestamp_of(UTC)
    here = [at(now + 10 * n, SignedLink(KEY, SigningState(now + 10 * n, {}), 0, 0, link=1)) for n in range(3)]
    there = at(0, SignedLink(KEY, SigningState(now + 5, {}), 0, 0, link=2))
    assert link().accept(there, 0), "the first that is heard is the one"
    ours = link()
    assert ours.accept(here[0], 0)
    assert not ours.accept(there, 0)
    assert ours.counts.strayed == 1
    assert ours.accept(here[1], 0)
    again = link(stored=ours.state)
    assert not again.accept(there, 0)
    assert again.accept(here[2], 0)
    later = link(stored=ours.state, utc_us=UTC + 61_000_000)
    rewired = at(0, SignedLink(KEY, SigningState(now + 6_100_000, {}), 0, 0, link=2))
    assert later.accept(rewired, 0), "after a minute of silence it may be another one"


def test_at_most_a_minute_behind() -> None:
    now = timestamp_of(UTC)
    assert link().accept(at(now - MINUTE), 0)
    assert not link().accept(at(now - MINUTE - 1), 0)
    assert not link().accept(at(now - 1), 60_000_001), "time goes on"
    ours = link()
    assert ours.accept(at(now + 10), 0)
    assert not ours.accept(at(now + 11), 60_000_200), "also in a stream that is known"


def test_only_accepted_later_frame_advances_local_time() -> None:
    ours, now = link(), timestamp_of(UTC)
    assert not ours.accept(at(now + 9_000_000)[:-1] + b"\0", 0)
    assert ours.state.timestamp == now
    assert ours.accept(at(now + 9_000_000), 0)
    assert ours.state.timestamp == now + 9_000_000
    assert int.from_bytes(ours.sign(frame(), 0)[-12:-6], "little") == now + 9_000_001


def test_timestamps_never_run_out() -> None:
    ours = link()
    assert not ours.accept(at((1 << 48) - 2), 0)
    assert ours.accept(at(signing.LAST), 0)
    ours.sign(frame(), 0)


def test_frame_older_than_stored_state_is_refused() -> None:
    before, now = link(), timestamp_of(UTC)
    heard = [at(now + 1_000 * number, of=frame(number)) for number in range(5)]
    assert all(before.accept(each, 0) for each in heard)
    after = link(stored=before.state)
    assert not any(after.accept(each, 0) for each in heard)
    assert after.accept(at(now + 5_000), 0)


def test_streams_are_bounded_and_old_ones_make_room() -> None:
    ours, now = link(), timestamp_of(UTC)
    for component in range(1, MOST_STREAMS + 1):
        assert ours.accept(at(now + component, of=frame(component=component)), 0)
    late = at(now + 100, of=frame(component=99))
    assert not ours.accept(late, 0)
    assert ours.counts.crowded == 1
    assert ours.accept(at(now + 50, of=frame(component=3)), 0), "those that are known go on"
    minute_us = 10 * MINUTE
    assert ours.accept(at(now + MINUTE + 10, of=frame(component=99)), minute_us + 20)
    assert set(ours.state.streams) == {(1, component, 0) for component in (*range(2, MOST_STREAMS + 1), 99)}
    assert not ours.accept(at(now + 1), minute_us + 20), "what was forgotten is too old to come back"


def test_state_change_is_a_new_stream_or_a_leap() -> None:
    ours, now, told = link(), timestamp_of(UTC), []
    ours.on_news = lambda: told.append(len(told))
    leap = now + 200_007
    for stamp, component, news in (
        (now + 5, 1, 1), (now + 6, 1, 1), (now + 100_006, 1, 1), (leap, 1, 2), (now + 9, 2, 3), (now + 9, 2, 3),
    ):  # fmt: skip
        ours.accept(at(stamp, of=frame(component=component)), 0)
        assert len(told) == news
    assert ours.counts.accepted == 5


def test_the_state_is_a_copy() -> None:
    ours = link()
    state = ours.state
    assert ours.accept(at(timestamp_of(UTC)), 0)
    assert state.streams == {}


def test_a_stream_is_system_component_link() -> None:
    assert stream_of(link(number=8).sign(frame(system=2, component=3), 0)) == (2, 3, 8)


@pytest.mark.parametrize("length", [0, 31, 33])
def test_a_key_has_32_octets(length: int) -> None:
    with pytest.raises(ValueError, match="32 octets"):
        link(bytes(length))


@given(st.lists(st.tuples(st.integers(0, 2), st.integers(-80, 80), st.integers(0, 70)), max_size=30))
def test_no_frame_comes_in_twice_and_none_over_a_minute_late(arrivals: list[tuple[int, int, int]]) -> None:
    """(stream, timestamp in s from the start, delay in s), compared with an independent form of the rules."""
    ours, begin, now_s = link(), timestamp_of(UTC), 0
    last: dict[int, int] = {}
    local = begin
    for component, stamp_s, wait_s in arrivals:
        now_s += wait_s
        stamp = begin + stamp_s * 100_000
        local = max(local, begin + now_s * 100_000)
        good = stamp > last.get(component, 0) and stamp >= local - MINUTE
        assert ours.accept(at(stamp, of=frame(component=component)), now_s * 1_000_000) == good
        if good:
            last[component], local = stamp, max(local, stamp)


# ---------------------------------------------------------------- signed ahead


def stamp(signed: bytes) -> int:
    return int.from_bytes(signed[-12:-6], "little")


def signed_ahead(ours: SignedLink, octets: bytes, now_us: int) -> bytes:
    signed = ours.sign_ahead(octets, now_us)
    assert signed is not None
    return signed


def vehicle() -> SignedLink:
    """An autopilot with the C library, which has heard us."""
    return SignedLink(KEY, NEW, UTC, 0, as_library=True)


def test_frames_signed_ahead_have_later_timestamps() -> None:
    ours = link()
    ahead = [signed_ahead(ours, frame(mode), 0) for mode in range(3)]
    assert [stamp(each) - timestamp_of(UTC) for each in ahead] == [LEAD + 1, LEAD + 2, LEAD + 3]
    assert stamp(ours.sign(frame(), 20_000_000)) < stamp(ahead[0]) < stamp(ours.sign(frame(), 31_000_000))


def test_frame_signed_ahead_is_accepted_late() -> None:
    """The last signed frame, then the frames signed ahead, minutes later and in order; each only once."""
    ours, autopilot = link(), vehicle()
    ahead = [signed_ahead(ours, frame(mode), 0) for mode in range(3)]
    assert autopilot.accept(ours.sign(frame(), 20_000_000), 20_000_000)
    late = 600_000_000
    assert [autopilot.accept(each, late) for each in (ahead[0], ahead[2], ahead[1], ahead[2])] == [
        True, True, False, False,
    ]  # fmt: skip


def test_later_signature_voids_frames_signed_ahead() -> None:
    """A held-back frame soon becomes void as the flight continues, also for the next step and flight."""
    ours, autopilot = link(), vehicle()
    held_back = signed_ahead(ours, frame(1), 0)
    again = signed_ahead(ours, frame(2), 20_000_000)
    assert autopilot.accept(ours.sign(frame(), 31_000_000), 31_000_000)
    assert not autopilot.accept(held_back, 31_000_000)
    assert autopilot.accept(again, 31_000_000)


def test_no_timestamp_is_promised_twice() -> None:
    ours = link()
    promised = [stamp(signed_ahead(ours, frame(), now_us)) for now_us in (0, 0, 500_000, 1_000_000, 1_000_000, 900_000)]
    assert promised == sorted(set(promised))
    assert ours.state.timestamp == promised[-1]
    after = link(stored=ours.state)
    assert stamp(after.sign(frame(), 0)) > promised[-1]
    assert stamp(after.sign_ahead(frame(), 0)) > promised[-1] + LEAD


def test_repeated_signing_ahead_cannot_exhaust_timestamps() -> None:
    """An attacker requests signatures, sends the frames, and shows the vehicle's answers, as fast as possible."""
    ours, autopilot = link(), vehicle()
    for now_us in range(0, 10_000_000, 10_000):
        assert autopilot.accept(signed_ahead(ours, frame(), now_us), now_us)
        assert ours.accept(autopilot.sign(frame(component=2), now_us), now_us)
    assert ours.state.timestamp - timestamp_of(UTC) < 11 * LEAD


def test_a_flood_of_frames_to_sign_ahead_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each raises the timestamp by one: without a limit, a flood would advance it by hours."""
    ours = link()
    monkeypatch.setattr(signing, "MOST_AHEAD", 50)
    signed = [ours.sign_ahead(frame(), 0) for _ in range(52)]
    assert signed[-3] is not None
    assert signed[-2:] == [None, None]
    assert ours.state.timestamp == timestamp_of(UTC) + LEAD + 50
    assert stamp(ours.sign(frame(), 31_000_000)) > stamp(signed[-3])
    assert ours.sign_ahead(frame(), 31_000_000) is not None, "they are void, and there is room again"


def test_continued_flood_gains_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(signing, "MOST_AHEAD", 50)
    ours = link()
    for second in range(5):
        for _ in range(100):
            ours.sign_ahead(frame(), second * 1_000_000)
        assert ours.state.timestamp <= stamp(ours.sign(frame(), second * 1_000_000)) + LEAD + 50


def test_frames_signed_ahead_change_stored_state() -> None:
    ours, news = link(), []
    ours.on_news = lambda: news.append(ours.state.timestamp)
    for now_us in (0, 0, 10_000, 20_000_000):
        signed_ahead(ours, frame(), now_us)
    assert len(news) == 2


# ---------------------------------------------------------------- as the C library


def test_library_keeps_streams_and_refuses_more() -> None:
    """`mavlink_signature_check`: a table of 16 streams, one per sender and link, without eviction."""
    autopilot = vehicle()
    for number in range(MOST_STREAMS):
        assert autopilot.accept(link(number=number).sign(frame(), 0), 0)
    late = 600_000_000
    assert not autopilot.accept(link(number=99).sign(frame(), late), late), "however old the others are"
    assert autopilot.accept(link(number=3).sign(frame(), late), late)


def test_library_limits_delay_of_new_streams_only() -> None:
    autopilot, known, late = vehicle(), link(number=1), 600_000_000
    assert autopilot.accept(known.sign(frame(), 0), 0)
    first = known.sign(frame(), 1_000)
    assert autopilot.accept(link(number=2).sign(frame(), late), late)
    assert not autopilot.accept(link(number=3).sign(frame(), late - 61_000_000), late)
    assert autopilot.accept(first, late)
