"""The kept part of a log after a crash, and damage that no crash causes."""

import json
from collections.abc import Iterable
from hashlib import sha256
from itertools import islice
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as some

from reference.crashed import LOG_KEY, UTC_US, certify, writes
from rtshcua.evidence.recovery import RECOVERABLE, Examination, FoundLog, LogState, ending
from rtshcua.evidence.report import LogVerdict
from rtshcua.evidence.verify import verify
from rtshcua.model.flat.situation import Now

LATER = Now(1_000, UTC_US + 86_400_000_000, 2_000)


@pytest.fixture
def lines() -> list[bytes]:
    """A log without a close: genesis, and some epochs."""
    log = writes(Random(5), seals=7)
    return [next(log)[0] for _ in range(60)]


def examined(lines: Iterable[bytes], public: bytes = LOG_KEY.public) -> FoundLog:
    examination = Examination(public)
    for line in lines:
        examination.take(line)
    return examination.examined()


def recovered(found: FoundLog, now: Now = LATER) -> list[bytes]:
    return ending(found, now, certify, LOG_KEY.public, lambda: bytes(32)).splitlines(keepends=True)


def signed(lines: list[bytes]) -> list[int]:
    return [number for number, line in enumerate(lines) if b'"checkpoint":' in line]


def split(data: bytes) -> list[bytes]:
    return data.splitlines(keepends=True)


def test_a_log_that_ends_between_two_records_is_kept_whole(lines: list[bytes]) -> None:
    found = examined(lines)
    assert (found.state, found.kept, found.discarded) == (LogState.WHOLE, len(b"".join(lines)), 0)
    assert found.sealed == signed(lines)[-1] + 1
    log = lines + recovered(found)
    assert verify(log).verdict is LogVerdict.VERIFIED
    recover, close = json.loads(log[-2]), json.loads(log[-1])
    assert (recover["type"], recover["discarded_bytes"], recover["discarded_digest"]) == (
        "recover", 0, sha256().hexdigest(),
    )  # fmt: skip
    assert (close["type"], close["ending"], close["tlog"]) == ("close", "recovered", None)
    assert examined(log).state is LogState.CLOSED


@pytest.mark.unmeasured
def test_complete_records_survive_any_cut(lines: list[bytes]) -> None:
    whole, data = 0, b"".join(lines)
    for end in range(len(lines[0]), len(data), 61):
        while whole < len(lines) and end >= sum(map(len, lines[: whole + 1])):
            whole += 1
        kept = sum(map(len, lines[:whole]))
        found = examined(split(data[:end]))
        assert found.state is (LogState.TORN if end > kept else LogState.WHOLE)
        assert (found.kept, found.discarded, found.head.seq) == (kept, end - kept, whole)
        assert found.discarded_digest == sha256(data[kept:end]).digest()
        assert (found.reason is None) == (end == kept)
        if end % 5 == 0:
            log = lines[:whole] + recovered(found)
            assert verify(log).verdict is LogVerdict.VERIFIED
            assert json.loads(log[-2])["discarded_bytes"] == end - kept


@pytest.mark.parametrize("garbage", [b"\0" * 5_000, b"\xff\n" * 30, b"{}\n", b"\n", b'{"_prev":"', b"x" * 10])
def test_invalid_tail_is_discarded(lines: list[bytes], garbage: bytes) -> None:
    found = examined(split(b"".join(lines) + garbage))
    assert (found.state, found.head.seq, found.discarded) == (LogState.TORN, len(lines), len(garbage))
    assert verify(lines + recovered(found)).verdict is LogVerdict.VERIFIED


def test_a_hole_in_what_was_not_sealed_is_torn_there(lines: list[bytes]) -> None:
    last = signed(lines)[-1]
    assert last + 3 < len(lines)
    holed = lines.copy()
    holed[last + 2] = holed[last + 2][:40] + bytes(60) + holed[last + 2][100:]
    found = examined(holed)
    assert (found.state, found.head.seq) == (LogState.TORN, last + 2)
    assert found.discarded == sum(map(len, holed[last + 2 :]))


def test_damage_before_a_signed_record_is_tampering(lines: list[bytes]) -> None:
    for place in range(signed(lines)[-1]):
        holed = lines.copy()
        holed[place] = bytes(60) + holed[place][60:]
        assert examined(holed).state is LogState.TAMPERED


def test_record_that_does_not_follow_is_tampering(lines: list[bytes]) -> None:
    last = signed(lines)[-1]
    for changed, slug in (
        (lines[: last + 1] + lines[last + 2 :], "chain/sequence"),
        ([*lines, lines[-1]], "chain/sequence"),
        ([*lines, edited(lines[-1], seq=len(lines))], "chain/broken"),
        ([*lines, edited(lines[0], seq=len(lines))], "genesis/repeated"),
        (lines[1:], "genesis/missing"),
        ([*lines, after(lines, at_us=0)], "clock/backwards"),
        ([*lines, after(lines, at_us=60_000_000, utc_us=UTC_US + 60_000_000)], "seal/missing"),
        ([edited(lines[0], mission="other"), *lines[1:]], "seal/self"),
    ):
        found = examined(changed)
        assert found.state is LogState.TAMPERED
        assert found.reason is not None
        assert found.reason.slug == slug


