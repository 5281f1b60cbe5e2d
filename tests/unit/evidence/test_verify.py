"""The verifier, step by step; each attack has its own file under tests/attacks."""

import json
import re
from base64 import b64decode, b64encode
from collections.abc import Callable, Iterable

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from reference.resealing import line_of, note_of, resealed
from rtshcua.evidence import gaps
from rtshcua.evidence.finding import Finding
from rtshcua.evidence.log_writer import Recorder
from rtshcua.evidence.merkle import leaf_hash
from rtshcua.evidence.report import LogReport, LogVerdict
from rtshcua.evidence.verify import LogVerifier, verify
from rtshcua.model.flat.situation import Now
from rtshcua.wire.keys import SigningKey

SEEDS = [bytes([number]) * 32 for number in range(256)]  # those of `recorder`, and of `log_key`
KEYS = {Ed25519PrivateKey.from_private_bytes(seed).public_key().public_bytes_raw().hex(): seed for seed in SEEDS}


def failed(lines: list[bytes]) -> Finding:
    report = verify(lines)
    assert report.verdict is LogVerdict.FAILED
    assert report.failure is not None
    assert report.shortfall is None
    assert report.failure.offset == sum(map(len, lines[: report.failure.record]))
    return report.failure


def failure(lines: list[bytes]) -> tuple[str, int]:
    found = failed(lines)
    return found.slug, found.record


def shortfall(lines: list[bytes]) -> tuple[str, int]:
    report = verify(lines)
    assert report.verdict is LogVerdict.INCOMPLETE
    assert report.failure is None
    assert report.shortfall is not None
    assert report.shortfall.offset == sum(map(len, lines[: report.shortfall.record]))
    return report.shortfall.slug, report.shortfall.record


def edit(line: bytes, **fields: object) -> bytes:
    """The line with some fields set, still canonical."""
    record = json.loads(line) | fields
    return json.dumps(record, ensure_ascii=False, separators=(",", ":"), sort_keys=True).encode() + b"\n"


def anew(
    lines: Iterable[bytes], keep: Iterable[str] = (), text: Callable[[int, str], str] = lambda _, text: text
) -> list[bytes]:
    """The lines, numbered, linked, sealed and signed anew by the holder of all keys."""
    return resealed(lines, KEYS.__getitem__, keep=keep, text=text)


def changed(log: list[bytes], number: int, **fields: object) -> list[bytes]:
    """The log with some fields of one record set, and nothing else."""
    return [*log[:number], edit(log[number], **fields), *log[number + 1 :]]


def rewritten(log: list[bytes], number: int, **fields: object) -> list[bytes]:
    """The log with some fields of one record set, and everything else recomputed except those fields."""
    return anew(changed(log, number, **fields))


def chained(lines: list[bytes]) -> list[bytes]:
    """The lines with new numbers and links, which need no key."""
    done: list[bytes] = []
    for seq, line in enumerate(lines):
        done.append(edit(line, seq=seq, _prev=leaf_hash(done[-1]).hex() if done else "0" * 64))
    return done


def test_a_whole_log(log: list[bytes], log_key: SigningKey) -> None:
    report = verify(log)
    assert report.verdict is LogVerdict.VERIFIED
    assert (report.failure, report.shortfall) == (None, None)
    assert report.records == report.sealed == 9
    assert report.epochs == 3
    assert report.counts == {
        "genesis": 1, "decision": 2, "allow": 1, "fallback": 1, "effect": 3, "seal": 2, "close": 1,
    }  # fmt: skip
    assert report.genesis is not None
    assert report.close is not None
    assert report.last_us == 5_020_000
    assert [claim.slug for claim in report.proven] == ["chain", "seals", "signed-close"]
    assert "records 0 to 8 are signed for, in 3 sealed epochs" in report.proven[1].text
    assert log_key.kid.hex() in report.proven[2].text
    assert [claim.slug for claim in report.unproven] == ["anchor"]
    assert report.unproven[0].text.startswith("unanchored tail: 9 records")
    assert report.root != b64decode(json.loads(log[-1])["checkpoint"].split("\n")[2])  # that is the root before it


def test_rewriting_helper_reproduces_log(log: list[bytes]) -> None:
    assert anew(log) == log


