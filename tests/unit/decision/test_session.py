"""The rules of a session, by hand: turns, used ids, and decisions about links."""

from dataclasses import replace as with_fields
from typing import Any

import pytest
from msgspec.structs import replace

from reference import documents, world
from reference import flat_case as flat
from reference.flat_case import BATTERY, FIX, HOME, HOVER, LAND, NOW, S
from rtshcua.decision.session import InForce, Session
from rtshcua.model.decision import Decision
from rtshcua.model.flat.mission import OnInadmissible
from rtshcua.model.flat.situation import Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.wire.permit import LINK_VALID_US
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP, Ref
from rtshcua.wire.response import Status
from virtual.rows import rows

LOADED = world.loaded()
ALLOW, DENY, DEFER, FALLBACK = Outcome.ALLOW, Outcome.DENY, Outcome.DEFER, Outcome.FALLBACK
UNKNOWN_STEP, NOT_CURRENT = Status.UNKNOWN_STEP, Status.NOT_CURRENT
DEGRADE = -1
AT_US = NOW.monotonic_us


class Asked:
    """A session with requests by hand. Each step is released when it is requested, at the bridge."""

    def __init__(self, of: Loaded = LOADED, *, enforced: bool = True) -> None:
        self.in_force = InForce(of.bundle, of.policy, of.invocations, world.ROOT, world.VEHICLE, world.FLIGHT, 0)
        self.session = Session(self.in_force, enforced=enforced)

    def step(self, step: int, values: dict[int, int | None] | None = None, **context: Any) -> Outcome:
        assert self.session.refusal(Ref(STEP, step, -1)) is None
        invocation = self.in_force.invocations[step].invocation
        told = {
            "consumed": self.session.consumed(step),
            "phase": invocation.phase,
            "approvals": self.in_force.approvals(invocation, NOW),
        }
        given = flat.context(invocation, **(told | context))
        return self.session.decide_step(step, at(step, values), given, NOW).outcome

    def link(self, ref: Ref, values: dict[int, int | None] | None = None, *, binding: bytes | None = None) -> Decision:
        assert self.session.refusal(ref) is None
        if binding is None:
            contingency = ref.kind == CONTINGENCY_LINK
            bundle, invocations = self.in_force.bundle, self.in_force.invocations
            binding = bundle.policy_digest if contingency else invocations[ref.step].invocation.binding
        return self.session.decide_link(ref, binding, flat.state(values), NOW)

    def turns(self) -> list[int]:
        """The steps that may be requested."""
        steps = range(-2, len(self.in_force.invocations) + 2)
        return [step for step in steps if self.session.refusal(Ref(STEP, step, -1)) is None]

    def used(self) -> list[int]:
        """The steps whose ids are used up."""
        return [step for step in range(len(self.in_force.invocations)) if self.session.consumed(step)]


def at(step: int, values: dict[int, int | None] | None) -> State:
    """The state in which an honest runtime requests a step: on the ground for the first, else at the bridge."""
    ground: dict[int, int | None] = {flat.HEIGHT: 0, flat.POSITION_X: 0, flat.POSITION_Y: 0} if step == 0 else {}
    return flat.state(ground | (values or {}))


def with_mission(on_inadmissible: int) -> Loaded:
    """The mission with this reaction of each step that is not admitted."""
    steps = tuple(replace(each, on_inadmissible=on_inadmissible) for each in flat.INVOCATIONS)
    return world.loaded(mission=replace(flat.MISSION, invocations=steps))


# ------------------------------------------------------------------------------------------- turns


@pytest.mark.parametrize(
    ("asked", "turns", "used", "current"),
    [
        ((), [0], [], 0),
        ((0,), [0, 1], [0], 0),
        ((0, 1), [0, 1, 2], [0, 1], 1),
        ((0, 0), [0, 1], [0], 0),  # a replay moves nothing
        ((0, 1, 0), [0, 1, 2], [0, 1], 1),
    ],
)
def test_steps_have_their_turns_in_order(
    asked: tuple[int, ...], turns: list[int], used: list[int], current: int
) -> None:
    of = Asked()
    for step in asked:
        of.step(step)
    assert (of.turns(), of.used(), of.session.current) == (turns, used, current)


