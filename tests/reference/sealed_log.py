"""A log of some epochs with the keys of `virtual.case`, for tests of proofs."""

from functools import cache
from hashlib import sha256
from typing import NamedTuple

from reference.seeds import epoch_seeds
from rtshcua.evidence.heads import Head
from rtshcua.evidence.log_writer import Recorder
from rtshcua.model.decision import Decision
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.wire.keys import Duty
from rtshcua.wire.request import Ref
from virtual import case

PIN = case.KEYS[Duty.ROOT].public
LOG_KEY = case.KEYS[Duty.LOG]
VEHICLE = "quad 07/é"
UTC_US = case.flat.ISSUED + 60 * case.S

_STATE = State((35_000, None, -3), (1_200, 0, 50))


class SealedLog(NamedTuple):
    """The lines, and the numbers of the signed records among them."""

    lines: tuple[bytes, ...]
    signed: tuple[int, ...]


def sign(text: bytes) -> bytes:
    """By the log key."""
    return LOG_KEY.sign(text, duty=Duty.LOG)


def now(number: int) -> Now:
    """The time of a record: one millisecond each."""
    return Now(5_000_000 + number * 1_000, UTC_US + number * 1_000, 2_000)


@cache
def sealed_log(epochs: int = 3, records: int = 5, *, recovers: bool = False, closed: bool = True,
               boot: bytes = bytes(range(16)), mission: str = "short") -> SealedLog:  # fmt: skip
    """A log of epochs with a number of ordinary records; with `recovers` the middle one ends with a recovery."""
    draw = epoch_seeds()
    recorder = Recorder(sign, LOG_KEY.public, draw)
    root = case.root()[1]
    lines = [
        recorder.genesis(
            now(0), bundle=b"bundle", root=root, boot=boot, vehicle=VEHICLE, mission=mission, mode="software"
        )
    ]
    signed = [0]
    for epoch in range(epochs):
        for _ in range(records):
            lines.append(_ordinary(recorder, len(lines)))
        if epoch == epochs - 1:
            break
        signed.append(len(lines))
        if recovers and epoch == epochs // 2:
            recorder = resumed(lines, draw)
            lines.append(recorder.recover(now(len(lines)), discarded_bytes=7, discarded_digest=sha256(b"").digest()))
        else:
            lines.append(recorder.seal(now(len(lines))))
    if closed:
        signed.append(len(lines))
        lines.append(recorder.close(now(len(lines)), ending="completed", tlog=bytes(32)))
    return SealedLog(tuple(lines), tuple(signed))


def resumed(lines: list[bytes], draw: object) -> Recorder:
    """Return a recorder that continues after these lines."""
    head = Head()
    from reference.forgery import read

    for line in lines:
        if b',"checkpoint":"' in line:
            head.begin(line, sha256(read(line)["checkpoint"].partition("\n\n")[0].encode() + b"\n").digest())
        else:
            head.take(line)
    from rtshcua.evidence.log_writer import origin_of

    genesis = read(lines[0])
    return Recorder.resumed(head, origin_of(genesis["vehicle"], genesis["boot"]), sign, LOG_KEY.public, draw)  # type: ignore[arg-type]


def _ordinary(recorder: Recorder, number: int) -> bytes:
    if number % 2:
        return recorder.effect(now(number), "dispatched", Ref(0, 0, -1), token=number, detail=f'goto {number} "ß"')
    context = Context(bytes(32), VEHICLE, 7, 0, 5_000_000, 1, 12_000, ())
    answer = Decision(Outcome.DENY, Reason.ADMITTED, 8, Clause("battery > 35 %", 0, 1, 9, ()), None, None, 6_000_000)
    return recorder.decision(now(number), Ref(0, number & 7, -1), bytes(16), _STATE, context, answer, 2)
