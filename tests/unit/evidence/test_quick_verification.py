"""The fast verification accepts what the full one accepts, and nothing in which that one finds a flaw."""

import json
from collections.abc import Callable
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as some

from reference.resealing import leaf_of, line_of, resealed, root_of
from reference.witnessed import LOG_KEY, ORIGIN, PUBLIC, WITNESSES, Judge, Log
from rtshcua.evidence import quick_verification
from rtshcua.evidence.epoch_key import EpochKey
from rtshcua.evidence.merkle import MerkleTree
from rtshcua.evidence.quick_verification import LogOutline, SegmentPart, _nodes, outline, quick, scan, signed_line
from rtshcua.evidence.report import LogReport, LogVerdict
from rtshcua.evidence.verify import verify
from rtshcua.evidence.witnessing.anchors import ANCHORED, Anchors

SEEDS = {EpochKey(seed).public.hex(): seed for seed in ((number).to_bytes(32, "big") for number in range(1, 200))}


def seed_of(public: str) -> bytes:
    return bytes(32) if public == LOG_KEY.public.hex() else SEEDS[public]


def octets_of(data: bytes) -> Callable[[int, int], bytes]:
    return lambda offset, length: data[offset : offset + length]


def laid_out(lines: list[bytes]) -> LogOutline | None:
    data = b"".join(lines)
    return outline(octets_of(data), len(data))


def quickly(
    lines: list[bytes], given: tuple[str, ...] = (), part: Callable[[bytes], SegmentPart | None] = scan
) -> LogReport | None:
    data = b"".join(lines)
    log = laid_out(lines)
    if log is None:
        return None
    anchors = Anchors(ORIGIN, PUBLIC, 1)
    assert not any(anchors.anchor(note) for note in given)
    return quick(log, [part(data[start:end]) for start, end in pairwise(log.offsets)], anchors)


def octets_alone(data: bytes) -> SegmentPart | None:
    part = scan(data)
    return None if part is None else part._replace(leaves=None)


def logged(*epochs: int) -> Log:
    """A log with so many effects in its epochs."""
    log = Log()
    for number, effects in enumerate(epochs):
        if number:
            log.seal()
        log.effects(effects)
    log.close()
    return log


@pytest.fixture
def log() -> Log:
    """A genesis and three effects, a seal alone, a seal and five effects; a close."""
    return logged(3, 0, 5)


def edited(lines: list[bytes], number: int, **fields: object) -> list[bytes]:
    return [*lines[:number], line_of(json.loads(lines[number]) | fields), *lines[number + 1 :]]


def anew(lines: list[bytes], **ways: object) -> list[bytes]:
    return resealed(lines, seed_of, **ways)  # type: ignore[arg-type]


@given(epochs=some.lists(some.integers(0, 40), min_size=1, max_size=9))
def test_quick_verification_agrees_on_complete_logs(epochs: list[int]) -> None:
    lines = logged(*epochs).lines
    careful, found = verify(lines), quickly(lines)
    assert careful.verdict is LogVerdict.VERIFIED
    assert found is not None
    for field in ("records", "root", "close", "genesis", "last_us", "sealed", "epochs", "failure", "shortfall"):
        assert getattr(found, field) == getattr(careful, field)
    assert found.proven[1:] == careful.proven[1:]
    text = (
        f"lines 1 to {found.records} follow one another, each names the previous one, and their tree is the signed one"
    )
    assert found.proven[0].text == text
    assert [claim.slug for claim in found.unproven] == ["anchor", "form"]


def test_verification_by_octets_claims_less(log: Log) -> None:
    found = quickly(log.lines, part=octets_alone)
    assert found is not None
    assert found.verdict is LogVerdict.VERIFIED
    assert [claim.slug for claim in found.proven] == ["octets", "seals", "signed-close"]
    assert [claim.slug for claim in found.unproven] == ["anchor", "tree", "form"]
    assert found.root == b""