BINDING, EMPTY = {"binding": bytes(32)}, {BATTERY: None}
LATE = {"released_us": AT_US - flat.INVOCATIONS[0].contract.deadline_us - S}


@pytest.mark.parametrize(
    ("on_inadmissible", "values", "context", "outcome", "turns", "used"),
    [
        (OnInadmissible.ABORT, {}, {}, ALLOW, [0, 1], [0]),
        (OnInadmissible.ABORT, {}, BINDING, DENY, [0], []),  # a forged request uses no id
        (OnInadmissible.ABORT, EMPTY, {}, DEFER, [0, 1], []),
        (OnInadmissible.ABORT, {BATTERY: 2_000}, {}, FALLBACK, [0, 1], [0]),
        (OnInadmissible.SKIP, {BATTERY: 2_000}, {}, FALLBACK, [0, 1], [0]),
        (OnInadmissible.HOLD, {BATTERY: 2_000}, {}, FALLBACK, [0, 1], []),
        (OnInadmissible.HOLD, {}, LATE, FALLBACK, [0, 1], [0]),  # not after its deadline
        (OnInadmissible.REPLAN, {BATTERY: 2_000}, {}, FALLBACK, [0, 1], []),
        (OnInadmissible.REPLAN, {}, LATE, FALLBACK, [0, 1], [0]),
    ],
)
def test_outcomes_that_use_an_id(
    on_inadmissible: int,
    values: dict[int, int | None],
    context: dict[str, Any],
    outcome: Outcome,
    turns: list[int],
    used: list[int],
) -> None:
    of = Asked(with_mission(on_inadmissible))
    assert of.step(0, values, **context) is outcome
    assert (of.turns(), of.used()) == (turns, used)


@rows(
    ("asked", "step", "given", "turns", "used"),
    [
        ((), 0, False, [0], []),  # nothing was admitted
        ((0,), 0, True, [0, 1], []),
        ((0,), 1, False, [0, 1], [0]),
        ((0,), -1, False, [0, 1], [0]),
        ((0, 1), 1, True, [0, 1, 2], [0]),
        ((0, 1), 0, False, [0, 1, 2], [0, 1]),  # its turn is over
        ((0, 1, 0), 1, True, [0, 1, 2], [0]),  # a replay changes nothing
    ],
)
def test_the_id_of_the_last_step_is_given_back(
    asked: tuple[int, ...], step: int, given: bool, turns: list[int], used: list[int]
) -> None:
    of = Asked()
    for each in asked:
        of.step(each)
    assert of.session.give_back(step) is given
    assert not of.session.give_back(step), "once"
    assert (of.turns(), of.used()) == (turns, used)
    if given:
        assert of.step(step) is ALLOW


def test_a_step_that_only_waits_has_no_id_to_be_given_back() -> None:
    of = Asked()
    assert of.step(0, EMPTY) is DEFER
    assert not of.session.give_back(0)


def test_a_step_that_was_given_back_is_not_admitted_after_its_deadline() -> None:
    of = Asked()
    of.step(0)
    assert of.session.give_back(0)
    assert of.step(0, **LATE) is FALLBACK
    assert of.used() == [0]


def test_skipped_step_has_no_turn() -> None:
    of = Asked()
    assert of.step(0, {BATTERY: None}) is DEFER
    of.step(1)
    assert of.turns() == [1, 2]


def test_denied_step_is_current_in_mode_none() -> None:
    of = Asked(enforced=False)
    assert of.step(0, **BINDING) is DENY
    assert (of.turns(), of.used()) == ([0, 1], [])


# ------------------------------------------------------------------------------------------- links


