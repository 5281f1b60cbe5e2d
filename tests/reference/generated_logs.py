"""Generated logs of a fleet that never flew, in the real format, with seals and trust.

The contents are random, from a seed: such a log verifies, but its decisions do not follow from their
inputs. Used by bench/archive.py and by tests of the archive.
"""

from collections.abc import Iterator, Sequence
from functools import cache
from hashlib import sha256
from pathlib import Path
from random import Random

from msgspec.structs import replace

from reference import flat_case as flat
from rtshcua.evidence.log_writer import Recorder
from rtshcua.model.decision import Decision
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.wire.keys import Duty
from rtshcua.wire.request import Ref
from virtual import case

ROOT_KEY = case.KEYS[Duty.ROOT].public
LOG_KEY = case.KEYS[Duty.LOG]

#: decisions: frequency, outcome, reason, deciding step, clause
ANSWERS = (
    (900, Outcome.ALLOW, Reason.ADMITTED, 8, None),
    (30, Outcome.DENY, Reason.NOT_PERMITTED, 3, "permit agent to goto when altitude <= 30 m"),
    (20, Outcome.DENY, Reason.AIRSPACE, 7, "stay inside bridge_a"),
    (15, Outcome.DEFER, Reason.STATE_VIOLATED, 6, "wind < 8 m/s"),
    (15, Outcome.DENY, Reason.STATE_VIOLATED, 6, "battery >= 30 %"),
    (10, Outcome.FALLBACK, Reason.ENERGY, 7, "battery at home >= 20 %"),
    (5, Outcome.DENY, Reason.REPLAYED, 2, None),
    (5, Outcome.DENY, Reason.APPROVAL_REFUSED, 3, "confirm pilot before goto within 30 s"),
)
_WEIGHTS = [answer[0] for answer in ANSWERS]
STATE = State((8_700, 20_000, 3, 4_100, 9_000, 110_000, -20_000, None), (12_000, 80_000, 90_000, 400_000, 7, 8, 9, 0))
BEGUN_US = flat.ISSUED + 60_000_000  # the first flight
_STEP_US = 4_000  # between two records


@cache
def bundle(vehicle: str, version: int) -> bytes:
    """The short mission for a vehicle under a version of the policy."""
    shipped = case.policy()
    policy = replace(shipped, version=version, vehicle=replace(shipped.vehicle, identity=vehicle))
    mission = case.mission(case.short_steps())
    return case.seal(replace(mission, vehicle=vehicle, policy_version=version), policy)


@cache
def _root() -> bytes:
    return case.root()[1]


def lines(
    vehicle: str,
    number: int,
    *,
    records: int = 500,
    version: int = 7,
    before: str | None = None,
    ending: str | None = "completed",
) -> Iterator[bytes]:
    """The lines of a vehicle's flight with about `records` records; without `ending` it is not closed."""
    name = f"{vehicle}/{number}/{version}"
    random, drawn = Random(name), sha256(name.encode())

    def draw() -> bytes:
        drawn.update(b"\0")
        return drawn.digest()

    recorder = Recorder(lambda text: LOG_KEY.sign(text, duty=Duty.LOG), LOG_KEY.public, draw)
    start_us, at_us = BEGUN_US + number * 3_600_000_000, 5_000_000
    apart_us = start_us - at_us
    yield recorder.genesis(
        Now(at_us, start_us, 1_000), bundle=bundle(vehicle, version), root=_root(), boot=draw()[:16],
        vehicle=vehicle, mission="inspect_bridge_a", mode="software", before=before,
    )  # fmt: skip
    context = Context(bytes(32), vehicle, version, 0, 123_456_789, 1, 12_000, ())
    invocation, steps = draw()[:16], len(case.short_steps())
    answers: Sequence[tuple[int, Outcome, Reason, int, str | None]] = random.choices(ANSWERS, _WEIGHTS, k=997)
    turn = token = 0
    while recorder.count < records - 1:
        at_us += _STEP_US
        now = Now(at_us, at_us + apart_us, 1_000)
        if recorder.due(now):
            yield recorder.seal(now)
            continue
        turn += 1
        step = turn % steps
        _, outcome, reason, rule_step, clause = answers[turn % 997]
        decisive = None if clause is None else Clause(clause, 0, 120, 160, ())
        answer = Decision(outcome, reason, rule_step, decisive, None, None, at_us + 500_000)
        ref = Ref(0, step, -1)
        yield recorder.decision(now, ref, invocation, STATE, context, answer)
        if outcome is Outcome.ALLOW and turn & 1:
            token += 1
            yield recorder.effect(now, "dispatched", ref, token=token, detail="FLY")
    if ending is not None:
        at_us += _STEP_US
        yield recorder.close(Now(at_us, at_us + apart_us, 1_000), ending=ending, tlog=None)


def write(path: Path, vehicle: str, number: int, **options: object) -> str:
    """Write such a log to a file, and return the hash of its last line."""
    last = b""
    with path.open("wb") as file:
        for line in lines(vehicle, number, **options):  # type: ignore[arg-type]
            file.write(line)
            last = line
    return sha256(b"\0" + last).hexdigest()