@pytest.mark.unmeasured
def test_changed_octet_is_detected(log: Log) -> None:
    data = b"".join(log.lines)
    for at in range(0, len(data), 7):
        changed = data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]
        lines = changed.splitlines(keepends=True)
        assert quickly(lines) is None
        assert quickly(lines, part=octets_alone) is None


def test_changed_line_order_is_detected(log: Log) -> None:
    lines = log.lines
    for at in range(len(lines)):
        for other in (lines[:at] + lines[at + 1 :], lines[: at + 1] + lines[at:], lines[:at]):
            assert quickly(other) is None
        if at:
            assert quickly([*lines[: at - 1], lines[at], lines[at - 1], *lines[at + 1 :]]) is None
    assert quickly([*lines, b"x"]) is None
    assert quickly([*lines[:-1], lines[-1][:-1]]) is None
    assert quickly([lines[0]]) is None
    assert quickly([]) is None


def test_log_resigned_with_all_keys_must_be_consistent(log: Log) -> None:
    lines = log.lines
    assert anew(lines) == lines
    assert quickly(anew(lines)) is not None
    for kept, number in (("records", 4), ("bytes", 4), ("digest", 4), ("epoch", 5)):
        value = "00" * 32 if kept == "digest" else 3
        forged = anew(edited(lines, number, **{kept: value}), keep=[kept])
        assert verify(forged).verdict is LogVerdict.FAILED
        assert quickly(forged) is None
    for line in range(5):

        def text(number: int, text: str, line: int = line) -> str:
            if number != 4:
                return text
            found = text.split("\n")
            found[line] = "5" if line == 1 else found[line][:-3] + ("AA=" if found[line][-3] != "A" else "BA=")
            return "\n".join(found)

        forged = anew(lines, text=text)
        assert verify(forged).verdict is LogVerdict.FAILED
        assert quickly(forged) is None


def test_times_of_signed_records_are_checked(log: Log) -> None:
    at_us, utc_us = (json.loads(log.lines[4])[name] for name in ("at_us", "utc_us"))
    for lines in (
        edited(log.lines, 3, at_us=at_us + 1),
        edited(log.lines, 4, at_us=0, utc_us=utc_us - at_us),
        edited(log.lines, 4, utc_us=0),
        edited(log.lines, 4, utc_us=utc_us + 4_001),
    ):
        forged = anew(lines)
        assert verify(forged).verdict is LogVerdict.FAILED
        assert quickly(forged) is None


@pytest.mark.parametrize(("number", "field", "value"), [(0, "seq", 1), (0, "_prev", "11" * 32), (4, "seq", 5)])
def test_numbers_and_links_of_signed_records_are_checked(number: int, field: str, value: object, log: Log) -> None:
    forged = anew(edited(log.lines, number, **{field: value}), relink=False)
    assert quickly(forged) is None
    if number:
        assert quickly(forged, part=octets_alone) is None


def test_an_epoch_that_was_sealed_too_late(monkeypatch: pytest.MonkeyPatch) -> None:
    log = Log()
    log.effects(1)
    log.ms = 20_001
    log.effects(1)
    log.close()
    assert verify(log.lines).verdict is LogVerdict.FAILED
    assert quickly(log.lines) is None
    many = logged(9)
    assert quickly(many.lines) is not None
    monkeypatch.setattr(quick_verification, "MOST_RECORDS", 8)
    assert quickly(many.lines) is None


def test_monotonic_time_may_begin_anew_at_a_recover() -> None:
    log = Log()
    log.effects(3)
    log.ms = -2_000
    log.recover()
    log.seal()
    log.close()
    lines = log.lines
    assert verify(lines).failure is not None  # UTC went back too
    utc_us = json.loads(lines[3])["utc_us"]
    moved = [line_of(json.loads(line) | {"utc_us": utc_us + n}) if n > 3 else line for n, line in enumerate(lines)]
    whole = anew([line_of(json.loads(line) | {"utc_error_us": 9_000_000}) for line in moved])
    assert verify(whole).verdict is LogVerdict.VERIFIED
    found = quickly(whole)
    assert found is not None
    assert found.counts == {"genesis": 1, "seal": 1, "recover": 1, "close": 1}
    assert [claim for claim in found.unproven if claim.slug == "recovered"] == [
        claim for claim in verify(whole).unproven if claim.slug == "recovered"
    ]


