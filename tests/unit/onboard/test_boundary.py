"""The boundary's answers to requests for links, and what they name."""

from msgspec.structs import replace

from reference.flat_case import BATTERY, HOVER, INVOCATIONS, MISSION, OBSTACLE, POLICY, RULES, M
from reference.world import START, FakeVehicle, Run, allowed, answer_to, loaded, request_for
from rtshcua.model.decision import Decision
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.policy import Airspace
from rtshcua.model.flat.situation import State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.executor import LAPSED
from rtshcua.wire.permit import LINK_VALID_US
from rtshcua.wire.request import DEGRADE
from rtshcua.wire.response import Status, shared_clauses


def state(**values: int | None) -> State:
    slots = {"battery": BATTERY, "obstacle": OBSTACLE}
    telemetry = FakeVehicle().values | {slots[name]: value for name, value in values.items()}
    return State(tuple(telemetry[slot] for slot in range(len(telemetry))), (0,) * len(telemetry))


def test_a_degrade_target_is_admitted_while_its_rule_matches() -> None:
    of = loaded()
    allowed(of)
    no = answer_to(of, request_for(of, 1, 0, -1))
    assert isinstance(no, Decision)
    assert (no.outcome, no.reason, no.permit) == (Outcome.FALLBACK, Reason.STATE_VIOLATED, b"")
    low = answer_to(of, request_for(of, 1, 0, -1, state=state(battery=2_000)))
    assert isinstance(low, Decision)
    assert (low.outcome, low.valid_until_us) == (Outcome.ALLOW, START.monotonic_us + LINK_VALID_US)
    assert low.permit


def test_a_refusal_names_its_target_and_its_clause() -> None:
    of = loaded()
    answer = answer_to(of, request_for(of, state=state(battery=2_000)))
    assert isinstance(answer, Decision)
    assert answer.outcome is Outcome.FALLBACK
    assert (answer.link, answer.target) == (DEGRADE, RULES[-1].target), "the degrade rule is the last one"
    assert isinstance(answer.clause, Clause)
    assert answer.clause.text == "battery > 35 %"


def test_the_airspace_has_a_number_if_there_is_one() -> None:
    assert isinstance(shared_clauses(POLICY)[-1], Airspace)
    assert shared_clauses(replace(POLICY, airspace=None)) == POLICY.rules


def test_a_step_outside_the_airspace_names_it() -> None:
    far = INVOCATIONS[1]
    away = (900 * M, 0)
    step = replace(far, arguments=(*away, far.arguments[2]), plan=replace(far.plan, path=away))
    run = Run(loaded(mission=replace(MISSION, invocations=(INVOCATIONS[0], step)))).until_over()
    record = next(r for r in run.records if r["type"] == "decision" and r["outcome"] == "fallback")
    assert (record["reason"], record["clause"]) == ("safety/airspace", "airspace inside city outside school")


def test_the_contingency_may_be_asked_for_before_any_step() -> None:
    of = loaded()
    assert allowed(of, 2, -1, 2)


def test_a_permit_for_a_link_of_an_earlier_step_lapses_with_the_next() -> None:
    of = loaded()
    allowed(of)
    link = allowed(of, 1, 0, 0)
    of.executor.dispatch(allowed(of, step=1), START.monotonic_us)
    assert of.executor.dispatch(link, START.monotonic_us) is LAPSED


def test_contingency_without_hold_keeps_deferred_vehicle() -> None:
    policy = replace(POLICY, contingency=tuple(link for link in POLICY.contingency if link.skill != HOVER))
    run = Run(loaded(policy)).until_flies("goto")
    run.vehicle.values[OBSTACLE] = None
    run.until(lambda run: (0, 2, -1, "defer", "state/unknown") in run.decisions)
    run.tick()
    run.vehicle.values[OBSTACLE] = 20 * M
    run.until_over()
    assert run.flown == ["takeoff", "goto", "inspect_area", "return_home"]


def test_a_release_that_is_still_to_come_is_refused() -> None:
    of = loaded()
    assert answer_to(of, request_for(of, released_us=START.monotonic_us + 1)) is Status.MALFORMED
    allowed(of)


def test_a_release_before_the_bundle_was_received_is_refused() -> None:
    of = loaded()
    assert answer_to(of, request_for(of, released_us=START.monotonic_us - 1)) is Status.MALFORMED
    allowed(of)


def test_time_that_goes_back_is_refused() -> None:
    of = loaded()
    allowed(of)
    earlier = replace(START, monotonic_us=START.monotonic_us - 1)
    assert answer_to(of, request_for(of, 1, 0, 0, now=earlier, released_us=0)) is Status.MALFORMED
    assert allowed(of, 1, 0, 0)