@rows(
    ("ref", "before", "during", "after"),
    [
        (Ref(STEP, 0, 0), UNKNOWN_STEP, UNKNOWN_STEP, UNKNOWN_STEP),
        (Ref(STEP, -1, -1), UNKNOWN_STEP, UNKNOWN_STEP, UNKNOWN_STEP),
        (Ref(STEP, 4, -1), UNKNOWN_STEP, UNKNOWN_STEP, UNKNOWN_STEP),
        (Ref(3, 0, -1), UNKNOWN_STEP, UNKNOWN_STEP, UNKNOWN_STEP),
        (Ref(FALLBACK_LINK, 0, 0), NOT_CURRENT, None, NOT_CURRENT),
        (Ref(FALLBACK_LINK, 0, DEGRADE), NOT_CURRENT, None, NOT_CURRENT),
        (Ref(FALLBACK_LINK, 0, DEGRADE - 1), UNKNOWN_STEP, UNKNOWN_STEP, UNKNOWN_STEP),
        (Ref(FALLBACK_LINK, 0, 9), UNKNOWN_STEP, UNKNOWN_STEP, UNKNOWN_STEP),
        (Ref(FALLBACK_LINK, 1, 0), NOT_CURRENT, NOT_CURRENT, None),
        (Ref(FALLBACK_LINK, -1, 0), UNKNOWN_STEP, UNKNOWN_STEP, UNKNOWN_STEP),
        (Ref(FALLBACK_LINK, 4, 0), UNKNOWN_STEP, UNKNOWN_STEP, UNKNOWN_STEP),
        (Ref(CONTINGENCY_LINK, -1, 0), None, None, None),
        (Ref(CONTINGENCY_LINK, -1, 2), None, None, None),
        (Ref(CONTINGENCY_LINK, -1, 3), UNKNOWN_STEP, UNKNOWN_STEP, UNKNOWN_STEP),
        (Ref(CONTINGENCY_LINK, -1, -1), UNKNOWN_STEP, UNKNOWN_STEP, UNKNOWN_STEP),
        (Ref(CONTINGENCY_LINK, 0, 0), UNKNOWN_STEP, UNKNOWN_STEP, UNKNOWN_STEP),
    ],
)
def test_requests_allowed_before_during_and_after_step(
    ref: Ref, before: Status | None, during: Status | None, after: Status | None
) -> None:
    of = Asked()
    assert of.session.refusal(ref) is before
    of.step(0)
    assert of.session.refusal(ref) is during
    of.step(1)
    assert of.session.refusal(ref) is after


@pytest.mark.parametrize("outcome", [DEFER, FALLBACK, DENY, ALLOW])
def test_running_step_keeps_its_links_until_a_later_one_is_admitted(outcome: Outcome) -> None:
    of = Asked()
    of.step(0)
    assert of.step(1) is ALLOW
    values = {DEFER: {flat.OBSTACLE: None}, FALLBACK: {flat.OBSTACLE: 1}}.get(outcome, {})
    assert of.step(2, values, **(BINDING if outcome is DENY else {})) is outcome
    for link in (DEGRADE, 0):
        assert of.session.refusal(Ref(FALLBACK_LINK, 0, link)) is NOT_CURRENT, "it is over"
        assert of.session.refusal(Ref(FALLBACK_LINK, 1, link)) is (NOT_CURRENT if outcome is ALLOW else None)
        assert of.session.refusal(Ref(FALLBACK_LINK, 2, link)) is (NOT_CURRENT if outcome is DENY else None)