def test_anchors_are_found_where_they_are_recorded_and_beside(log: Log) -> None:
    witness = Judge()
    mark = witness.blindly(log.notes[1])
    found = quickly(log.lines, (mark,))
    assert found is not None
    assert found.anchored == 5
    assert "anchor" in [claim.slug for claim in found.proven]
    assert "unanchored tail: 7 records" in found.unproven[0].text
    other = Log()
    other.effects(1)
    note = other.seal()
    other.add(other.recorder.effect(other.now(), ANCHORED, detail=witness.blindly(note)))
    other.add(other.recorder.effect(other.now(), ANCHORED, detail="no note"))
    other.close()
    found = quickly(other.lines)
    assert found is not None
    assert found.anchored == 3


def test_contradicting_anchor_is_left_to_full_verification() -> None:
    witness = Judge()
    log = Log()
    log.effects(1)
    other = log.fork()
    other.effects(1)
    elsewhere = witness.blindly(other.seal())
    log.effects(1, "else")
    log.seal()
    log.close()
    assert quickly(log.lines) is not None
    assert quickly(log.lines, (elsewhere,)) is None  # another tree of that size
    for _ in range(9):
        other.seal()
    assert quickly(log.lines, (witness.blindly(other.seal()),)) is None  # a longer log
    spread = Log()
    spread.add(spread.recorder.effect(spread.now(), ANCHORED, detail=elsewhere))
    spread.effects(1)
    spread.seal()
    spread.close()
    assert quickly(spread.lines) is None


def test_segment_with_an_inner_signed_record_is_rejected(log: Log) -> None:
    data = b"".join(log.lines[:4])
    assert scan(data) is not None
    assert scan(data + log.lines[4]) is None  # two that sign
    assert scan(b"".join(log.lines[1:3])) is None  # none
    assert scan(data + b"\r\n") is None
    assert scan(log.lines[4][:70] + data) is None
    assert scan(log.lines[11]) is None  # a close begins none
    assert scan(data.replace(b'"at_us":', b'"at_ms":')) is None


def test_text_that_resembles_an_anchor_is_ignored(log: Log) -> None:
    """It is linked, and the fast verification does not parse it."""
    line = b'{"_prev":"' + log.lines[1][10:74] + b'","at_us":5000000,"event":"anchored"'
    part = scan(log.lines[0] + line)
    assert part is not None
    assert part.leaves is not None
    assert part.leaves.anchors == ()


def test_a_signed_line_has_a_limit(log: Log) -> None:
    data = b"x" * 5_000 + b"\n" + b"y" * 100
    assert signed_line(octets_of(data), 0) == data[:5_001]
    assert signed_line(octets_of(data), 0, 4_096) is None
    assert signed_line(octets_of(data), 5_001) is None
    assert signed_line(octets_of(data), 4_999) == b"x\n"


def test_an_outline_needs_a_genesis_and_a_close(log: Log) -> None:
    assert laid_out(log.lines) is not None
    for lines in (log.lines[4:], log.lines[:-1], [b"{}\n", *log.lines[1:]], [b"x" * 9_000], [b"\n", b"\n"]):
        assert laid_out(lines) is None
    assert laid_out(anew(edited(log.lines, 11, bytes=0), keep=["bytes"])) is None
    assert laid_out(anew(edited(log.lines, 11, bytes=1 << 40), keep=["bytes"])) is None


