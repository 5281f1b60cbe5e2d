"""The lines that the recorder writes."""

import json
from base64 import b64encode
from collections.abc import Callable
from hashlib import sha256

import pytest

from rtshcua.evidence.epoch_key import EpochKey
from rtshcua.evidence.heads import Head
from rtshcua.evidence.log_writer import Recorder, origin_of
from rtshcua.evidence.merkle import leaf_hash, root_of
from rtshcua.evidence.note import Checkpoint, open_note
from rtshcua.model.flat.situation import Now
from rtshcua.wire.keys import Duty, SigningKey


def test_every_line_names_the_one_before_and_counts(log: list[bytes], recorder: Recorder) -> None:
    before = "0" * 64
    for number, line in enumerate(log):
        record = json.loads(line)
        assert (record["_prev"], record["seq"]) == (before, number)
        assert line[10:74].decode() == before
        assert line.count(b"\n") == 1
        before = sha256(b"\x00" + line).hexdigest()
    assert recorder.final_hash == before
    assert recorder.count == len(log)


def test_every_record_has_its_moment(log: list[bytes]) -> None:
    for line in log:
        record = json.loads(line)
        assert record["utc_us"] - record["at_us"] == 1_750_000_000_000_000 - 5_000_000
        assert record["utc_error_us"] == 2_000


def test_a_decision_holds_every_input(log: list[bytes]) -> None:
    record = json.loads(log[3])
    assert record["state"] == {"ages": [1200, 0, 50], "values": [35000, None, -3]}
    assert record["context"] == {
        "approvals": [[2, 0, 1, 4999999, 0]],
        "consumed": 0,
        "phase": 1,
        "policy_version": 7,
        "released_us": 5000000,
        "remaining_us": 12000,
        "vehicle": "quad-07",
    }
    assert (record["outcome"], record["reason"], record["rule_step"]) == ("fallback", "state/violated", 6)
    assert (record["clause"], record["clause_at"]) == ('battery > 35 % "ß"', [0, 10, 24])
    assert (record["target"], record["target_link"], record["mode"]) == ("hover for 20 s", 0, "software")
    assert (record["binding"], record["invocation"]) == ("00" * 32, "00" * 16)


def test_text_of_the_world_is_kept_as_far_as_utf8_can(log: list[bytes]) -> None:
    assert json.loads(log[4])["detail"] == "PreArm: ? \x1b[31m\n"


def signed(log: list[bytes]) -> list[int]:
    return [number for number, line in enumerate(log) if "checkpoint" in json.loads(line)]


def test_a_signed_record_vouches_for_all_lines_before_and_for_itself(log: list[bytes]) -> None:
    assert signed(log) == [0, 5, 6, 8]
    before = ""
    for number in signed(log):
        record = json.loads(log[number])
        origin, size, root, own, *more = (text := record["checkpoint"].split("\n\n")[0]).split("\n")
        assert origin == origin_of("quad 07+é", bytes(range(16)).hex())
        assert int(size) == number
        assert root == b64encode(root_of([leaf_hash(line) for line in log[:number]])).decode()
        blank = log[number].replace(json.dumps(record["checkpoint"], ensure_ascii=False).encode(), b"null")
        assert own == "record " + b64encode(leaf_hash(blank)).decode()
        key = "" if record["type"] == "close" else "key " + b64encode(bytes.fromhex(record["next_key"])).decode()
        after = before and "after " + b64encode(sha256(before.encode() + b"\n").digest()).decode()
        assert more == [line for line in (key, after) if line]
        before = text


def test_each_is_signed_by_the_key_that_the_one_before_names(log: list[bytes], log_key: SigningKey) -> None:
    key = log_key.public
    for number in signed(log):
        record = json.loads(log[number])
        checkpoint = open_note(record["checkpoint"], origin_of("quad 07+é", bytes(range(16)).hex()), key)
        assert isinstance(checkpoint, Checkpoint)
        key = checkpoint.key or b""
        assert key.hex() == record.get("next_key", "")


def test_segments_cover_every_byte_but_the_close(log: list[bytes]) -> None:
    first = 0
    for epoch, number in enumerate(signed(log)[1:]):
        record, segment = json.loads(log[number]), b"".join(log[first:number])
        assert (record["epoch"], record["records"], record["bytes"]) == (epoch, number - first, len(segment))
        assert record["digest"] == sha256(segment).hexdigest()
        first = number


