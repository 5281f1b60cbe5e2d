"""The checkpoints that a witness cosigns or refuses; requests as bytes; and the submission of a log."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.witnessed import BOOT, LOG_KEY, ORIGIN, PUBLIC, VEHICLE, WITNESSES, Judge, Log
from rtshcua.evidence.note import Checkpoint, key_id, parse, sign, signature_line
from rtshcua.evidence.witnessing.submission import MOST_NOTES, Submission, anchor, note_of
from rtshcua.evidence.witnessing.witness import (
    CONFLICT,
    FORBIDDEN,
    INCONSISTENT,
    MALFORMED,
    MOST_PROOF,
    UNKNOWN,
    CosignRequest,
    Declined,
    WitnessResponse,
    decode,
    decode_answer,
    judge,
    vehicle_of,
)
from rtshcua.wire.keys import Duty
from virtual.rows import rows


def asked(log: Log, known: int | None, records: int | None = None) -> CosignRequest:
    request = log.submission.request(known, len(log.lines) if records is None else records)
    assert request is not None
    return request


def refused(witness: Judge, request: CosignRequest) -> Declined:
    before = dict(witness.seen)
    found = witness.consider(request)
    assert isinstance(found, Declined), found
    assert witness.seen == before
    return found


def cosigned(witness: Judge, request: CosignRequest) -> str:
    found = witness.consider(request)
    assert isinstance(found, str), found
    return found


def test_each_epoch_in_turn() -> None:
    log, witness, known = Log(), Judge(), None
    for count in (0, 3, 0, 10, 1):
        if count:
            log.effects(count)
        if log.submission.records > 1:
            log.seal()
        mark = cosigned(witness, asked(log, known))
        assert mark.startswith(log.notes[-1])
        known = log.submission.last(len(log.lines))
        assert witness.seen[ORIGIN].text == log.notes[-1].rpartition("\n\n")[0] + "\n"
    log.close()
    cosigned(witness, asked(log, known))
    assert log.submission.request(log.submission.last(len(log.lines)), len(log.lines)) is None


def test_a_witness_that_comes_late_is_led_along_the_keys() -> None:
    log, witness = Log(), Judge()
    for _ in range(3 * MOST_NOTES):
        log.effects(2)
        log.seal()
    known, rounds = None, 0
    while (request := log.submission.request(known, len(log.lines))) is not None:
        assert len(request.chain) <= MOST_NOTES
        cosigned(witness, request)
        known = int(request.note.split("\n")[1])
        rounds += 1
    assert known == log.submission.last(len(log.lines))
    assert rounds == 3


def test_only_what_is_durable_is_shown() -> None:
    log = Log()
    log.effects(3)
    log.seal()
    assert log.submission.request(None, 0) is None
    assert asked(log, None, 4).note == log.notes[0]
    assert asked(log, None, 5).note == log.notes[1]
    assert (log.submission.last(0), log.submission.last(1), log.submission.last(5)) == (None, 0, 4)
    assert log.submission.request(3, 5) is None  # no checkpoint of this log
    assert log.submission.request(99, 5) is None


def test_repeated_request_is_answered_again() -> None:
    log, witness = Log(), Judge()
    cosigned(witness, asked(log, None))
    cosigned(witness, asked(log, None))
    log.effects(1)
    log.seal()
    cosigned(witness, asked(log, None))  # the genesis comes along, though it is known
    assert refused(witness, asked(log, None)).size == 2
    cosigned(witness, log.submission.again(2))


def test_wrong_known_size_is_answered_with_size() -> None:
    log, witness = Log(), Judge()
    cosigned(witness, asked(log, None))
    for _ in range(3):
        log.effects(1)
        log.seal()
    cosigned(witness, asked(log, 0, 5))
    found = refused(witness, asked(log, 2))
    assert (found.status, found.size, found.contradiction) == (CONFLICT, 4, False)
    forgetful = Judge()
    found = refused(forgetful, asked(log, 2))
    assert (found.status, found.size) == (CONFLICT, 0)


@pytest.fixture
def split_view() -> tuple[Log, Log, Judge]:
    """Two futures of one log after four records, and a witness that saw the first one up to record 6."""
    log = Log()
    log.effects(2)
    log.seal()
    other = log.fork()
    log.effects(2)
    other.effects(2, "landed")
    log.seal()
    other.seal()
    witness = Judge()
    cosigned(witness, asked(log, None))
    return log, other, witness


def test_split_view_at_the_same_size(split_view: tuple[Log, Log, Judge]) -> None:
    log, other, witness = split_view
    size = log.submission.last(99)
    assert size == other.submission.last(99) == 6
    found = refused(witness, CosignRequest(6, (), other.notes[-1]))
    assert (found.status, found.size, found.contradiction) == (CONFLICT, 6, True)  # an epoch's key signs once
    found = refused(witness, CosignRequest(6, (), other.notes[-1], tuple(other.notes[:-1])))
    assert (found.status, found.contradiction) == (CONFLICT, False)
    other.effects(1)
    other.seal()
    assert refused(witness, CosignRequest(6, (), other.notes[-1])).status == FORBIDDEN


def test_split_view_by_the_log_key(split_view: tuple[Log, Log, Judge]) -> None:
    _, _, witness = split_view
    fork = Checkpoint(ORIGIN, 6, bytes(32), bytes(32), bytes(32))
    note = sign(fork, LOG_KEY.public, lambda text: LOG_KEY.sign(text, duty=Duty.LOG))
    found = refused(witness, CosignRequest(6, (), note))
    assert (found.status, found.size, found.contradiction) == (CONFLICT, 6, True)


def test_split_view_that_grew(split_view: tuple[Log, Log, Judge]) -> None:
    log, other, witness = split_view
    other.effects(3)
    other.recover()
    request = asked(other, 6)
    assert refused(witness, request).status == INCONSISTENT
    log.effects(3)
    log.seal()
    assert refused(witness, request._replace(proof=asked(log, 6).proof)).status == INCONSISTENT
    for proof in ((), asked(log, 6).proof[:-1], request.proof):
        found = refused(witness, asked(log, 6)._replace(proof=proof))
        assert (found.status, found.contradiction) == (INCONSISTENT, False)
        assert "the tree begins with the one of 6 records" in found.text
    cosigned(witness, asked(log, 6))


def test_other_lines_below_the_checkpoint_that_was_cosigned(split_view: tuple[Log, Log, Judge]) -> None:
    """The log's end names the text that the witness saw, over a tree that does not begin with that text's."""
    _, other, witness = split_view
    seen = parse(witness.seen[ORIGIN].text)
    assert isinstance(seen, Checkpoint)
    other.recorder._head.after = seen.digest()
    other.effects(3)
    other.recover()
    request = asked(other, 6)
    for proof in (request.proof, ()):
        found = refused(witness, request._replace(proof=proof))
        assert (found.status, found.contradiction) == (INCONSISTENT, False)
        assert "the tree begins with the one of 6 records" in found.text


def test_second_genesis_by_same_key_is_a_contradiction() -> None:
    log, other, witness = Log(), Log(bundle=b"another bundle"), Judge()
    cosigned(witness, asked(log, None))
    other.effects(2)
    other.seal()
    found = refused(witness, asked(other, 0))
    assert (found.status, found.contradiction) == (CONFLICT, True)


def test_rollback_and_truncation(split_view: tuple[Log, Log, Judge]) -> None:
    log, _, witness = split_view
    found = refused(witness, asked(log, 0, 4))
    assert (found.status, found.size) == (CONFLICT, 6)
    found = refused(witness, CosignRequest(6, (), log.notes[1]))
    assert found.status == MALFORMED


def test_a_recovered_log_goes_on(split_view: tuple[Log, Log, Judge]) -> None:
    log, _, witness = split_view
    log.effects(1)
    log.recover()
    cosigned(witness, asked(log, 6))
    log.effects(1)
    log.close()
    cosigned(witness, asked(log, 8))


def test_after_a_close_there_is_nothing() -> None:
    log, witness = Log(), Judge()
    log.close()
    cosigned(witness, asked(log, None))
    log.recover()
    found = refused(witness, asked(log, 1))
    assert (found.status, found.contradiction) == (CONFLICT, True)
    found = refused(Judge(), asked(log, None))
    assert (found.status, found.contradiction) == (CONFLICT, False)


def test_a_chain_goes_forward() -> None:
    log = Log()
    for _ in range(3):
        log.effects(1)
        log.recover()
    notes = log.notes
    request = CosignRequest(0, (), notes[3], (notes[0], notes[2], notes[1]))
    assert refused(Judge(), request).status == INCONSISTENT
    assert refused(Judge(), request._replace(chain=(notes[0], notes[1], notes[0]))).status == CONFLICT


@pytest.mark.parametrize("gap", [0, 1, 2])
def test_a_note_left_out_breaks_the_chain(gap: int) -> None:
    log = Log()
    for _ in range(3):
        log.effects(1)
        log.seal()
    request = asked(log, None)
    assert len(request.chain) == 3
    chain = request.chain[:gap] + request.chain[gap + 1 :]
    assert refused(Judge(), request._replace(chain=chain)).status == FORBIDDEN


def test_a_chain_of_another_log_gives_no_key() -> None:
    """The genesis of one log names a key that signs nothing in the name of another."""
    theirs = Log().notes[0].replace(BOOT.hex(), "ff" * 16)
    text = theirs.rpartition("\n\n")[0] + "\n"
    genesis = parse(text)
    assert isinstance(genesis, Checkpoint)
    genesis = sign(genesis, LOG_KEY.public, lambda data: LOG_KEY.sign(data, duty=Duty.LOG))
    seal = Log()
    seal.effects(1)
    note = seal.seal()
    assert refused(Judge(), CosignRequest(0, (), note, (genesis,))).status == FORBIDDEN
    # a signature in the name of the one below the text of the other
    swapped = f"{text}\n{Log().notes[0].rpartition(chr(10) * 2)[2]}"
    assert refused(Judge(), CosignRequest(0, (), note, (swapped,))).status == FORBIDDEN
    key = LOG_KEY.public
    crossed = text + "\n" + signature_line(
        ORIGIN, key_id(ORIGIN, key) + LOG_KEY.sign(text.encode(), duty=Duty.LOG)
    )  # fmt: skip
    assert refused(Judge(), CosignRequest(0, (), note, (crossed,))).status == FORBIDDEN


def test_first_note_must_cover_the_genesis() -> None:
    """A holder of the log key could begin in the middle, so it is refused."""
    log = Log()
    log.effects(1)
    log.recover()
    assert refused(Judge(), CosignRequest(0, (), log.notes[1])).status == FORBIDDEN


def test_logs_of_others() -> None:
    stranger = Checkpoint("some/log", 0, bytes(32), bytes(32), None)
    note = sign(stranger, LOG_KEY.public, lambda text: LOG_KEY.sign(text, duty=Duty.LOG))
    assert refused(Judge(), CosignRequest(0, (), note)).status == UNKNOWN
    theirs = Log().notes[0]
    assert isinstance(found := judge(CosignRequest(0, (), theirs), None, lambda vehicle: ()), Declined)
    assert found.status == UNKNOWN
    assert judge(CosignRequest(0, (), theirs), None, lambda vehicle: (bytes(32),)) == Declined(
        FORBIDDEN, "not signed by the key that the previous record names, nor by the log's key"
    )


@pytest.mark.parametrize("note", ["", "x", "a\n\n— b c\n", Log().notes[0].rpartition("\n\n")[0] + "\n"])
def test_request_without_checkpoint_is_declined(note: str) -> None:
    assert refused(Judge(), CosignRequest(0, (), note)).status == MALFORMED


@rows(
    ("origin", "vehicle"),
    [(ORIGIN, VEHICLE), ("rtshcua/log/quad/00", "quad"), ("rtshcua/log/quad%2f/00", ""), ("rtshcua/log/a b/0", ""),
     ("log/quad/0", ""), ("rtshcua/log/", ""), ("rtshcua/log//0", ""), ("rtshcua/log/%FF/0", "")],
)  # fmt: skip
def test_origin_names_the_vehicle(origin: str, vehicle: str) -> None:
    assert vehicle_of(origin) == vehicle


# ------------------------------------------------------------------------------------------------ as bytes


def test_the_body_is_that_of_the_page() -> None:
    log = Log()
    log.effects(4)
    log.seal()
    first = asked(log, None)
    assert first.encode().decode() == f"old 0\n\n{log.notes[1]}\n{log.notes[0]}"
    log.effects(3)
    log.seal()
    request = asked(log, 5)
    assert request.chain == ()
    old, *proof = request.encode().decode().partition("\n\n")[0].split("\n")
    assert old == "old 5"
    assert len(proof) == len(request.proof) > 0
    for each in (first, request, asked(log, None)):
        assert decode(each.encode()) == each


@rows(
    "data",
    [
        b"",
        b"\xff",
        b"old 0",
        b"old 0\n\n",
        b"old 0\n\na",
        b"old 0\n\na\n\nb",
        b"old 00\n\na\n\nb\n",
        b"new 0\n\na\n\nb\n",
        b"old -1\n\na\n\nb\n",
        "old ²\n\na\n\nb\n".encode(),
        b"old 99999999999999999\n\na\n\nb\n",
        b"old 0\nAAAA\n\na\n\nb\n",
        b"old 0\n" + b"A" * 43 + b"=\n\na\n\nb\n\nc",
        b"old 0\n" + (b"A" * 43 + b"=\n") * (MOST_PROOF + 1) + b"\na\n\nb\n",
    ],
)
def test_malformed_request_is_declined(data: bytes) -> None:
    found = decode(data)
    assert isinstance(found, Declined)
    assert found.status == MALFORMED


def test_the_largest_proof_is_read() -> None:
    data = b"old 0\n" + (b"A" * 43 + b"=\n") * MOST_PROOF + b"\na\n\nb\n"
    request = decode(data)
    assert isinstance(request, CosignRequest)
    assert request.encode() == data


SAMPLE = Log()
SAMPLE.effects(5)
SAMPLE.seal()
SAMPLE.effects(5)
SAMPLE.seal()


@given(st.data())
def test_arbitrary_input_raises_nothing(data: st.DataObject) -> None:
    """A mutated request is refused, or contains the same checkpoint."""
    witness = Judge()
    cosigned(witness, asked(SAMPLE, None, 7))
    octets = bytearray(asked(SAMPLE, 6).encode())
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.integers(0, len(octets) - 1))
        octets[place : place + data.draw(st.integers(0, 2))] = data.draw(st.binary(max_size=2))
    request = decode(bytes(octets))
    if isinstance(request, CosignRequest) and isinstance(witness.consider(request), str):
        assert request.note.partition("\n\n")[0] == SAMPLE.notes[2].partition("\n\n")[0]


# ------------------------------------------------------------------------------------------------ what comes back


def test_an_anchor_takes_from_an_answer_what_witnesses_made() -> None:
    note = Log().notes[0]
    text = note.rpartition("\n\n")[0] + "\n"
    first, second = Judge(), Judge(WITNESSES[1])
    lines = [first.line(text), second.line(text)]
    assert anchor(note, "junk\n" + "".join(lines), PUBLIC) == note + "".join(lines)
    assert anchor(note, "".join(lines), PUBLIC[:1]) == note + lines[0]
    assert anchor(note, first.line(text.replace("\n0\n", "\n1\n")), PUBLIC) is None
    assert anchor(note, "", PUBLIC) is None


def test_notes_are_found_in_signed_records_alone() -> None:
    log = Log()
    quoted = log.recorder.effect(log.now(), "said", detail=',"checkpoint":"x"')
    assert note_of(quoted) is None
    assert note_of(b'{"a":1,"checkpoint":"x"') is None
    assert note_of(log.lines[0]) == log.notes[0]
    assert Submission().request(None, 0) is None


def test_answers() -> None:
    refusal = Declined(CONFLICT, "words", 12)
    assert refusal.answer().encode() == b"409\n12\n"
    assert refusal.answer().size == 12
    assert Declined(FORBIDDEN, "words").answer() == WitnessResponse(FORBIDDEN, "words\n")
    for answer in (refusal.answer(), WitnessResponse(200, "— a b\n")):
        assert decode_answer(answer.encode()) == answer
    assert [WitnessResponse(409, body).size for body in ("", "x\n", "9" * 17, "²", "0\n")] == [
        None,
        None,
        None,
        None,
        0,
    ]
    assert [decode_answer(data) for data in (b"", b"200", b"20\n", b"abc\n")] == [None] * 4
