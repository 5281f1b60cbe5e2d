"""Valid and invalid documents in any order and at any moment of a flight: it ends, and its log verifies."""

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from reference.documents import MIN, approval, cancellation, hand, low, recall, replacement
from reference.flat_case import GOTO, INSPECTION, OBSTACLE, M, S, invocation
from reference.world import APPROVAL_KEY, Run, assert_audited, assert_covered, renewed
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Mission, Plan
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Interrupted, LinkBack, LinkLost
from rtshcua.wire.document import DocumentError
from rtshcua.wire.keys import Duty, SigningKey

OF = low()
STRANGER = SigningKey.from_seed(bytes([99]) * 32, duty=Duty.APPROVAL, development=True)
MOMENT = st.integers(0, 80)  # ticks


def other(of: Loaded, work: int) -> Mission:
    """Another mission in place of the one in force: with one more leg, without its inspection, or issued anew."""
    mission = of.bundle.mission
    first, second, *_, last = mission.invocations
    inspection = OF.bundle.mission.invocations[2]
    leg = invocation(2, INSPECTION, GOTO, Plan(MotionKind.FLY, (0, 0), 8 * M, 0), 0, 0, 8 * M)
    middle = [(), (leg,), (inspection,), (leg, replace(inspection, step=3)), (inspection, replace(leg, step=3))][work]
    steps = (first, second, *middle, replace(last, step=2 + len(middle)))
    return replace(mission, issued_at_us=mission.issued_at_us + 1, invocations=steps)


class Hands:
    """Presents documents, and keeps them to replay them."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.papers: list[bytes] = []

    def act(self, what: str, number: int) -> None:
        run, of, now = self.run, self.run.loaded, self.run.clock.now()
        steps = of.bundle.mission.invocations
        match what:
            case "approve" | "refuse":
                key = STRANGER if number == 4 else APPROVAL_KEY
                self.paper(approval(of, number % len(steps), key, now, granted=int(what == "approve")))
            case "approve briefly":
                self.paper(approval(of, 2 % len(steps), now=now, expires_at_us=now.utc_us + number * S + 50_000))
            case "replace":
                try:
                    self.paper(replacement(of, number, other(of, number)))
                except DocumentError:
                    return
            case "replace late":
                lengthen(self, of, number)
            case "recall":
                self.paper(recall(of, now=now, expires_at_us=now.utc_us + MIN))
            case "cancel":
                self.paper(cancellation(of, now=now))
            case "again" if self.papers:
                hand(run, self.papers[number % len(self.papers)])
            case "damaged" if self.papers:
                paper = bytearray(self.papers[number % len(self.papers)])
                paper[-1 - number] ^= 1
                hand(run, bytes(paper))
            case "blind" if not run.ending:
                run.vehicle.values[OBSTACLE] = None
            case "see":
                run.vehicle.values[OBSTACLE] = 20 * M
            case "lose":
                run.tick(LinkLost(0))
            case "find":
                run.tick(LinkBack(0))
            case "stop" if number == 0:
                run.tick(Interrupted(0))

    def paper(self, document: bytes) -> None:
        self.papers.append(document)
        hand(self.run, document)


def lengthen(hands: Hands, of: Loaded, number: int) -> None:
    """A replacement that keeps the steps of the flight, and adds a leg before the way home."""
    steps = of.bundle.mission.invocations
    plan = Plan(MotionKind.FLY, (0, 0), 8 * M, 0)
    leg = invocation(len(steps) - 1, INSPECTION, GOTO, plan, 0, 0, 8 * M)
    longer = (*steps[:-1], leg, replace(steps[-1], step=len(steps)))
    try:
        mission = replace(of.bundle.mission, invocations=longer)
        hands.paper(replacement(of, max(len(steps) - 1 - number % 2, 0), mission))
    except DocumentError:
        return


ACTS = st.sampled_from(
    ["approve", "approve", "approve briefly", "refuse", "replace", "replace", "replace late", "recall", "cancel",
     "again", "again", "damaged", "blind", "see", "lose", "find", "stop"]
)  # fmt: skip


def fly(acts: list[tuple[int, str, int]]) -> Run:
    run = Run(renewed(OF))
    hands = Hands(run)
    for wait, what, number in acts:
        for _ in range(wait):
            if run.ending is None:
                run.tick()
        if run.ending is not None:
            break
        hands.act(what, number)
    run.vehicle.values[OBSTACLE] = 20 * M
    if run.ending is None:
        run.tick(LinkBack(0))
    run.until_over()
    assert_audited(run)
    assert_covered(run)
    return run


STORIES = st.lists(st.tuples(MOMENT, ACTS, st.integers(0, 4)), max_size=8)


@pytest.mark.claim("C1")
@settings(max_examples=settings().max_examples * 2 // 5)
@given(STORIES)
def test_any_document_sequence_ends_with_valid_log(acts: list[tuple[int, str, int]]) -> None:
    fly(acts)


@pytest.mark.claim("C1")
@pytest.mark.soak
@settings(max_examples=3_000, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(STORIES)
def test_many_document_sequences_end_with_valid_logs(acts: list[tuple[int, str, int]]) -> None:
    fly(acts)