def test_an_epoch_is_over_after_a_while_or_after_many_records(
    recorder: Recorder, begin: Callable[[], bytes], now: Callable[[int], Now]
) -> None:
    begin()
    assert not recorder.due(now(9_999))
    assert recorder.due(now(10_000))
    assert not recorder.overdue(now(11_999))
    assert recorder.overdue(now(12_000))
    recorder.seal(now(10_000))
    assert not recorder.due(now(19_999))
    for _ in range(1_023):
        assert not recorder.due(now(10_001))
        recorder.effect(now(10_001), "said")
    assert recorder.due(now(10_001))
    assert not recorder.overdue(now(10_001))
    for _ in range(204):
        recorder.effect(now(10_001), "said")
    assert recorder.overdue(now(10_001))


def test_an_epoch_that_ends_late_begins_its_end_with_the_gap(
    recorder: Recorder, begin: Callable[[], bytes], now: Callable[[int], Now]
) -> None:
    begin()
    assert recorder.caught_up(now(1)) == ()
    gap, seal = (json.loads(line) for line in recorder.caught_up(now(30_000)))
    assert (gap["event"], gap["detail"], seal["type"]) == ("stalled", "30000000 us", "seal")


def test_a_recorder_goes_on_after_a_crash_with_a_key_of_its_own(log: list[bytes], log_key: SigningKey) -> None:
    head, later = Head(), Now(40, 1_750_000_000_900_000, 9_000)
    for number, line in enumerate(log[:5]):
        head.take(line) if number else head.begin(line, b"its digest" * 3 + b"..")
    origin = origin_of("quad 07+é", bytes(range(16)).hex())
    recorder = Recorder.resumed(
        head, origin, lambda text: log_key.sign(text, duty=Duty.LOG), log_key.public, lambda: b"r" * 32
    )
    line = recorder.recover(later, discarded_bytes=7, discarded_digest=sha256(b"garbage").digest())
    record = json.loads(line)
    assert (record["_prev"], record["seq"], record["epoch"], record["records"]) == (leaf_hash(log[4]).hex(), 5, 0, 5)
    assert (record["discarded_bytes"], record["discarded_digest"]) == (7, sha256(b"garbage").hexdigest())
    checkpoint = open_note(record["checkpoint"], origin, log_key.public)
    assert isinstance(checkpoint, Checkpoint)
    assert checkpoint.key == EpochKey(b"r" * 32).public
    assert checkpoint.after == b"its digest" * 3 + b".."
    close = json.loads(recorder.close(later, ending="recovered", tlog=None))
    assert isinstance(open_note(close["checkpoint"], origin, EpochKey(b"r" * 32).public), Checkpoint)


def test_the_log_key_signs_once_and_is_let_go(recorder: Recorder, begin: Callable[[], bytes]) -> None:
    begin()
    with pytest.raises(AssertionError, match="once"):
        begin()


def test_an_epoch_key_does_not_show_its_secret() -> None:
    assert repr(EpochKey(bytes(32))) == f"<epoch key {EpochKey(bytes(32)).public.hex()}>"


def test_origin_has_neither_space_nor_plus() -> None:
    assert origin_of("quad 07+/é", "00") == "rtshcua/log/quad%2007%2B%2F%C3%A9/00"


def test_a_log_can_name_the_one_before(recorder: Recorder, now: Callable[[int], Now]) -> None:
    line = recorder.genesis(
        now(0), bundle=b"", root=b"", boot=bytes(16), vehicle="", mission="", mode="none", before="a" * 64
    )
    assert json.loads(line)["before"] == "a" * 64
    assert json.loads(recorder.close(now(1), ending="refused", tlog=None))["tlog"] is None


def test_boundary_statement_precedes_seal_and_close(
    recorder: Recorder, begin: Callable[[], bytes], now: Callable[[int], Now]
) -> None:
    begin()
    (seal,) = recorder.sealing(now(1))
    assert (json.loads(seal)["type"], recorder.attested(now(1))) == ("seal", ())
    recorder.attest = lambda now, *, final=False: b"last" if final else b"so far"
    statement, seal = map(json.loads, recorder.sealing(now(2)))
    assert (statement["event"], statement["detail"], seal["type"]) == ("boundary", "c28gZmFy", "seal")
    statement, close = map(json.loads, recorder.closing(now(3), ending="completed", tlog=None))
    assert (statement["event"], statement["detail"], close["type"]) == ("boundary", "bGFzdA==", "close")


def test_boundary_loss_is_recorded_once_before_seal(
    recorder: Recorder, begin: Callable[[], bytes], now: Callable[[int], Now]
) -> None:
    begin()
    recorder.lost = lambda: "nobody decides"
    assert recorder.sealing(now(1), tells_loss=False) == (), "records of what it made may come first"
    lost, seal = map(json.loads, recorder.sealing(now(1)))
    assert (lost["event"], lost["detail"], seal["type"]) == ("boundary-lost", "nobody decides", "seal")
    assert [json.loads(line)["type"] for line in recorder.closing(now(2), ending="aborted", tlog=None)] == ["close"]