@rows(
    ("ref", "values", "skill"),
    [
        (Ref(FALLBACK_LINK, 2, 0), {}, HOVER),
        (Ref(FALLBACK_LINK, 2, 1), {}, HOME),
        (Ref(FALLBACK_LINK, 2, 1), {FIX: 2}, None),
        (Ref(FALLBACK_LINK, 2, 2), {FIX: None}, LAND),
        (Ref(FALLBACK_LINK, 2, DEGRADE), {}, None),  # no rule degrades
        (Ref(FALLBACK_LINK, 2, DEGRADE), {BATTERY: 2_000}, HOME),
        (Ref(FALLBACK_LINK, 2, DEGRADE), {BATTERY: 2_000, FIX: 2}, None),  # one does, and its target may not fly
        (Ref(CONTINGENCY_LINK, -1, 0), {}, HOVER),
        (Ref(CONTINGENCY_LINK, -1, 0), {FIX: 2}, None),
        (Ref(CONTINGENCY_LINK, -1, 2), {FIX: 2}, LAND),
    ],
)
def test_links_fly_only_when_admitted(ref: Ref, values: dict[int, int | None], skill: int | None) -> None:
    of = Asked()
    for step in range(3):
        of.step(step)
    decision = of.link(ref, values)
    if skill is None:
        assert decision == Decision(FALLBACK, Reason.STATE_VIOLATED, 6, None, None, None, AT_US)
    else:
        assert decision.target is not None
        assert decision.target.skill == skill
        assert decision == Decision(ALLOW, Reason.ADMITTED, 8, None, None, decision.target, AT_US + LINK_VALID_US)


@pytest.mark.altered
def test_no_target_without_rule_or_link() -> None:
    """The chain ends with a landing that needs nothing; without it, every link needs a fix."""
    of = Asked()
    of.in_force.invocations = tuple(with_fields(each, chain=each.chain[:2]) for each in of.in_force.invocations)
    for step in range(3):
        of.step(step)
    assert of.link(Ref(FALLBACK_LINK, 2, DEGRADE), {FIX: 2}).outcome is FALLBACK


@rows("ref", [Ref(FALLBACK_LINK, 0, 0), Ref(FALLBACK_LINK, 0, DEGRADE), Ref(CONTINGENCY_LINK, -1, 0)])
@rows("values", [{}, {FIX: 2}])
def test_a_link_under_another_binding_is_denied(ref: Ref, values: dict[int, int | None]) -> None:
    of = Asked()
    of.step(0)
    decision = of.link(ref, values, binding=bytes(32))
    assert decision == Decision(DENY, Reason.BINDING_MISMATCH, 1, None, None, None, AT_US)


def test_the_binding_of_a_link_is_that_of_its_own_chain() -> None:
    of = Asked()
    of.step(0)
    policy, step = of.in_force.bundle.policy_digest, of.in_force.invocations[0].invocation.binding
    assert of.link(Ref(FALLBACK_LINK, 0, 0), binding=policy).outcome is DENY
    assert of.link(Ref(CONTINGENCY_LINK, -1, 0), binding=step).outcome is DENY


# ------------------------------------------------------------------------------------------- documents


def confirmed(steps: int) -> tuple[Asked, Loaded]:
    """A session in which so many steps of the low mission were requested."""
    of = documents.low()
    asked = Asked(of)
    for step in range(steps):
        asked.step(step)
    return asked, of


def test_recall_ends_turns_of_steps_but_not_of_links() -> None:
    asked, of = confirmed(1)
    assert asked.session.take(documents.recall(of), NOW).accepted
    assert asked.turns() == []
    assert asked.link(Ref(FALLBACK_LINK, 0, 0)).outcome is ALLOW
    assert asked.link(Ref(CONTINGENCY_LINK, -1, 0)).outcome is ALLOW


@pytest.mark.parametrize("steps", [0, 1, 2, 3])
def test_approval_of_waiting_step_is_used(steps: int) -> None:
    asked, of = confirmed(steps)
    assert asked.session.take(documents.approval(of), NOW).accepted


def test_approval_of_decided_step_is_too_late() -> None:
    asked, of = confirmed(2)
    assert asked.session.take(documents.approval(of), NOW).accepted
    assert asked.step(documents.ASKED, {flat.HEIGHT: documents.LOW}) is ALLOW
    refused = documents.approval(of, now=later(S))
    assert asked.session.take(refused, later(S)).slug == "already-decided"


def later(us: int) -> Now:
    return Now(NOW.monotonic_us + us, NOW.utc_us + us, NOW.utc_error_us)


