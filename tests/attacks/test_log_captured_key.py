"""Threat: the vehicle is captured in flight, with the key of its present epoch. Records that were sealed before stay
unchanged.
"""

import pytest

from reference.forgery import (
    LOG_KEY,
    STRANGER,
    captured,
    edit,
    expect,
    flight,
    prove,
    public_of,
    read,
    seed_of,
    signers,
    write,
)
from reference.resealing import resealed
from rtshcua.evidence.report import LogVerdict
from virtual.rows import rows

LINES = flight()
SIGNED = signers(LINES)
#: taken in the epoch that this signed record begins
TAKEN = SIGNED[2]
KEY = seed_of(read(LINES[TAKEN])["next_key"])
BEFORE = [number for number in range(1, TAKEN) if number not in SIGNED]
AFTER = [number for number in range(TAKEN + 1, len(LINES)) if number not in SIGNED]


def by_the_thief(lines: list[bytes]) -> list[bytes]:
    """A log rewritten with the epoch's key: the thief names new keys from then on."""
    own = public_of(STRANGER).hex()
    named = [
        edit(line, next_key=own) if number > TAKEN and read(line)["type"] == "seal" else line
        for number, line in enumerate(lines)
    ]
    return captured(named, KEY, STRANGER)


def edited(number: int) -> list[bytes]:
    return [*LINES[:number], edit(LINES[number], utc_error_us=1_001), *LINES[number + 1 :]]


def closed_at(number: int) -> bytes:
    """The close that would follow this record."""
    return edit(LINES[-1], **{key: read(LINES[number])[key] for key in ("at_us", "utc_us")})


def test_log_signed_with_stolen_key_verifies() -> None:
    """Otherwise these attacks would fail for the wrong reason."""
    assert by_the_thief(list(LINES))[: TAKEN + 1] == list(LINES[: TAKEN + 1])
    assert prove(by_the_thief(list(LINES))).report.verdict is LogVerdict.VERIFIED


@rows("number", BEFORE)
def test_earlier_epochs_cannot_be_rewritten(number: int) -> None:
    """Every earlier epoch was sealed by a key that no longer exists."""
    seal = next(each for each in SIGNED if each > number)
    assert expect(by_the_thief(edited(number))) == ("seal/root", seal)


@rows("number", BEFORE)
def test_records_of_earlier_epochs_cannot_be_removed(number: int) -> None:
    seal = next(each for each in SIGNED if each > number)
    assert expect(by_the_thief([*LINES[:number], *LINES[number + 1 :]])) == ("seal/size", seal - 1)


def test_the_seals_of_earlier_epochs_cannot_be_moved() -> None:
    """Two epochs are merged, so that the thief's key would seal records that were sealed already."""
    for number in SIGNED[1:3]:
        slug, _ = expect(by_the_thief([*LINES[:number], *LINES[number + 1 :]]))
        assert slug in ("seal/key", "seal/size")


@pytest.mark.parametrize("number", AFTER)
def test_the_present_epoch_can_be_rewritten_and_the_report_says_so(number: int) -> None:
    """This is the power of the key: the records after the last seal. Only an outside witness can show it."""
    audit = prove(by_the_thief(edited(number)))
    assert audit.report.verdict is LogVerdict.VERIFIED
    assert any("unanchored tail" in claim.text for claim in audit.report.unproven)


def test_truncation_with_stolen_key_is_reported() -> None:
    """The thief may end the log at the capture. Only a witness that saw more can show it."""
    forged = by_the_thief([*LINES[: TAKEN + 1], closed_at(TAKEN)])
    report = prove(forged).report
    assert report.verdict is LogVerdict.VERIFIED
    assert any("unanchored tail" in claim.text for claim in report.unproven)


def test_a_rollback_to_an_earlier_checkpoint() -> None:
    """The log ends at an older seal, which nobody has the key to close."""
    for back in SIGNED[:2]:
        assert expect(by_the_thief([*LINES[: back + 1], closed_at(back)]))[0] == "seal/key"
        assert expect(LINES[: back + 1]) == ("close/missing", back + 1)


def test_a_rollback_that_goes_on_from_an_older_seal() -> None:
    """The records after an older seal are rewritten, and the following seals removed."""
    later = [line for number, line in enumerate(LINES) if number > SIGNED[1] and number not in SIGNED[2:-1]]
    assert expect(by_the_thief([*LINES[: SIGNED[1] + 1], *later]))[0] in ("seal/key", "seal/missing")


def test_a_recover_by_the_key_of_the_epoch() -> None:
    """A recovery would let the thief discard records, so only the log key signs one."""
    dropped = ("ending", "tlog")
    recover = {name: value for name, value in read(closed_at(TAKEN)).items() if name not in dropped}
    recover |= {"type": "recover", "discarded_bytes": 0, "discarded_digest": "00" * 32}
    recover |= {"next_key": public_of(STRANGER).hex()}
    log_key, turns = read(LINES[0])["log_key"], iter([b"", KEY])  # the genesis stays, the recover is the thief's
    lines = [*LINES[: TAKEN + 1], write(recover | {"checkpoint": None}), closed_at(TAKEN)]
    forged = resealed(lines, lambda public: next(turns) if public == log_key else b"")
    assert forged[: TAKEN + 1] == list(LINES[: TAKEN + 1])
    assert expect(forged) == ("seal/key", TAKEN + 1)


def test_log_key_can_rewrite_whole_log() -> None:
    """A holder of the log key needs no epoch key, because the log key names them. Only a witness can show this."""
    own, secret = public_of(STRANGER).hex(), LOG_KEY.private.private_bytes_raw()
    named = [edit(line, next_key=own) if "next_key" in read(line) else line for line in edited(1)]
    forged = captured(named, secret, STRANGER)
    report = prove(forged).report
    assert report.verdict is LogVerdict.VERIFIED
    assert any(f"unanchored tail: {len(LINES)} records" in claim.text for claim in report.unproven)


@pytest.mark.parametrize("number", [AFTER[0], SIGNED[1] + 1])
def test_log_key_can_truncate_and_claim_a_crash(number: int) -> None:
    own, secret = public_of(STRANGER).hex(), LOG_KEY.private.private_bytes_raw()
    close = read(closed_at(number - 1))
    recover = {name: value for name, value in close.items() if name not in ("ending", "tlog")}
    recover |= {"type": "recover", "discarded_bytes": 0, "discarded_digest": "00" * 32, "next_key": own}
    forged = captured([*LINES[:number], write(recover), closed_at(number - 1)], secret, STRANGER)
    assert forged[:number] == list(LINES[:number])
    report = prove(forged).report
    assert report.verdict is LogVerdict.VERIFIED
    assert "recovered" in [claim.slug for claim in report.unproven]
    assert any("unanchored tail" in claim.text for claim in report.unproven)
