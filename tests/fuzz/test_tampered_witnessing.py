"""Tampered requests, anchors, answers and frames: nothing false is cosigned or accepted."""

from collections import Counter
from random import Random

import pytest

from reference.witnessed import ORIGIN, PUBLIC, WITNESSES, Judge, Log
from rtshcua.codec.frames import Codec
from rtshcua.codec.tunnel import MOST_OF_ONE, Assembler, Whole, messages
from rtshcua.evidence.note import split
from rtshcua.evidence.witnessing.anchors import AnchoredExtent, Anchors, notes
from rtshcua.evidence.witnessing.submission import anchor
from rtshcua.evidence.witnessing.witness import CosignRequest, Declined, LastCosigned, decode, decode_answer


def logs() -> tuple[Log, Log]:
    """Two futures of one log."""
    log = Log()
    for count in (3, 5, 2):
        log.effects(count)
        log.seal()
    fork = log.fork()
    for each, event in ((log, "said"), (fork, "landed")):
        each.effects(9, event)
        each.seal()
        each.close()
    return log, fork


LOG, FORK = logs()
TEXTS = {split(note)[0] for note in LOG.notes}


def begun() -> LastCosigned:
    witness = Judge()
    request = LOG.submission.request(None, 14)
    assert request is not None
    witness.consider(request)
    return witness.seen[ORIGIN]


SEEN = begun()
REQUESTS = [
    request.encode()
    for log in (LOG, FORK)
    for known in (None, 0, 10, 13)
    if (request := log.submission.request(known, 99)) is not None
]
MARKS = [Judge(key).blindly(note) for key in WITNESSES[:2] for log in (LOG, FORK) for note in log.notes[3:]]


def mutated(of: Random, data: bytes, others: list[bytes]) -> bytes:
    """Change, remove or insert some bytes, or overwrite a part with similar data."""
    octets = bytearray(data)
    for _ in range(of.choice([1, 1, 1, 2, 5])):
        at = of.randrange(len(octets) + 1)
        match of.randrange(5):
            case 0:
                octets[at : at + 1] = bytes([of.randrange(256)])
            case 1:
                del octets[at : at + of.choice([1, 2, 40])]
            case 2:
                octets[at:at] = of.choice([b"\n", b"\n\n", b" ", b"0", b"\xe2\x80\x94 ", b"=", b"old 13\n"])
            case 3:
                other = of.choice(others)
                begin = of.randrange(len(other))
                part = other[begin : begin + of.randrange(1, 400)]
                octets[at : at + len(part)] = part
            case _:
                lines = bytes(octets).split(b"\n")
                one, two = of.randrange(len(lines)), of.randrange(len(lines))
                lines[one], lines[two] = lines[two], lines[one]
                octets = bytearray(b"\n".join(lines))
    return bytes(octets)


def tamper_request(of: Random) -> str:
    """Check that a witness that saw the log up to record 13 only cosigns a later checkpoint of it."""
    request = decode(mutated(of, of.choice(REQUESTS), REQUESTS))
    if isinstance(request, Declined):
        return str(request.status)
    witness = Judge()
    witness.seen[ORIGIN] = SEEN
    found = witness.consider(request)
    if isinstance(found, Declined):
        return str(found.status)
    text = split(found)[0]
    # Both futures are consistent with record 13, so the witness may accept either.
    assert text in TEXTS or text in {split(note)[0] for note in FORK.notes}
    assert witness.seen[ORIGIN].text == text
    assert int(text.split("\n")[1]) >= 13
    return "cosigned"


def tamper_anchor(of: Random) -> str:
    """Check that no anchor file anchors a log beyond the fork, where it was not witnessed."""
    held = Anchors(ORIGIN, PUBLIC[:2], 2)
    for note in LOG.notes:
        assert held.checkpoint(note) is None
    own = [mark for mark in MARKS if split(mark)[0] in TEXTS and WITNESSES[0].kid.hex() in mark]
    text = mutated(of, "\n".join([*own, ""]).encode(), [mark.encode() for mark in MARKS]).decode("utf-8", "replace")
    for note in notes(text):
        flaw = held.anchor(note)
        if flaw is not None:
            return flaw.slug
    found = held.finish(len(LOG.lines))
    if not isinstance(found, AnchoredExtent):
        return found.slug
    if WITNESSES[1].kid.hex() not in text:
        assert found.records == 0, text
    if found.rejected:
        return "rejected"
    return "anchored" if found.records else "unanchored"


def tamper_answer(of: Random) -> str:
    """Check that an answer becomes an anchor only if a witness made it for this note."""
    note = of.choice(LOG.notes)
    line = of.choice(MARKS).rpartition("— ")[2]
    data = f"200\n— {line}".encode()
    answer = decode_answer(mutated(of, data, [data, b"409\n12\n"]))
    if answer is None:
        return "none"
    assert answer.size is None or answer.size >= 0
    made = anchor(note, answer.body, PUBLIC[:2])
    if made is None:
        return "nothing"
    held = Anchors(ORIGIN, PUBLIC[:2], 1)
    assert held.anchor(made) is None
    return "anchor"


def tamper_frames(of: Random) -> str:
    """Check that messages assembled from damaged frames are among the sent ones."""
    codec, assembler = Codec(1, 191), Assembler()
    sent = [bytes(of.randrange(256) for _ in range(of.randrange(1, 500))) for _ in range(2)]
    frames = [codec.pack(each) for n, data in enumerate(sent) for each in messages(n, bytes([n]) * 8, data)]
    frames += [mutated(of, frame, frames) for frame in frames]
    of.shuffle(frames)
    whole = [assembler.take("a", frame) for datagram in frames for frame in codec.parse(datagram)]
    assert assembler.unfinished <= MOST_OF_ONE
    found = [each for each in whole if isinstance(each, Whole)]
    assert all(each.data == sent[each.kind] for each in found)
    return str(len(found))


def campaign(seed: int, count: int) -> list[Counter[str]]:
    """Count the results of each kind."""
    of = Random(seed)
    ways = (tamper_request, tamper_anchor, tamper_answer, tamper_frames)
    return [Counter(way(of) for _ in range(count)) for way in ways]


def test_some_tampered_requests() -> None:
    requests, anchors, answers, frames = campaign(7, 500)
    assert {"400", "403", "409", "422", "cosigned"} <= set(requests)
    assert {"rejected", "unanchored"} <= set(anchors)
    assert {"none", "nothing", "anchor"} <= set(answers)
    assert "2" in frames


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(100))
def test_a_million_tampered_requests(seed: int) -> None:
    campaign(1_000 + seed, 2_500)


def test_requests_roundtrip() -> None:
    assert all(isinstance(request := decode(each), CosignRequest) and request.encode() == each for each in REQUESTS)
