"""A mission whose inspection needs a supervisor's approval, and documents for flights in the world of `world`."""

from typing import Any

from msgspec.structs import replace

from reference.flat_case import BRIDGE, DEPARTURE, GOTO, INSPECT, INSPECTION, MISSION, PATH, TAKEOFF, M, S, invocation
from reference.world import APPROVAL_KEY, MISSION_KEY, START, VEHICLE, Run, answer_to, loaded, request_for
from rtshcua.model.decision import Decision
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Mission, Plan
from rtshcua.model.flat.situation import Now
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Presented, Reply
from rtshcua.wire.approval import ApprovalDocument, sign_approval
from rtshcua.wire.cancellation import CancellationDocument, sign_cancellation
from rtshcua.wire.keys import SigningKey
from rtshcua.wire.recall import RecallDocument, sign_recall
from rtshcua.wire.receipt import Receipt, decode
from rtshcua.wire.replacement import sign_replacement

MIN = 60 * S
LOW = 8 * M
#: the step that needs the supervisor's approval
ASKED = 2


def low_mission() -> Mission:
    """Return the mission with a low inspection, which must be confirmed."""
    first = invocation(0, DEPARTURE, TAKEOFF, Plan(MotionKind.CLIMB, (), LOW, 0), LOW)
    last = MISSION.invocations[-1]
    goto = invocation(1, INSPECTION, GOTO, Plan(MotionKind.FLY, PATH[:2], LOW, 0), *PATH[:2], LOW)
    inspect = invocation(ASKED, INSPECTION, INSPECT, Plan(MotionKind.COVER, PATH, LOW, 4 * M), BRIDGE, LOW, 0, 4 * M)
    return replace(MISSION, invocations=(first, goto, inspect, last))


def low() -> Loaded:
    """Load that mission."""
    return loaded(mission=low_mission())


def approval(of: Loaded, step: int = ASKED, key: SigningKey = APPROVAL_KEY, now: Now = START, **changed: Any) -> bytes:
    """Return the supervisor's signed approval of a step, with fields `changed`."""
    invocations = of.bundle.mission.invocations
    said = ApprovalDocument(
        flight=of.in_force.flight,
        mission=of.bundle.mission_digest,
        invocation_id=invocations[step].invocation_id,
        binding=invocations[step].binding,
        vehicle=VEHICLE,
        role="supervisor",
        granted=1,
        issued_at_us=now.utc_us,
        expires_at_us=now.utc_us + 5 * MIN,
    )
    return sign_approval(replace(said, **changed), key)


def recall(of: Loaded, key: SigningKey = APPROVAL_KEY, now: Now = START, **changed: Any) -> bytes:
    """Return a signed recall of the mission, with fields `changed`."""
    said = RecallDocument(VEHICLE, of.in_force.flight, of.bundle.mission_digest, b"", now.utc_us, now.utc_us + MIN)
    return sign_recall(replace(said, **changed), key)


def cancellation(of: Loaded, key: SigningKey = MISSION_KEY, now: Now = START, **changed: Any) -> bytes:
    """Return a signed cancellation of the mission, with fields `changed`."""
    said = CancellationDocument(of.in_force.flight, of.bundle.mission_digest, now.utc_us, now.utc_us + MIN)
    return sign_cancellation(replace(said, **changed), key)


def shorter(of: Loaded) -> Mission:
    """Return the mission without its inspection."""
    mission = of.bundle.mission
    first, second, _, last = mission.invocations
    return replace(mission, issued_at_us=mission.issued_at_us + S, invocations=(first, second, replace(last, step=2)))


def large(of: Loaded, steps: int = 60) -> bytes:
    """Return a signed replacement of many steps, all copies of the low mission's second step."""
    mission = of.bundle.mission
    first, second, _, last = mission.invocations
    more = [replace(second, step=number, invocation_id=number.to_bytes(16)) for number in range(2, steps)]
    ends = replace(last, step=steps, invocation_id=steps.to_bytes(16))
    anew = replace(mission, issued_at_us=mission.issued_at_us + 1, invocations=(first, second, *more, ends))
    return replacement(of, 2, anew)


def replacement(of: Loaded, kept: int = 2, mission: Mission | None = None, key: SigningKey = MISSION_KEY) -> bytes:
    """Return a signed replacement, by default by the mission without its inspection."""
    return sign_replacement(mission or shorter(of), over=of.bundle, flight=of.in_force.flight, kept=kept, key=key)


def presented(of: Loaded, document: bytes, now: Now = START, released: int = 0) -> Receipt:
    """Return the answer of the boundary to a document."""
    receipt = decode(of.boundary.present(document, now, released))
    assert isinstance(receipt, Receipt)
    return receipt


def hand(run: Run, document: bytes, sender: int = 1) -> str:
    """Pass a document to a run and return the slug of the answer, or `over` if the run had just ended."""
    replies = [action for action in run.tick(Presented(0, document, sender)) if isinstance(action, Reply)]
    assert [reply.sender for reply in replies] == ([sender] if replies else [])
    assert replies or run.ending is not None
    return replies[0].slug if replies else "over"


def asked(of: Loaded) -> tuple[Outcome, Reason]:
    """Return outcome and reason of the decision on the step that needs the supervisor's approval."""
    answer = answer_to(of, request_for(of, step=ASKED))
    assert isinstance(answer, Decision)
    return answer.outcome, answer.reason
