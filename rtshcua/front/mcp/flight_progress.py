"""How a flight stands in few words: what an agent reads again and again while it follows its mission.

All words are of our vocabulary and of the signed policy: nothing is repeated that a vehicle or a mission says.
"""

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any, Final, NamedTuple

from rtshcua.app.wording import shorten
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.model.step_number import number_of
from rtshcua.onboard.calls import call
from rtshcua.wire.request import STEP

#: effects that report the progress of a flight
TELLING: Final = frozenset(
    {
        "dispatched",
        "succeeded",
        "skipped",
        "replan",
        "violated",
        "failed",
        "time-over",
        "recall",
        "cancellation",
        "superseded",
        "declined",
        "idle",
    }
)
#: an answer without `more` has at most so many characters, and so many changes, which are the latest
MOST_CHARACTERS: Final = 600
MOST_CHANGES: Final = 4
_STEP_SHOWN: Final = 150
_OUTCOMES: Final = frozenset(each.name.lower() for each in Outcome if each is not Outcome.ALLOW)
_REASONS: Final = frozenset(each.value for each in Reason)

_Record = Mapping[str, Any]


class Followed(NamedTuple):
    """A mission that was proposed here, its policy, and the proved longest duration of each step, in us."""

    policy: Policy
    mission: Mission
    steps_us: Sequence[int]


def decision_of(records: Sequence[_Record]) -> _Record | None:
    """Return the latest decision."""
    return next((each for each in reversed(records) if each.get("type") == "decision"), None)


def waits_for(decided: _Record | None, followed: Followed | None, now_us: int) -> dict[str, Any] | None:
    """Return who must approve what until when, if the latest decision is that a step waits for an approval; `now_us` is
    UTC.
    """
    if decided is None or decided.get("reason") != Reason.AWAITING_APPROVAL.value or decided.get("kind") != STEP:
        return None
    step = int(decided["step"])
    told: dict[str, Any] = {"step_number": number_of(step)}
    if followed is None or not 0 <= step < len(followed.mission.invocations):
        return told
    policy = followed.policy
    told["step"] = shorten(call(policy, followed.mission.invocations[step]), _STEP_SHOWN)
    rules = (each for each in policy.rules if each.kind == RuleKind.CONFIRM and each.text == decided.get("clause"))
    rule = next(rules, None)
    if rule is not None:
        told["roles"] = [policy.roles[number] for number in (rule.approver, rule.second) if number >= 0]
        left_us = decided["context"]["released_us"] + rule.within_us - decided["at_us"]
        told["within_s"] = max(0, left_us - max(0, now_us - decided["utc_us"])) // 1_000_000
    return told


def question_of(approval: Mapping[str, Any]) -> str:
    """Return what a host shows its person of a step that waits."""
    roles = " and ".join(f"a person in the role {role}" for role in approval["roles"])
    return (
        f"Step {approval['step_number']} waits for an approval: {approval['step']}. For {approval['within_s']} s more, "
        f"{roles} can sign by `rtshcua approve`. An answer here is no approval: it only closes this message."
    )


def changes(records: Sequence[_Record], since: int) -> tuple[list[str], int]:
    """Return what happened after the record `since`, the latest last, and the number of the latest record."""
    told = [
        f"step {number_of(each['step'])}: {each['event']}" if each.get("step", -1) >= 0 else str(each["event"])
        for each in records
        if each.get("event") in TELLING and each.get("seq", -1) > since
    ]
    left_out = len(told) - MOST_CHANGES
    if left_out > 0:
        told = [f"{left_out} earlier", *told[-MOST_CHANGES:]]
    return told, max(chain([since], (each.get("seq", -1) for each in records)))


def progress(records: Sequence[_Record], followed: Followed) -> dict[str, Any]:
    """Return the step that flies or waits, the next one, and the longest time that is left without what people take."""
    steps = followed.mission.invocations
    begun = [each for each in records if each.get("type") == "decision" and each.get("kind") == STEP]
    at = max((int(each["step"]) for each in begun if 0 <= each["step"] < len(steps)), default=0)
    names = [each.contract.name for each in steps]
    told: dict[str, Any] = {"step": f"{number_of(at)} of {len(steps)}: {names[at]}"}
    if at + 1 < len(steps):
        told["next"] = f"{number_of(at + 1)}: {names[at + 1]}, decided when step {number_of(at)} has ended"
    if len(followed.steps_us) == len(steps):
        flown_us = _flown_us(records, at)
        left_us = sum(followed.steps_us[at + 1 :]) + max(0, followed.steps_us[at] - flown_us)
        told["left_s"] = -(-left_us // 1_000_000)
    return told


def _flown_us(records: Sequence[_Record], step: int) -> int:
    """Return how long a step has flown, by the times of the log: no longer than it has."""
    times = [each["at_us"] for each in records if isinstance(each.get("at_us"), int)]
    allowed = [
        each["at_us"]
        for each in records
        if each.get("type") == "decision" and each.get("step") == step and each.get("outcome") == "allow"
    ]
    return max(0, times[-1] - allowed[0]) if times and allowed else 0


def refused(decided: _Record | None) -> dict[str, Any] | None:
    """Return the latest decision in our vocabulary, if it is one and not `allow`."""
    if decided is None or decided["outcome"] not in _OUTCOMES or decided["reason"] not in _REASONS:
        return None
    told = {"record": decided["seq"], "outcome": decided["outcome"], "reason": decided["reason"]}
    step = decided["step"]
    return told | ({"step_number": number_of(step)} if step >= 0 else {})
