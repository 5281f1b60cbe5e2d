"""What the recorder writes."""

import json
from base64 import b64encode
from collections.abc import Callable
from hashlib import sha256

from rtshcua.evidence.chain import Recorder, origin_of
from rtshcua.evidence.merkle import leaf_hash, root_of
from rtshcua.model.flat.situation import Now


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
        "approvals": [[2, 0, 1, 4999999]],
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


def test_the_close_signs_its_own_fields_too(log: list[bytes]) -> None:
    record = json.loads(log[-1])
    origin, size, root = record["checkpoint"].split("\n")[:3]
    assert origin == origin_of("quad 07+é", bytes(range(16)).hex())
    assert int(size) == len(log) == record["count"] + 1
    blank = log[-1].replace(json.dumps(record["checkpoint"], ensure_ascii=False).encode(), b"null")
    assert b"null" in blank
    leaves = [leaf_hash(line) for line in [*log[:-1], blank]]
    assert root == b64encode(root_of(leaves)).decode()


def test_origin_has_neither_space_nor_plus() -> None:
    assert origin_of("quad 07+/é", "00") == "rtshcua/log/quad%2007%2B%2F%C3%A9/00"


def test_a_log_can_name_the_one_before(recorder: Recorder, now: Callable[[int], Now]) -> None:
    line = recorder.genesis(
        now(0), bundle=b"", root=b"", boot=bytes(16), vehicle="", mission="", mode="none", before="a" * 64
    )
    assert json.loads(line)["before"] == "a" * 64
    assert json.loads(recorder.close(now(1), ending="refused", tlog=None))["tlog"] is None