def test_epoch_without_a_seal_is_tampering() -> None:
    log = writes(Random(1), seals=10**9)
    found = examined(next(log)[0] for _ in range(2_060))
    assert (found.state, found.head.seq) == (LogState.TAMPERED, 2_049)
    assert found.reason is not None
    assert found.reason.slug == "seal/missing"


def test_data_after_close_is_tampering(lines: list[bytes]) -> None:
    log = lines + recovered(examined(lines))
    for more in (b"x", b"\n", lines[-1], bytes(512)):
        found = examined([*log, more])
        assert found.state is LogState.TAMPERED
        assert found.reason is not None
        assert found.reason.slug == "close/junk-after"
        assert found.kept == sum(map(len, log))


@pytest.mark.parametrize("data", [b"", b"x", bytes(4_000), b'{"_prev":"000'])
def test_log_without_a_first_record_has_not_begun(data: bytes) -> None:
    found = examined(split(data))
    assert (found.state, found.kept, found.genesis) == (LogState.UNBEGUN, 0, None)


def test_damaged_first_record_before_others_is_tampering(lines: list[bytes]) -> None:
    assert examined([lines[0][:-1]]).state is LogState.UNBEGUN
    assert examined([b"x" * 9 + lines[0][9:], lines[1]]).state is LogState.TAMPERED


def test_a_log_of_another_key_is_not_ours(lines: list[bytes]) -> None:
    assert examined(lines, bytes(32)).state is LogState.FOREIGN
    assert examined([*lines, b"x"], bytes(32)).state is LogState.FOREIGN


def test_line_without_end_is_bounded(lines: list[bytes], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rtshcua.evidence.reading.LONGEST", 2_000)
    found = examined([*lines, b"x" * 2_001, b"y"])
    assert found.reason is not None
    assert (found.state, found.reason.slug) == (LogState.TORN, "record/too-long")


def test_lost_clock_records_the_full_time_error(lines: list[bytes]) -> None:
    found = examined(lines)
    log = lines + recovered(found, Now(7, 0, 5))
    assert verify(log).verdict is LogVerdict.VERIFIED
    assert json.loads(log[-1])["utc_error_us"] == found.latest_us


def test_unsigned_records_are_not_proven(lines: list[bytes]) -> None:
    found = examined([*lines, b"torn"])
    log = lines + recovered(found)
    said = {claim.slug: claim.text for claim in verify(log).unproven}
    assert f"(unsigned then: {len(lines) - found.sealed})" in said["recovered"]
    assert "after a crash: " in said["recovered"]
    assert "(discarded: 4 octets)" in said["recovered"]
    again = examined(log[:-1])
    twice = {claim.slug: claim.text for claim in verify(log[:-1] + recovered(again)).unproven}
    assert "after 2 crashes: " in twice["recovered"]


def test_recovery_can_be_interrupted(lines: list[bytes]) -> None:
    found = examined(lines)
    recover, close = recovered(found)
    again = examined([*lines, recover, close[:-1]])
    assert (again.state, again.head.seq) == (LogState.TORN, len(lines) + 1)
    assert verify([*lines, recover, *recovered(again)]).verdict is LogVerdict.VERIFIED


LOG = b"".join(line for line, _ in islice(writes(Random(9), seals=8), 40))
SEALED = b"".join(split(LOG)[: signed(split(LOG))[-1] + 1])


@given(some.integers(0, len(LOG)), some.integers(0, 900), some.binary(max_size=40))
def test_recovery_signs_only_verified_prefix(start: int, size: int, put: bytes) -> None:
    data = LOG[:start] + put + LOG[start + size :]
    found = examined(split(data))
    assert found.kept + found.discarded == len(data)
    if found.state in RECOVERABLE:
        kept = data[: found.kept]
        assert verify(split(kept) + recovered(found)).verdict is LogVerdict.VERIFIED
        assert LOG.startswith(kept)
        assert data.startswith(SEALED) or split(SEALED)[-1] not in split(data)
    elif found.genesis is not None:
        assert found.state is LogState.TAMPERED


def edited(line: bytes, **fields: object) -> bytes:
    return (
        json.dumps(json.loads(line) | fields, ensure_ascii=False, separators=(",", ":"), sort_keys=True).encode()
        + b"\n"
    )


def after(lines: list[bytes], **fields: object) -> bytes:
    """An effect linked to the last of the lines."""
    effect = next(line for line in lines if b'"type":"effect"' in line)
    last = json.loads(lines[-1])
    moment = {key: last[key] for key in ("at_us", "utc_us")}
    return edited(effect, _prev=sha256(b"\0" + lines[-1]).hexdigest(), seq=len(lines), **(moment | fields))
