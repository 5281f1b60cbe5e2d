"""Which step waits for an approver, by the records of a flight: real ones of the runtime, and changed ones."""

from base64 import b64encode
from collections.abc import Iterator, Sequence
from itertools import count
from typing import Any

import pytest
from msgspec.structs import replace

from reference.documents import ASKED, approval, low, recall
from reference.world import APPROVAL_KEY, Run
from rtshcua.app.open_questions import OpenQuestions, asked_roles
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import DecisionRecord, Effect
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.onboard.ports import Presented
from rtshcua.wire.keys import Duty, SigningKey

ADA = ("ada", "supervisor")
BOB_KEY = SigningKey.from_seed(b"\x0b" * 32, duty=Duty.APPROVAL, development=True)
PEOPLE = {APPROVAL_KEY.kid: "ada", BOB_KEY.kid: "bob"}


@pytest.fixture(scope="module")
def of() -> Any:
    return low()


def questions(policy: Policy, approver: tuple[str, str] = ADA) -> OpenQuestions:
    return OpenQuestions(policy, *approver, PEOPLE, count(1))


def followed(run: Run, found: OpenQuestions) -> list[str]:
    """Take all records of a run; the reasons why questions were closed."""
    return taken(found, records(run.lines))


def records(lines: Sequence[bytes]) -> Iterator[DecisionRecord | Effect]:
    for line in lines:
        record = read(line)
        if isinstance(record, DecisionRecord | Effect):
            yield record


def taken(found: OpenQuestions, told: Iterator[DecisionRecord | Effect]) -> list[str]:
    return [why for why in map(found.take, told) if why]


def waiting(of: Any) -> Run:
    run = Run(low())
    while not any(b"approval/awaited" in line for line in run.lines):
        run.tick()
    return run


def awaited(run: Run) -> DecisionRecord:
    """The decision that the step waits."""
    return next(each for each in records(run.lines) if isinstance(each, DecisionRecord) and "awaited" in each.reason)


def test_step_that_waits_for_my_role_is_a_question(of: Any) -> None:
    run, found = waiting(of), questions(of.bundle.policy)
    assert followed(run, found) == []
    asked = found.current
    assert asked is not None
    step = of.bundle.mission.invocations[ASKED]
    assert (asked.number, asked.step, asked.missing) == (1, ASKED, ("supervisor",))
    assert asked.binding == run.loaded.bundle.mission.invocations[ASKED].binding.hex()
    assert len(asked.invocation) == 2 * len(step.invocation_id)
    rule = next(rule for rule in of.bundle.policy.rules if rule.text == asked.rule)
    assert 0 < asked.until_us - awaited(run).at_us <= rule.within_us


def test_nobody_else_is_asked(of: Any) -> None:
    for approver in (("bob", "safety"), ("ada", "operator")):
        found = questions(of.bundle.policy, approver)
        assert followed(waiting(of), found) == []
        assert found.current is None


def test_lapse_and_answers_close_the_question(of: Any) -> None:
    lapsed = questions(of.bundle.policy)
    assert followed(Run(low()).until_over(), lapsed) == ["nobody answered in time, so the step was denied"]
    assert lapsed.current is None
    for granted, why in ((1, "ada approved it as supervisor"), (0, "ada refused it as supervisor")):
        run, found = waiting(of), questions(of.bundle.policy)
        followed(run, found)
        seen = len(run.lines)
        run.step(Presented(run.clock.now().monotonic_us, approval(run.loaded, granted=granted), 1))
        run.until_over()
        assert taken(found, records(run.lines[seen:])) == [why]
        assert found.current is None


def test_recall_closes_the_question(of: Any) -> None:
    run, found = waiting(of), questions(of.bundle.policy)
    followed(run, found)
    seen = len(run.lines)
    run.step(Presented(run.clock.now().monotonic_us, recall(run.loaded), 1))
    run.until_over()
    assert taken(found, records(run.lines[seen:])) == ["overtaken by `recall`"]


def effect(like: DecisionRecord, event: str, step: int = -1, detail: str = "") -> Effect:
    return Effect(like.prev, like.at_us, detail, 1, event, 0, -1, like.seq + 1, step, -1, "effect", 0, like.utc_us)


