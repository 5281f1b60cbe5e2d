"""Deriving decisions again: on steps, links of a chain and the contingency, with forgeries by the holder of the key."""

from functools import cache

import pytest
from msgspec.structs import replace

from reference.forgery import edit, expect, flight, other_flight, prove, read, signed
from reference.kinds_of_flight import fallen_back
from rtshcua.model.faults import BatteryLevel
from virtual import case
from virtual.flight import Flight
from virtual.rows import rows

M = case.M


@cache
def denied_in_the_air() -> tuple[bytes, ...]:
    """A flight whose inspection is planned too high: it is denied in the air, and the contingency flies."""
    mission = case.mission()
    inspect = mission.invocations[2]
    cells = (inspect.arguments[0], 35 * M, *inspect.arguments[2:])
    changed = replace(inspect, arguments=cells, plan=replace(inspect.plan, altitude=35 * M))
    steps = (*mission.invocations[:2], changed, *mission.invocations[3:])
    return tuple(
        Flight(case.seal(replace(mission, invocations=steps)), case.simulated("px4"), attested=False).fly().lines
    )


def decisions(lines: tuple[bytes, ...], kind: int) -> list[int]:
    return [n for n, each in enumerate(map(read, lines)) if each["type"] == "decision" and each["kind"] == kind]


def forged(lines: tuple[bytes, ...], number: int, **fields: object) -> tuple[str, int]:
    return expect(signed([*lines[:number], edit(lines[number], **fields), *lines[number + 1 :]]))


@pytest.mark.slow
def test_decision_on_the_contingency_is_derived_again() -> None:
    lines = denied_in_the_air()
    assert decisions(lines, 2)
    assert prove(lines).report.failure is None


@rows(
    ("fields", "slug"),
    [
        ({"outcome": "fallback"}, "decision/outcome"),
        ({"link": 9}, "decision/unknown-step"),
        ({"link": -1}, "decision/unknown-step"),
        ({"step": 0}, "decision/unknown-step"),
        ({"invocation": "00" * 16}, "decision/invocation"),
        ({"binding": "00" * 32}, "decision/outcome"),
        ({"valid_until_us": 0}, "decision/valid-until-us"),
    ],
)
def test_forged_link_of_the_contingency_is_found(fields: dict[str, object], slug: str) -> None:
    lines = denied_in_the_air()
    number = decisions(lines, 2)[0]
    assert forged(lines, number, **fields) == (slug, number)


@pytest.mark.parametrize("kind", [0, 1, 2])
@pytest.mark.parametrize(
    ("field", "value", "slug"),
    [("vehicle", "quad-08", "decision/vehicle"), ("policy_version", 8, "decision/policy-version")],
)
def test_decision_for_another_vehicle_or_policy_version_is_found(
    kind: int, field: str, value: object, slug: str
) -> None:
    """Even a refusal: it would derive correctly from the wrong vehicle in its record."""
    lines = [flight(), fallen_back("px4").lines, denied_in_the_air()][kind]
    number = decisions(lines, kind)[0]
    context = read(lines[number])["context"] | {field: value}
    assert forged(lines, number, context=context) == (slug, number)
    if kind == 0:
        reason = {"vehicle": "integrity/wrong-vehicle", "policy_version": "integrity/policy-version"}[field]
        denied = {"outcome": "deny", "reason": reason, "rule_step": 1, "valid_until_us": read(lines[number])["at_us"]}
        assert forged(lines, number, context=context, **denied) == (slug, number)


@pytest.mark.parametrize("by_us", [-1, 1])
def test_release_outside_receipt_and_decision_is_found(by_us: int) -> None:
    lines = flight()
    number = decisions(lines, 0)[0]
    end = read(lines[0])["received_us"] if by_us < 0 else read(lines[number])["at_us"]
    context = read(lines[number])["context"] | {"released_us": end + by_us}
    assert forged(lines, number, context=context) == ("decision/released", number)


@pytest.mark.parametrize(
    ("fields", "slug"),
    [
        ({"outcome": "deny"}, "decision/outcome"),
        ({"link": 9}, "decision/unknown-step"),
        ({"link": -2}, "decision/unknown-step"),
        ({"link": -1}, "decision/outcome"),
        ({"binding": "00" * 32}, "decision/outcome"),
        ({"invocation": ""}, "decision/invocation"),
    ],
)
def test_forged_link_of_a_chain_is_found(fields: dict[str, object], slug: str) -> None:
    lines = fallen_back("px4").lines
    number = next(n for n in decisions(lines, 1) if read(lines[n])["link"] >= 0)
    assert forged(lines, number, **fields) == (slug, number)


def test_decision_on_the_target_of_a_degrade_rule_is_derived_again() -> None:
    lines = other_flight()
    number = next(n for n in decisions(lines, 1) if read(lines[n])["link"] == -1)
    assert forged(lines, number, reason="state/violated") == ("decision/reason", number)


def test_allowed_link_that_may_not_fly_is_found() -> None:
    """Without a fix the vehicle can neither hover nor fly home, but the record allows it."""
    lines = fallen_back("px4").lines
    number = next(n for n in decisions(lines, 1) if read(lines[n])["link"] >= 0)
    state = read(lines[number])["state"]
    state["values"][case.flat.FIX] = None
    assert forged(lines, number, state=state) == ("decision/outcome", number)


def test_recorded_refusal_of_a_link_passes() -> None:
    """The same state with a true record: the link is refused, and flies by the step's standing permit."""
    lines = fallen_back("px4").lines
    number = next(n for n in decisions(lines, 1) if read(lines[n])["link"] >= 0)
    record = read(lines[number])
    record["state"]["values"][case.flat.FIX] = None
    answer = {"outcome": "fallback", "reason": "state/violated", "rule_step": 6, "valid_until_us": record["at_us"]}
    true = edit(lines[number], state=record["state"], **answer)
    assert prove(signed([*lines[:number], true, *lines[number + 1 :]])).report.failure is None


def test_deferred_step_may_be_decided_again() -> None:
    """An unknown battery defers the take-off; it is decided again, and its id is not consumed."""
    lines = tuple(
        Flight(
            case.seal(case.mission(case.short_steps())), case.simulated("px4", faults=(BatteryLevel(0, 3_000),)),
            attested=False,
        ).fly().lines
    )  # fmt: skip
    first = decisions(lines, 0)[0]
    assert forged(lines, first, context=read(lines[first])["context"] | {"consumed": 1}) == ("decision/consumed", first)
