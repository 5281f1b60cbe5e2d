"""A short log of one flight, written by the recorder itself."""

from collections.abc import Callable

import pytest

from rtshcua.evidence.log_writer import Recorder
from rtshcua.model.decision import Decision
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.situation import ConfirmAnswer, Context, Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.request import Ref

BOOT = bytes(range(16))


@pytest.fixture
def log_key() -> SigningKey:
    return SigningKey.from_seed(bytes(32), duty=Duty.LOG, development=True)


@pytest.fixture
def now() -> Callable[[int], Now]:
    """The moment a number of milliseconds after the start."""
    return lambda ms: Now(5_000_000 + ms * 1000, 1_750_000_000_000_000 + ms * 1000, 2_000)


@pytest.fixture
def recorder(log_key: SigningKey) -> Recorder:
    seeds = iter(range(1, 256))
    return Recorder(lambda text: log_key.sign(text, duty=Duty.LOG), log_key.public, lambda: bytes([next(seeds)]) * 32)


@pytest.fixture
def begin(recorder: Recorder, now: Callable[[int], Now]) -> Callable[[], bytes]:
    return lambda: recorder.genesis(
        now(0), bundle=b"bundle", root=b"root", boot=BOOT, vehicle="quad 07+é", mission="short", mode="software"
    )


@pytest.fixture
def decide(recorder: Recorder, now: Callable[[int], Now]) -> Callable[..., bytes]:
    """Records an allow of step 0 after some milliseconds; any field can be given."""

    def decide(ms: int, **fields: object) -> bytes:
        given: dict[str, object] = {
            "ref": Ref(0, 0, -1),
            "invocation": bytes(16),
            "state": State((35_000, None, -3), (1_200, 0, 50)),
            "context": Context(bytes(32), "quad-07", 7, 0, 5_000_000, 1, 12_000, (ConfirmAnswer(2, 0, 1, 4_999_999),)),
            "decided": Decision(Outcome.ALLOW, Reason.ADMITTED, 8, None, None, None, 6_000_000),
        }
        return recorder.decision(now(ms), **(given | fields))  # type: ignore[arg-type]

    return decide


@pytest.fixture
def log(
    recorder: Recorder, begin: Callable[[], bytes], decide: Callable[..., bytes], now: Callable[[int], Now]
) -> list[bytes]:
    """Genesis, two decisions, two effects, a seal, an empty epoch's seal, an effect, close."""
    clause, link = Clause('battery > 35 % "ß"', 0, 10, 24, ()), Link(0, (), 0, "hover for 20 s", 0, 0, 0)
    refused = Decision(Outcome.FALLBACK, Reason.STATE_VIOLATED, 6, clause, 0, link, 6_000_000)
    return [
        begin(),
        decide(10),
        recorder.effect(now(11), "dispatched", Ref(0, 0, -1), token=1),
        decide(12, ref=Ref(0, 1, -1), decided=refused),
        recorder.effect(now(13), "failed", Ref(0, 0, -1), token=1, detail="PreArm: \ud800 \x1b[31m\n"),
        recorder.seal(now(14)),
        recorder.seal(now(15)),
        recorder.effect(now(16), "landed", durability=2),
        recorder.close(now(20), ending="aborted", tlog=bytes(32)),
    ]
