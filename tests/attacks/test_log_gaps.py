"""Threat: a gap, as recorded by a computer that stood still, is used to hide records, or to leave them unsealed.

Without a key nobody can make a gap. A holder of the present epoch's key gains nothing by one, and the gap is
reported. A holder of all keys can still leave no record unsealed for longer than 20 s outside of it.
"""

from functools import cache
from hashlib import sha256

import pytest

from reference.attested_flight import attested
from reference.forgery import (
    captured,
    edit,
    expect,
    flight,
    prove,
    read,
    rewritten,
    seed_of,
    signed,
    signers,
)
from reference.log_vectors import close, effect, genesis, log, seal
from reference.resealing import Fields, line_of
from rtshcua.evidence.report import LogVerdict
from virtual import case
from virtual.rows import rows
from virtual.stalling import StallingFlight

S = 1_000_000
LINES = flight()
SIGNED = signers(LINES)


@cache
def stalled() -> tuple[bytes, ...]:
    """The log of a flight that stood still for half a minute."""
    bundle = case.seal(case.mission(case.short_steps()))
    return tuple(StallingFlight(bundle, "px4", {600: 30 * S}, attested=False).fly().lines)


def gap_in(lines: tuple[bytes, ...] | list[bytes]) -> int:
    return next(number for number, line in enumerate(lines) if read(line).get("event") == "stalled")


def gap_after(line: bytes, us: int, **fields: object) -> Fields:
    """The record of a gap at that place."""
    before = read(line)
    times = {key: before[key] + us for key in ("at_us", "utc_us")}
    return (
        effect(0) | times | {"utc_error_us": before["utc_error_us"], "event": "stalled", "detail": f"{us} us"} | fields
    )


def later(lines: list[bytes], by_us: int) -> list[bytes]:
    return [edit(line, **{key: read(line)[key] + by_us for key in ("at_us", "utc_us")}) for line in lines]


def test_genuine_gap_is_reported_without_a_flaw() -> None:
    report = prove(stalled()).report
    assert (report.verdict, report.failure) == (LogVerdict.VERIFIED, None)
    assert [claim.slug for claim in report.unproven].count("gap") == 1


@rows("taken", [1, 2, 3])
def test_records_cannot_be_replaced_by_a_gap_without_key(taken: int) -> None:
    for seal_at in SIGNED[1:3]:
        start = seal_at - taken
        if any(number in SIGNED for number in range(start, seal_at)):
            continue
        silent_us = read(LINES[seal_at])["at_us"] - read(LINES[start - 1])["at_us"]
        gap = line_of(gap_after(LINES[start - 1], silent_us))
        forged = rewritten([*LINES[:start], gap, *LINES[seal_at:]])
        assert expect(forged)[0] in ("seal/root", "seal/size")


@rows("field", ["detail", "event"])
def test_gap_cannot_be_altered_without_key(field: str) -> None:
    lines, number = stalled(), gap_in(stalled())
    value = {"detail": "1 us", "event": "noted"}[field]
    found = expect(rewritten([*lines[:number], edit(lines[number], **{field: value}), *lines[number + 1 :]]))
    assert found == {"detail": ("seal/gap", number), "event": ("seal/missing", number)}[field]


def test_gap_cannot_be_removed_without_key() -> None:
    lines, number = stalled(), gap_in(stalled())
    assert expect(rewritten([*lines[:number], *lines[number + 1 :]]))[0] in ("seal/size", "seal/root")


def test_gap_made_with_stolen_epoch_key_is_reported() -> None:
    """The thief can remove records since the last seal, as always; the report names the silence."""
    taken = SIGNED[2]
    gap = line_of(gap_after(LINES[taken], 40 * S))
    end = edit(LINES[-1], **{key: read(gap)[key] for key in ("at_us", "utc_us")})
    forged = captured([*LINES[: taken + 1], gap, end], seed_of(read(LINES[taken])["next_key"]))
    report = prove(forged).report
    assert report.verdict is LogVerdict.VERIFIED
    assert [(each.record, each.us) for each in report.gaps] == [(taken + 1, 40 * S)]
    slugs = [claim.slug for claim in report.unproven]
    assert "gap" in slugs
    assert "anchor" in slugs


