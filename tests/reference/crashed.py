"""Logs of aborted flights, and the properties that a recovered log must have."""

from collections.abc import Iterator
from pathlib import Path
from random import Random

from rtshcua.adapters.store.recovery import LogEnder
from rtshcua.evidence.log_writer import Recorder
from rtshcua.evidence.report import LogVerdict
from rtshcua.evidence.verify import verify
from rtshcua.model.decision import Decision
from rtshcua.model.flat.situation import ConfirmAnswer, Context, Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.request import Ref

LOG_KEY = SigningKey.from_seed(bytes(32), duty=Duty.LOG, development=True)
UTC_US = 1_750_000_000_000_000
_STATE = State(tuple(range(12)), tuple(range(12)))


def certify(text: bytes) -> bytes:
    return LOG_KEY.sign(text, duty=Duty.LOG)


def signer(chance: Random, *, utc_us: int = UTC_US + 86_400_000_000) -> LogEnder:
    """Recovers a day later, after a restart of the machine."""
    return LogEnder(LOG_KEY.public, certify, lambda: chance.randbytes(32), lambda: Now(1_000_000, utc_us, 2_000))


def writes(chance: Random, *, seals: int = 40) -> Iterator[tuple[bytes, int]]:
    """Yield the lines of an endless log, each with its durability; one line in `seals` is a seal."""
    recorder = Recorder(certify, LOG_KEY.public, lambda: chance.randbytes(32))
    at_us = 5_000_000

    def now() -> Now:
        nonlocal at_us
        at_us += chance.randint(0, 2_000)
        return Now(at_us, UTC_US + at_us, 2_000)

    yield (
        recorder.genesis(
            now(), bundle=b"bundle" * 40, root=b"root", boot=chance.randbytes(16), vehicle="quad-07", mission="short",
            mode="software",
        ),
        3,
    )  # fmt: skip
    while True:
        durability = chance.choice((1, 1, 1, 2, 2, 3))
        if chance.random() * seals < 1:
            yield recorder.seal(now()), 3
        elif chance.random() < 0.5:
            yield (
                recorder.effect(now(), "sent", token=1, detail="é" * chance.randint(0, 60), durability=durability),
                durability,
            )
        else:
            yield _decision(recorder, now(), durability), durability


def _decision(recorder: Recorder, now: Now, durability: int) -> bytes:
    context = Context(bytes(32), "quad-07", 7, 0, 5_000_000, 1, 12_000, (ConfirmAnswer(2, 0, 1, 4_999_999),))
    answer = Decision(Outcome.ALLOW, Reason.ADMITTED, 8, None, None, None, 6_000_000)
    return recorder.decision(now, Ref(0, 0, -1), bytes(60), _STATE, context, answer, durability)


def unverified(path: Path, lines: list[bytes], acknowledged: int) -> str:
    """Return the fault of a recovered log of these lines, a number of which were acknowledged; empty if none."""
    data = path.read_bytes()
    report = verify(data.splitlines(keepends=True))
    if report.verdict is not LogVerdict.VERIFIED:
        return f"it does not verify: {report.failure or report.shortfall}"
    kept = 0
    for line, found in zip(lines, data.splitlines(keepends=True), strict=False):
        if line != found:
            break
        kept += 1
    if kept < acknowledged:
        return f"{acknowledged} lines were acknowledged, {kept} are kept"
    return ""
