"""The verifier, step by step; each attack has its own file under tests/attacks."""

import json
import re
from base64 import b64decode
from collections.abc import Callable

import pytest

from rtshcua.evidence import verify as module
from rtshcua.evidence.chain import Recorder, origin_of
from rtshcua.evidence.finding import Finding
from rtshcua.evidence.merkle import leaf_hash
from rtshcua.evidence.note import Checkpoint, sign
from rtshcua.evidence.report import Report, Verdict
from rtshcua.evidence.verify import Verifier, verify
from rtshcua.model.flat.situation import Now
from rtshcua.wire.keys import Duty, SigningKey


def failure(lines: list[bytes]) -> tuple[str, int]:
    report = verify(lines)
    assert report.verdict is Verdict.FAILED
    assert report.failure is not None
    assert report.shortfall is None
    return report.failure.slug, report.failure.record


def shortfall(lines: list[bytes]) -> tuple[str, int]:
    report = verify(lines)
    assert report.verdict is Verdict.INCOMPLETE
    assert report.failure is None
    assert report.shortfall is not None
    return report.shortfall.slug, report.shortfall.record


def edit(line: bytes, **fields: object) -> bytes:
    """The line with some fields set, still canonical."""
    record = json.loads(line) | fields
    return json.dumps(record, ensure_ascii=False, separators=(",", ":"), sort_keys=True).encode() + b"\n"


def chained(lines: list[bytes]) -> list[bytes]:
    """The lines, numbered and linked anew."""
    done: list[bytes] = []
    for seq, line in enumerate(lines):
        done.append(edit(line, seq=seq, _prev=leaf_hash(done[-1]).hex() if done else "0" * 64))
    return done


def test_a_whole_log(log: list[bytes], log_key: SigningKey) -> None:
    report = verify(log)
    assert report.verdict is Verdict.VERIFIED
    assert (report.failure, report.shortfall) == (None, None)
    assert report.records == 6
    assert report.counts == {"genesis": 1, "decision": 2, "allow": 1, "fallback": 1, "effect": 2, "close": 1}
    assert report.genesis is not None
    assert report.close is not None
    assert report.last_us == 5_020_000
    assert [claim.slug for claim in report.proven] == ["chain", "signed-close"]
    assert log_key.kid.hex() in report.proven[1].text
    assert [claim.slug for claim in report.unproven] == ["anchor"]
    assert b64decode(json.loads(log[-1])["checkpoint"].split("\n")[2]) == report.root


def test_a_verified_log_is_never_called_complete_without_an_anchor(log: list[bytes]) -> None:
    for report in (verify(log), verify(log[:-1]), verify(log[:1]), verify([])):
        for claim in report.proven + report.unproven:
            assert "complete" not in claim.text


def test_records_are_handed_on_as_they_are_read(log: list[bytes]) -> None:
    verifier = Verifier()
    assert [getattr(verifier.take(line), "type", None) for line in log] == [
        "genesis", "decision", "effect", "decision", "effect", "close",
    ]  # fmt: skip


def test_whoever_reads_along_can_end_it(log: list[bytes]) -> None:
    verifier = Verifier()
    verifier.take(log[0])
    verifier.fail(Finding("mine", 0, "because"))
    assert verifier.take(log[1]) is None
    assert verifier.report().failure == Finding("mine", 0, "because")


# 1 the line


def test_nothing_may_follow_the_close(log: list[bytes]) -> None:
    assert failure([*log, b"\n"]) == ("close/junk-after", 6)
    assert failure([*log, b"x"]) == ("close/junk-after", 6)
    assert failure([*log, log[-1]]) == ("close/junk-after", 6)


def test_a_line_has_a_limit(log: list[bytes], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LONGEST", 2000)
    assert failure([log[0], b"x" * 2001]) == ("record/too-long", 1)
    assert verify(log).verdict is Verdict.VERIFIED


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
        ({"version": 2}, "rtshcua/log version 2"),
        ({"version": 2, "later": 1}, "rtshcua/log version 2"),
        ({"format": "other/log"}, "other/log version 1"),
    ],
)
def test_a_format_must_be_known(fields: dict[str, object], found: str, log: list[bytes]) -> None:
    report = verify([edit(log[0], **fields)])
    assert report.failure is not None
    assert report.failure.slug == "genesis/format"
    assert report.failure.found == found
    assert report.failure.expected == "rtshcua/log version 1"


def test_an_unknown_field_in_a_known_version(log: list[bytes]) -> None:
    assert failure([edit(log[0], later=1)]) == ("record/malformed", 0)


def test_the_log_key_has_the_name_it_is_given(log: list[bytes]) -> None:
    assert failure([edit(log[0], log_kid="00" * 16)]) == ("genesis/log-key", 0)


# 4 the chain


def test_the_first_names_none_before(log: list[bytes]) -> None:
    assert failure([edit(log[0], _prev="a" * 64)]) == ("chain/broken", 0)