def test_gap_cannot_hide_boundary_entries() -> None:
    """Not even with the log key and all epoch keys, because only the boundary signs these entries."""
    lines = list(attested())
    made = next(n for n, line in enumerate(lines) if read(line).get("event") == "dispatched")
    for number in (made, made - 1):
        silent_us = read(lines[made + 1])["at_us"] - read(lines[number - 1])["at_us"]
        gap = line_of(gap_after(lines[number - 1], silent_us))
        found = expect(signed([*lines[:number], gap, *lines[made + 1 :]]))
        assert found[0] in ("boundary/omitted", "boundary/differs", "boundary/missing")


@pytest.mark.parametrize("recovered", [False, True])
def test_gap_before_older_boundary_statement_is_detected(*, recovered: bool) -> None:
    """A holder of the log's keys truncates the flight after a statement, which would confirm that nothing followed."""
    lines, by_us = list(attested()), 990 * S
    kinds = [read(line)["type"] for line in lines]
    number = next(
        at for at, line in enumerate(lines) if read(line).get("event") == "boundary" and kinds[at + 1] == "seal"
    )
    gap = line_of(gap_after(lines[number - 1], by_us))
    forged = [*lines[:number], gap, *later(lines[number : number + 2], by_us)]
    if recovered:
        sealed = read(forged[-1])
        empty = sha256(b"").hexdigest()
        end = sealed | {
            "type": "recover",
            "discarded_bytes": 0,
            "discarded_digest": empty,
            "epoch": sealed["epoch"] + 1,
        }
        at = {name: sealed[name] for name in ("at_us", "utc_us")}
        forged += [line_of(end), line_of(read(lines[-1]) | at | {"ending": "recovered", "tlog": None})]
    assert expect(signed(forged)) == ("boundary/gap", number + 1)


def test_gaps_cannot_leave_records_unsealed_even_with_all_keys() -> None:
    """A gap for each silence and no seal: only one gap counts in an epoch, and only while nothing is recorded."""
    gaps = [effect(9_000 * number, event="stalled", detail=f"{9 * S} us") for number in range(1, 7)]
    assert expect(log(genesis(), *gaps, close(55_000))) == ("seal/gap", 2)


@rows(
    ("records", "found"),
    [
        ([effect(1), effect(30_000, event="stalled", detail=f"{30 * S} us")], ("seal/gap", 2)),
        ([effect(1), effect(30_000, event="stalled", detail="-1 us")], ("seal/gap", 2)),
        ([effect(1), effect(30_000, event="stalled", detail="29999000")], ("seal/gap", 2)),
        ([effect(0), effect(30_000, event="stalled", detail=f"{30 * S} us"), effect(50_001)], ("seal/missing", 3)),
        ([effect(0), effect(30_000, event="late", detail=f"{30 * S} us")], ("seal/missing", 2)),
        ([effect(20_001), effect(20_001, event="stalled", detail="0 us")], ("seal/missing", 1)),
    ],
    ids=["longer", "negative", "no-unit", "unsealed-after", "another-event", "after-it-is-late"],
)
def test_invalid_gap_is_rejected(records: list[Fields], found: tuple[str, int]) -> None:
    assert expect(log(genesis(), *records, close(60_000))) == found


def test_epoch_may_end_late_only_by_its_gap() -> None:
    gap = effect(40_000, event="stalled", detail=f"{30 * S} us")
    good = prove(log(genesis(), effect(10_000), gap, effect(50_000), seal(50_000, 1), close(50_001))).report
    assert (good.verdict, [each.us for each in good.gaps]) == (LogVerdict.VERIFIED, [30 * S])
    assert expect(log(genesis(), effect(10_000), gap, effect(50_001), close(50_002))) == ("seal/missing", 3)


def test_log_truncated_after_gap_is_incomplete() -> None:
    lines, number = stalled(), gap_in(stalled())
    report = prove(lines[: number + 1]).report
    assert report.verdict is LogVerdict.INCOMPLETE
    assert any("not signed for yet" in claim.text for claim in report.unproven)