@pytest.mark.parametrize(
    ("steps", "released", "slug"),
    [
        (0, 0, "accepted"),
        (2, 0, "accepted"),
        (3, 0, "already-released"),
        (0, 2, "accepted"),
        (2, 3, "already-released"),
    ],
)
def test_a_replacement_keeps_what_was_released_or_asked_for(steps: int, released: int, slug: str) -> None:
    asked, of = confirmed(steps)
    assert asked.session.take(documents.replacement(of), NOW, released).slug == slug


@pytest.mark.parametrize(
    ("on_inadmissible", "values", "context", "slug"),
    [
        (OnInadmissible.REPLAN, {BATTERY: 2_000}, {}, "accepted"),
        (OnInadmissible.REPLAN, EMPTY, {}, "accepted"),  # deferred
        (OnInadmissible.REPLAN, {}, {}, "already-released"),  # it was permitted
        (OnInadmissible.REPLAN, {}, LATE, "already-released"),  # its fallback flies
        (OnInadmissible.REPLAN, {}, BINDING, "accepted"),  # a forged request
        (OnInadmissible.HOLD, {BATTERY: 2_000}, {}, "already-released"),
        (OnInadmissible.SKIP, {BATTERY: 2_000}, {}, "already-released"),
    ],
)
def test_step_is_replaced_only_while_awaiting_replacement(
    on_inadmissible: int, values: dict[int, int | None], context: dict[str, Any], slug: str
) -> None:
    of = with_mission(on_inadmissible)
    asked = Asked(of)
    asked.step(0, values, **context)
    anew = replace(of.bundle.mission, issued_at_us=of.bundle.mission.issued_at_us + 1)
    assert asked.session.take(documents.replacement(of, 0, anew), NOW).slug == slug
    if slug == "accepted":
        assert (asked.turns()[:1], asked.used()) == ([0], [])
        assert asked.step(0) is ALLOW


def test_a_step_that_was_given_back_may_be_replaced() -> None:
    of = with_mission(OnInadmissible.REPLAN)
    asked = Asked(of)
    asked.step(0)
    anew = replace(of.bundle.mission, issued_at_us=of.bundle.mission.issued_at_us + 1)
    paper = documents.replacement(of, 0, anew)
    assert asked.session.take(paper, NOW).slug == "already-released"
    assert asked.session.give_back(0)
    assert asked.session.take(paper, NOW).slug == "accepted"


def test_verified_ahead_replacement_reports_misfit() -> None:
    asked, of = confirmed(0)
    in_force, fits, late = asked.in_force, documents.replacement(of), documents.replacement(of, 1)
    other = documents.replacement(of, mission=replace(documents.shorter(of), name="another"))
    forged = fits[:-1] + bytes([fits[-1] ^ 1])
    assert (in_force.considered(fits), in_force.misfit(fits, 0)) == (None, None), "it was not considered"
    assert [in_force.consider(each, NOW) is None for each in (fits, late, other, forged)] == [True, True, True, False]
    after = in_force.considered(fits)
    assert after is not None
    assert len(after.mission.invocations) == 3
    assert (in_force.considered(forged), in_force.misfit(forged, 0), in_force.misfit(fits, 2)) == (None, None, None)
    refused = in_force.misfit(late, 2)
    assert refused is not None
    assert refused.slug == "already-released"
    assert asked.session.take(fits, NOW).accepted
    assert in_force.bundle == after
    superseded = in_force.misfit(other, 0)
    assert superseded is not None
    assert superseded.slug == "superseded"
    assert asked.session.take(documents.recall(of), NOW).accepted
    assert in_force.misfit(other, 0) is None, "the mission was recalled, and that is why"


def test_a_replacement_brings_steps_that_were_never_used() -> None:
    asked, of = confirmed(2)
    assert asked.used() == [0, 1]
    assert asked.session.take(documents.replacement(of), NOW).accepted
    assert (asked.used(), asked.turns(), len(asked.in_force.invocations)) == ([0, 1], [0, 1, 2], 3)


def test_malformed_document_changes_nothing() -> None:
    asked, _ = confirmed(1)
    assert not asked.session.take(b"", NOW, 9).accepted
    assert (asked.turns(), asked.used()) == ([0, 1], [0])