def test_numbers_leave_no_gap(log: list[bytes]) -> None:
    assert failure([log[0], log[2]]) == ("chain/sequence", 1)
    assert failure([edit(log[0], seq=1)]) == ("chain/sequence", 0)


def test_a_changed_record_is_named_not_the_one_that_shows_it(log: list[bytes]) -> None:
    for number in range(1, 5):
        changed = [*log[:number], edit(log[number], utc_error_us=2_001), *log[number + 1 :]]
        assert failure(changed) == ("chain/broken", number)


def test_a_changed_link_is_named(log: list[bytes]) -> None:
    for number in range(1, 5):
        changed = [*log[:number], edit(log[number], _prev="a" * 64), *log[number + 1 :]]
        assert failure(changed) == ("chain/broken", number)


def test_a_broken_link_at_the_end(log: list[bytes]) -> None:
    assert failure([*log[:-1], edit(log[-1], _prev="a" * 64)]) == ("chain/broken", 4)
    assert failure([log[0], edit(log[1], _prev="a" * 64), log[2][:80]]) == ("chain/broken", 1)


# 5 the clock


def test_monotonic_time_stands_or_goes_on(log: list[bytes]) -> None:
    assert shortfall(chained([log[0], edit(log[1], at_us=5_000_000)])) == ("close/missing", 2)
    assert failure(chained([log[0], edit(log[1], at_us=4_999_999)])) == ("clock/backwards", 1)


def test_utc_may_step_back_within_its_stated_error(log: list[bytes]) -> None:
    start = 1_750_000_000_000_000
    assert shortfall(chained([log[0], edit(log[1], utc_us=start - 4_000)]))[0] == "close/missing"
    assert failure(chained([log[0], edit(log[1], utc_us=start - 4_001)])) == ("clock/utc-backwards", 1)
    assert failure(chained([log[0], log[1], edit(log[2], utc_us=start, utc_error_us=1)]))[0] == "clock/utc-backwards"


# 6 the close


def resigned(log: list[bytes], key: SigningKey, checkpoint: Callable[[Checkpoint], Checkpoint]) -> list[bytes]:
    """The log with a close over a changed checkpoint, signed in the name of the log's own origin."""
    record = json.loads(log[-1])
    origin, size, root = record["checkpoint"].split("\n")[:3]
    text = checkpoint(Checkpoint(origin, int(size), b64decode(root))).text()
    line = sign(Checkpoint(origin, 0, b""), key.public, lambda _: key.sign(text.encode(), duty=Duty.LOG))
    return [*log[:-1], edit(log[-1], checkpoint=text + "\n" + line.rpartition("\n\n")[2])]


def test_signing_anew_is_what_the_next_tests_think(log: list[bytes], log_key: SigningKey) -> None:
    assert resigned(log, log_key, lambda checkpoint: checkpoint) == log


def test_the_close_belongs_to_this_very_log(log: list[bytes], log_key: SigningKey) -> None:
    other = origin_of("another", "00")
    assert failure(resigned(log, log_key, lambda c: c._replace(origin=other))) == ("close/origin", 5)
    assert failure(resigned(log, log_key, lambda c: c._replace(size=5))) == ("close/size", 5)
    assert failure(resigned(log, log_key, lambda c: c._replace(root=bytes(32)))) == ("close/root", 5)


def test_every_field_of_the_close_is_signed(log: list[bytes]) -> None:
    changed = {"at_us": 5_020_001, "ending": "completed", "tlog": "11" * 32, "utc_us": 1_750_000_000_020_001}
    for field, value in changed.items():
        assert failure([*log[:-1], edit(log[-1], **{field: value})]) == ("close/root", 5)
    assert failure([*log[:-1], edit(log[-1], count=4)]) == ("close/count", 5)
    assert failure([*log[:-1], edit(log[-1], checkpoint=None)]) == ("close/unsigned", 5)
    assert failure([*log[:-1], edit(log[-1], checkpoint="")]) == ("close/unsigned", 5)


def test_a_log_of_genesis_and_close_alone(
    recorder: Recorder, begin: Callable[[], bytes], now: Callable[[int], Now]
) -> None:
    log = [begin(), recorder.close(now(1), ending="refused", tlog=None)]
    assert verify(log).verdict is Verdict.VERIFIED


# 7 the end


def test_a_log_without_close_is_incomplete(log: list[bytes]) -> None:
    for count in range(1, 6):
        assert shortfall(log[:count]) == ("close/missing", count)
    report: Report = verify(log[:1])
    assert [claim.slug for claim in report.proven] == ["chain"]
    assert [claim.slug for claim in report.unproven] == ["signed-close"]
    assert report.proven[0].text.startswith("record 0 is")


def test_a_log_cut_inside_a_record_is_torn(log: list[bytes]) -> None:
    for line in (log[1], log[-1]):
        number = log.index(line)
        for length in (1, 9, 40, 80, len(line) - 1):
            assert shortfall([*log[:number], line[:length]]) == ("tail/torn", number)


def test_what_is_no_beginning_of_a_record_is_not_torn_but_wrong(log: list[bytes]) -> None:
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