@pytest.mark.parametrize(
    ("event", "step", "why"),
    [
        ("cancellation", -1, "overtaken by `cancellation`"),
        ("taken-over", -1, "overtaken by `taken-over`"),
        ("crashed", -1, "overtaken by `crashed`"),
        ("replacement", 1, "overtaken by `replacement`"),
        ("replacement", ASKED, "overtaken by `replacement`"),
        ("skipped", ASKED, "overtaken by `skipped`"),
        ("repeated", ASKED, ""),
        ("noted", -1, ""),
        ("succeeded", ASKED - 1, ""),
        ("approval", ASKED, ""),  # of a document that makes no sense
    ],
)
def test_effects_that_close_the_question(of: Any, event: str, step: int, why: str) -> None:
    run, found = waiting(of), questions(of.bundle.policy)
    followed(run, found)
    assert found.take(effect(awaited(run), event, step, "no base64")) == why
    assert (found.current is None) is bool(why)


def test_step_that_a_replacement_keeps_is_a_new_question(of: Any) -> None:
    """An answer names the mission, so an answer to the question before would be refused."""
    run, found = waiting(of), questions(of.bundle.policy)
    followed(run, found)
    before = found.current
    closed = found.take(effect(awaited(run), "replacement", ASKED + 1))
    assert before is not None
    assert closed == "the rest of the mission was replaced"
    assert found.current == before._replace(number=2)


def test_fallback_of_the_step_closes_the_question(of: Any) -> None:
    run, found = waiting(of), questions(of.bundle.policy)
    followed(run, found)
    told = awaited(run)
    assert found.take(replace(told, step=1, outcome="deny", reason="state/unknown")) == ""
    assert found.take(replace(told, kind=2, step=-1, outcome="allow", reason="admitted")) == "", "it holds meanwhile"
    assert found.take(replace(told, kind=1, link=0, outcome="allow", reason="admitted")) == "its fallback flies"


def of_two(policy: Policy, second: str) -> Policy:
    """A policy whose rule asks two people."""
    rules = tuple(
        replace(rule, second=policy.roles.index(second)) if rule.kind == RuleKind.CONFIRM else rule
        for rule in policy.rules
    )
    return replace(policy, rules=rules)


def granted_by(key: SigningKey, run: Run, **changed: int) -> Effect:
    document = approval(run.loaded, key=key, **changed)
    return effect(awaited(run), "approval", ASKED, b64encode(document).decode())


def test_second_of_two_people_is_asked_until_both_agreed(of: Any) -> None:
    policy = of_two(of.bundle.policy, "supervisor")
    run = waiting(of)
    ada, bob = questions(policy), questions(policy, ("bob", "supervisor"))
    for each in (ada, bob):
        followed(run, each)
        assert each.current is not None
        assert each.current.missing == ("supervisor", "supervisor")
    assert ada.take(granted_by(APPROVAL_KEY, run)), "two answers of one person are one"
    assert ada.current is None
    assert bob.take(granted_by(APPROVAL_KEY, run)) == "ada approved it as supervisor"
    assert bob.current is not None
    assert (bob.current.number, bob.current.missing) == (2, ("supervisor",))
    assert bob.take(granted_by(BOB_KEY, run)) == "bob approved it as supervisor"
    assert bob.current is None


def test_answer_that_expired_before_the_turn_of_the_step_does_not_count(of: Any) -> None:
    run, found = waiting(of), questions(of.bundle.policy)
    found.take(granted_by(APPROVAL_KEY, run, expires_at_us=awaited(run).utc_us))
    found.take(awaited(run))
    assert found.current is not None
    valid = questions(of.bundle.policy)
    valid.take(granted_by(APPROVAL_KEY, run, expires_at_us=awaited(run).utc_us + 1))
    valid.take(awaited(run))
    assert valid.current is None


def test_answers_before_the_flight_was_followed_count(of: Any) -> None:
    policy = of_two(of.bundle.policy, "operator")
    run, found = waiting(of), questions(policy)
    told = awaited(run)
    number = next(number for number, rule in enumerate(policy.rules) if rule.text == told.clause)
    role = policy.roles.index("supervisor")
    given = replace(told.context, approvals=((number, role, 1, 0, 7),))
    found.take(replace(told, context=given))
    assert found.current is None, "only the operator is missing"
    none = ((number + 1, role, 1, 0, 7), (number, 99, 1, 0, 7), (number, role, 0, 0, 7))
    found.take(replace(told, context=replace(told.context, approvals=none)))
    assert found.current is not None, "what answers another rule, or has no role, does not count"


def test_unknown_rule_asks_nobody(of: Any) -> None:
    run, found = waiting(of), questions(of.bundle.policy)
    found.take(replace(awaited(run), clause="confirm everything by role supervisor"))
    assert found.current is None


def test_roles_of_rules(of: Any) -> None:
    assert asked_roles(of.bundle.policy) == ("supervisor",)
    assert asked_roles(of_two(of.bundle.policy, "operator")) == ("operator", "supervisor")