def test_a_verified_log_is_never_called_complete_without_an_anchor(log: list[bytes]) -> None:
    for report in (verify(log), verify(log[:-1]), verify(log[:1]), verify([])):
        for claim in report.proven + report.unproven:
            assert "complete" not in claim.text


def test_records_are_handed_on_as_they_are_read(log: list[bytes]) -> None:
    verifier = LogVerifier()
    assert [getattr(verifier.take(line), "type", None) for line in log] == [
        "genesis", "decision", "effect", "decision", "effect", "seal", "seal", "effect", "close",
    ]  # fmt: skip


def test_caller_can_end_verification(log: list[bytes]) -> None:
    verifier = LogVerifier()
    verifier.take(log[0])
    verifier.fail(Finding("mine", 0, "because"))
    assert verifier.take(log[1]) is None
    assert verifier.report().failure == Finding("mine", 0, "because")


# 1 the line


def test_bytes_after_the_close_are_refused(log: list[bytes]) -> None:
    assert failure([*log, b"\n"]) == ("close/junk-after", 9)
    assert failure([*log, b"x"]) == ("close/junk-after", 9)
    for junk, what in (
        (bytes(4096), "4096 zero octets, as a file system leaves them"), (b"\n", "empty lines or blanks"),
        (b"  \n", "empty lines or blanks"), (log[-1], "by a record,"), (log[-1][:50], "part of a record"),
        (log[-1][:3], "part of a record"), (b"junk\n", "data other than a record"),
    ):  # fmt: skip
        found = verify([*log, junk]).failure
        assert found is not None
        assert (found.slug, found.offset) == ("close/junk-after", sum(map(len, log)))
        assert what in found.text
    assert failure([*log, log[-1]]) == ("close/junk-after", 9)