def test_a_long_close_is_still_found() -> None:
    """The origin is as long as the vehicle's name."""
    log = Log()
    log.effects(1)
    log.close()
    genesis = edited(log.lines, 0, vehicle="ß" * 2_000)
    lines = anew(genesis)
    assert len(lines[-1]) > 4_096
    data = b"".join(lines)
    found = outline(octets_of(data), len(data))
    assert found is not None
    assert list(found.offsets) == [0, len(data) - len(lines[-1])]


def test_parts_that_are_missing(log: Log) -> None:
    assert quickly(log.lines, part=lambda data: None) is None


def test_a_walk_that_ends_without_a_close(log: Log) -> None:
    data = b"".join(log.lines)
    whole = laid_out(log.lines)
    assert whole is not None
    parts = [scan(data[start:end]) for start, end in pairwise(whole.offsets)]
    cut = whole._replace(offsets=whole.offsets[:-1])
    assert quick(cut, parts[:-1], Anchors(ORIGIN, PUBLIC, 1)) is None
    longer = whole._replace(size=whole.size + 1)
    assert quick(longer, parts, Anchors(ORIGIN, PUBLIC, 1)) is None


@given(sizes=some.lists(some.integers(1, 70), min_size=1, max_size=12))
def test_a_tree_put_together_from_segments(sizes: list[int]) -> None:
    leaves = [bytes([number % 256]) * 32 for number in range(sum(sizes))]
    tree, first = MerkleTree(), 0
    for size in sizes:
        for height, node in _nodes(leaves[first : first + size], first):
            tree.graft(height, node)
        first += size
        assert tree.size == first
        assert tree.root() == root_of(leaves[:first])


def test_a_log_that_is_anchored_to_its_end(log: Log) -> None:
    one, other = Judge(), Judge(WITNESSES[1])
    found = quickly(log.lines, (one.blindly(log.notes[-1]), other.blindly(log.notes[-1])))
    assert found is not None
    assert (found.anchored, found.records) == (12, 12)
    assert [claim.slug for claim in found.unproven] == ["form"]
    assert found.proven[-1].slug == "anchor"
    assert found.proven[-1].text.startswith("records 0 to 11 are as seen by `")


def test_a_part_of_another_place(log: Log) -> None:
    def elsewhere(data: bytes) -> SegmentPart | None:
        part = scan(data)
        assert part is not None
        assert part.leaves is not None
        return part._replace(leaves=part.leaves._replace(number=part.leaves.number + 1))

    assert quickly(log.lines, part=elsewhere) is None


@pytest.mark.parametrize(
    ("slug", "fields"),
    [
        ("record/malformed", None),
        ("chain/sequence", {"seq": 5}),
        ("seal/missing", {"at_us": 1_000_000_000, "utc_us": None}),
    ],
)
def test_report_names_what_fast_verification_skips(log: Log, slug: str, fields: dict[str, object] | None) -> None:
    """A holder of the key signs lines that are not records: the fast verification parses none, and says so."""
    line = log.lines[7]
    if fields is None:
        other = line[:84] + b'0,"junk":1,"type":"effect"}\n'
    else:
        old = json.loads(line)
        moved = {"utc_us": old["utc_us"] + 1_000_000_000 - old["at_us"]} if "utc_us" in fields else {}
        other = line_of(old | fields | moved)
    lines = relinked([*log.lines[:7], other, *log.lines[8:]])
    assert (failure := verify(lines).failure) is not None
    assert failure.slug == slug
    found = quickly(lines)
    assert found is not None
    assert "whole" not in found.proven[0].text
    form = found.unproven[-1].text
    for word in ("form", "number", "clocks", "sealed in time", "place of each unsigned record"):
        assert word in form


def relinked(lines: list[bytes]) -> list[bytes]:
    """Lines linked again by the place of their link, whatever else they hold, and the close signed anew."""
    made = [lines[0]]
    for line in lines[1:]:
        made.append(line[:10] + leaf_of(made[-1]).hex().encode() + line[74:])
    return anew(made, relink=False)