def test_a_line_has_a_limit(log: list[bytes], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rtshcua.evidence.reading.LONGEST", 2000)
    assert failure([log[0], b"x" * 2001]) == ("record/too-long", 1)
    assert verify(log).verdict is LogVerdict.VERIFIED


def test_a_line_without_end_is_the_last(log: list[bytes]) -> None:
    assert failure([log[0], log[1][:-1], log[2]]) == ("record/malformed", 1)


# 2 the record


def test_a_flaw_of_a_line_is_its_records(log: list[bytes]) -> None:
    assert failure([log[0], b"{}\n"]) == ("record/malformed", 1)
    report = verify([log[0], b"\xff{}\n"])
    assert report.failure is not None
    assert report.failure.found == "\\xff{}\n"


# 3 the genesis


def test_a_log_begins_with_its_genesis(log: list[bytes]) -> None:
    assert failure(log[1:]) == ("genesis/missing", 0)
    assert failure([log[0], log[0]]) == ("genesis/repeated", 1)


@pytest.mark.parametrize(
    ("fields", "found"),
    [
        ({"version": 5}, "rtshcua/log version 5"),
        ({"version": 1, "later": 1}, "rtshcua/log version 1"),
        ({"format": "other/log"}, "other/log version 4"),
        ({"version": 3}, "rtshcua/log version 3"),
    ],
)
def test_a_format_must_be_known(fields: dict[str, object], found: str, log: list[bytes]) -> None:
    report = verify([edit(log[0], **fields)])
    assert report.failure is not None
    assert report.failure.slug == "genesis/format"
    assert report.failure.found == found
    assert report.failure.expected == "rtshcua/log version 4"


def test_an_unknown_field_in_a_known_version(log: list[bytes]) -> None:
    assert failure([edit(log[0], later=1)]) == ("record/malformed", 0)


def test_log_kid_must_match_the_log_key(log: list[bytes]) -> None:
    assert failure([edit(log[0], log_kid="00" * 16)]) == ("genesis/log-key", 0)


# 4 the chain


def test_the_first_names_none_before(log: list[bytes]) -> None:
    assert failure([edit(log[0], _prev="a" * 64)]) == ("chain/broken", 0)


def test_numbers_leave_no_gap(log: list[bytes]) -> None:
    assert failure([log[0], log[2]]) == ("chain/sequence", 1)
    assert failure([edit(log[0], seq=1)]) == ("chain/sequence", 0)


def test_failure_names_the_changed_record(log: list[bytes]) -> None:
    for number in (1, 2, 3, 4, 7):
        assert failure(changed(log, number, utc_error_us=2_001)) == ("chain/broken", number)


def test_a_changed_link_is_named(log: list[bytes]) -> None:
    for number in (1, 2, 3, 4, 5, 6, 7):
        assert failure(changed(log, number, _prev="a" * 64)) == ("chain/broken", number)


def test_a_broken_link_at_the_end(log: list[bytes]) -> None:
    assert failure(changed(log, 8, _prev="a" * 64)) == ("chain/broken", 7)
    assert failure([log[0], edit(log[1], _prev="a" * 64), log[2][:80]]) == ("chain/broken", 1)


# 5 the clocks


def test_monotonic_time_stands_or_goes_on(log: list[bytes]) -> None:
    start = 1_750_000_000_000_000
    assert shortfall(chained([log[0], edit(log[1], at_us=5_000_000, utc_us=start)])) == ("close/missing", 2)
    assert failure(chained([log[0], edit(log[1], at_us=4_999_999)])) == ("clock/backwards", 1)


def test_the_bundle_was_received_before_the_log_began(log: list[bytes]) -> None:
    began_us = json.loads(log[0])["at_us"]
    assert failure([edit(log[0], received_us=began_us - 1)]) == ("seal/self", 0)
    assert failure([edit(log[0], received_us=began_us + 1)]) == ("clock/received", 0)


def test_utc_may_step_back_within_its_stated_error(log: list[bytes]) -> None:
    start = 1_750_000_000_000_000
    assert shortfall(chained([log[0], edit(log[1], at_us=5_000_000, utc_us=start - 4_000)]))[0] == "close/missing"
    assert failure(chained([log[0], edit(log[1], utc_us=start - 4_001)])) == ("clock/utc-backwards", 1)
    assert failure(chained([log[0], log[1], edit(log[2], utc_us=start, utc_error_us=1)]))[0] == "clock/utc-backwards"


def test_utc_and_monotonic_time_go_on_alike(log: list[bytes]) -> None:
    ahead = 1_750_000_000_010_000 + 4_000
    assert shortfall(chained([log[0], edit(log[1], utc_us=ahead)]))[0] == "close/missing"
    assert failure(chained([log[0], edit(log[1], utc_us=ahead + 1)])) == ("clock/utc-jump", 1)
    assert failure(chained([log[0], edit(log[1], utc_us=ahead - 8_001, utc_error_us=2_000)])) == ("clock/utc-jump", 1)
    slowly = [edit(log[2], at_us=5_010_000 + 5_000 * n, utc_us=ahead + 6_000 * n) for n in range(3)]
    assert failure(chained([log[0], edit(log[1], utc_us=ahead), *slowly]))[0] == "clock/utc-jump"


# 6 the epochs

SIGNED = (0, 5, 6, 8)


@pytest.mark.parametrize("number", SIGNED)
def test_a_signature_belongs_to_this_very_place(number: int, log: list[bytes]) -> None:
    def other(line: int, new: str) -> list[bytes]:
        def text(at: int, text: str) -> str:
            lines = text.split("\n")
            return "\n".join([*lines[:line], new, *lines[line + 1 :]]) if at == number else text

        return anew(log, text=text)

    zeros = b64encode(bytes(32)).decode()
    assert failure(other(0, "rtshcua/log/another/00")) == ("seal/note", number)
    assert failure(other(1, "7")) == ("seal/size", number)
    assert failure(other(2, zeros)) == ("seal/root", number)
    assert failure(other(3, f"record {zeros}")) == ("seal/self", number)
    assert failure(other(4, f"key {zeros}")) == ("seal/next-key", number)
    assert failure(other(4, f"key {zeros}\n")) == ("seal/note", number)
    place = 4 if number == 8 else 5
    assert failure(other(place, f"after {zeros}" + "\n" * (number == 0))) == ("seal/after", number)
    if number:
        assert failure(other(place, f"after {zeros}\n")) == ("seal/note", number)


def test_a_close_names_no_further_key(log: list[bytes]) -> None:
    zeros = b64encode(bytes(32)).decode()
    key = f"\nkey {zeros}\nafter "
    found = failed(anew(log, text=lambda number, text: text.replace("\nafter ", key) if number == 8 else text))
    assert (found.slug, found.found, found.expected) == ("seal/next-key", "none", "00" * 32)


@pytest.mark.parametrize("number", SIGNED)
def test_a_signed_record_bears_one_good_signature(number: int, log: list[bytes]) -> None:
    note: str = json.loads(log[number])["checkpoint"]
    other = json.loads(log[5 if number == 0 else 0])["checkpoint"].rpartition("\n\n")[2]
    wrong = note[:-8] + ("A" if note[-8] != "A" else "B") + note[-7:]
    for checkpoint in (None, "", note[:-1], note + "x", note + other):
        assert failure(changed(log, number, checkpoint=checkpoint)) == ("seal/note", number)
    assert failure(changed(log, number, checkpoint=note.rpartition("\n\n")[0] + "\n\n" + other)) == ("seal/key", number)
    for checkpoint in (wrong, "\n" + note):
        assert failure(changed(log, number, checkpoint=checkpoint)) == ("seal/signature", number)


def test_every_field_of_a_signed_record_is_signed(log: list[bytes]) -> None:
    same = {"at_us": 5_020_001, "utc_us": 1_750_000_000_020_001, "utc_error_us": 2_001}
    for field, value in (same | {"ending": "completed", "tlog": "11" * 32}).items():
        assert failure(changed(log, 8, **{field: value})) == ("seal/self", 8)
    for number in (5, 6, 8):
        counted = {"epoch": 7, "records": 7, "bytes": 7, "digest": "00" * 32}
        for field, value in counted.items():
            assert failure(changed(log, number, **{field: value})) == (f"seal/{field}", number)
            assert failure(anew(changed(log, number, **{field: value}), keep=[field])) == (f"seal/{field}", number)
    assert failure(changed(log, 5, next_key="00" * 32)) == ("seal/self", 5)
    assert failure(changed(log, 0, vehicle="quad")) == ("seal/key", 0)
    for field, value in {"mission": "m", "sync_us": 0, "before": "00" * 32, "utc_us": 0, "next_key": "00" * 32}.items():
        assert failure(changed(log, 0, **{field: value})) == ("seal/self", 0)


def test_log_rewritten_without_keys_fails(log: list[bytes]) -> None:
    edited = chained(changed(log, 3, outcome="allow"))
    assert failure(edited) == ("seal/bytes", 5)
    assert failure(chained(changed(log, 3, outcome="fallback", kind=1))) == ("seal/digest", 5)
    fixed = anew(changed(log, 3, outcome="allow"), keep=["checkpoint"])
    assert failure(fixed) == ("seal/root", 5)
    assert failure(chained([*log[:3], *log[4:]])) == ("seal/records", 4)
    assert failure(anew([*log[:3], *log[4:]], keep=["checkpoint"])) == ("seal/size", 4)
    assert failure(chained([*log[:5], *log[6:]])) == ("seal/epoch", 5)


def test_record_rewritten_with_all_keys_verifies(log: list[bytes]) -> None:
    assert verify(anew(changed(log, 3, outcome="allow"))).verdict is LogVerdict.VERIFIED
    assert verify(anew([*log[:2], *log[3:]])).verdict is LogVerdict.VERIFIED


def seconds(line: bytes, ms: int) -> bytes:
    return edit(line, at_us=5_000_000 + ms * 1_000, utc_us=1_750_000_000_000_000 + ms * 1_000)


def test_an_epoch_lasts_no_longer_than_twenty_seconds(log: list[bytes]) -> None:
    first, record, seal, close = log[0], log[2], log[5], log[8]
    assert verify(anew([first, seconds(record, 20_000), seconds(close, 60_000)])).verdict is LogVerdict.VERIFIED
    assert failure(anew([first, seconds(record, 20_001), seconds(close, 60_000)])) == ("seal/missing", 1)
    late = [first, seconds(seal, 30_000), seconds(record, 50_000), seconds(close, 50_000)]
    assert verify(anew(late)).verdict is LogVerdict.VERIFIED
    assert failure(anew([*late[:2], seconds(record, 50_001)])) == ("seal/missing", 2)


def test_epoch_has_at_most_twice_the_writers_records(log: list[bytes], monkeypatch: pytest.MonkeyPatch) -> None:
    first, record, seal, close = log[0], log[2], log[5], log[8]
    assert gaps.MOST_RECORDS == 2_048
    monkeypatch.setattr(gaps, "MOST_RECORDS", 3)
    assert verify(anew([first, record, record, record, close])).verdict is LogVerdict.VERIFIED
    assert failure(anew([first, record, record, record, record, close])) == ("seal/missing", 4)
    more = [edit(record, at_us=5_014_000, utc_us=1_750_000_000_014_000)] * 3
    assert verify(anew([first, record, seal, *more, close])).verdict is LogVerdict.VERIFIED


def recover_from(line: bytes) -> bytes:
    """A recover in the place of a seal."""
    return line_of(json.loads(line) | {"type": "recover", "discarded_bytes": 3, "discarded_digest": "00" * 32})


def test_monotonic_time_begins_anew_at_a_recover(log: list[bytes]) -> None:
    recover = edit(recover_from(log[5]), at_us=3)
    tail = [edit(line, at_us=4 + number * 1_000) for number, line in enumerate(log[6:])]
    whole = anew([*log[:5], recover, *tail])
    assert verify(whole).verdict is LogVerdict.VERIFIED
    assert verify(whole).counts["recover"] == 1
    assert failure(anew([*log[:5], recover, edit(log[7], at_us=2)])) == ("clock/backwards", 6)
    assert failure(anew([*log[:5], edit(recover, utc_us=0), *tail])) == ("clock/utc-backwards", 5)
    assert failure(anew([*log[:5], recover, edit(log[7], at_us=10_000_000)])) == ("clock/utc-jump", 6)


def test_the_log_key_signs_a_recover_and_no_other_does(log: list[bytes]) -> None:
    recovered = [*log[:5], recover_from(log[5]), *log[6:]]
    whole, first = anew(recovered), json.loads(log[0])
    origin, epoch_key = f"rtshcua/log/quad%2007%2B%C3%A9/{first['boot']}", KEYS[first["next_key"]]
    text = json.loads(whole[5])["checkpoint"].rpartition("\n\n")[0] + "\n"
    assert verify(whole).verdict is LogVerdict.VERIFIED
    assert failure(changed(whole, 5, checkpoint=note_of(origin, text, epoch_key))) == ("seal/key", 5)


def test_a_log_of_genesis_and_close_alone(
    recorder: Recorder, begin: Callable[[], bytes], now: Callable[[int], Now]
) -> None:
    log = [begin(), recorder.close(now(1), ending="refused", tlog=None)]
    assert verify(log).verdict is LogVerdict.VERIFIED


# 7 the end


def test_a_log_without_close_is_incomplete(log: list[bytes]) -> None:
    for count in range(1, 8):
        assert shortfall(log[:count]) == ("close/missing", count)
    report: LogReport = verify(log[:1])
    assert [claim.slug for claim in report.proven] == ["chain", "seals"]
    assert [claim.slug for claim in report.unproven] == ["signed-close", "anchor"]
    assert report.proven[0].text.startswith("record 0 is")


def test_records_after_last_seal_are_unsigned(log: list[bytes]) -> None:
    report = verify(log[:8])
    assert (report.records, report.sealed, report.epochs) == (8, 7, 2)
    assert report.unproven[1].text.startswith("record 7 is chained but not yet signed for")
    assert report.unproven[2].text.startswith("unanchored tail: 8 records")
    assert verify(log[:5]).unproven[1].text.startswith("records 1 to 4 are chained")


def test_a_log_cut_inside_a_record_is_torn(log: list[bytes]) -> None:
    for line in (log[1], log[-1]):
        number = log.index(line)
        for length in (1, 9, 40, 80, len(line) - 1):
            assert shortfall([*log[:number], line[:length]]) == ("tail/torn", number)


def test_tail_that_is_not_a_record_prefix_fails(log: list[bytes]) -> None:
    assert failure([*log[:2], b"x"]) == ("record/malformed", 2)
    assert failure([*log[:2], log[3][:80]]) == ("record/malformed", 2)


def test_an_empty_log_fails(log: list[bytes]) -> None:
    assert failure([]) == ("log/empty", 0)
    assert failure([log[0][:-1]]) == ("genesis/missing", 0)
    report = verify([])
    assert report.proven == ()
    assert [claim.slug for claim in report.unproven] == ["log"]


def test_findings_are_written_as_every_message_is(log: list[bytes]) -> None:
    for lines in ([], log[1:], [*log, b"x"], [log[0], log[2]], log[:2], [log[0][:9]], [*log[:2], b"x"]):
        report = verify(lines)
        finding = report.failure or report.shortfall
        assert finding is not None
        assert finding.text[0].islower()
        assert not finding.text.endswith(".")
        assert re.fullmatch(r"[a-z]+/[a-z-]+", finding.slug)
