"""A request identifies an invocation by its binding: a request with another binding is denied, and has no effect."""

import pytest
from msgspec.structs import replace

from reference.flat_case import INVOCATIONS, MISSION, POLICY
from reference.world import MISSION_KEY, POLICY_KEY, Run, allowed, answer_to, loaded, request_for, sealed, try_load
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.decision import Decision
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.wire import binding, bundle
from virtual.rows import rows


@rows("bit", range(0, 256, 17))
def test_a_step_under_another_binding_is_denied(bit: int) -> None:
    of = loaded()
    changed = bytearray(of.bundle.mission.invocations[0].binding)
    changed[bit // 8] ^= 1 << bit % 8
    answer = answer_to(of, request_for(of, binding=bytes(changed)))
    assert isinstance(answer, Decision)
    assert (answer.outcome, answer.reason, answer.step) == (Outcome.DENY, Reason.BINDING_MISMATCH, 1)
    assert answer.permit == b""
    assert answer.target is None


def test_binding_of_another_step_is_denied() -> None:
    of = loaded()
    answer = answer_to(of, request_for(of, binding=of.bundle.mission.invocations[1].binding))
    assert isinstance(answer, Decision)
    assert answer.reason is Reason.BINDING_MISMATCH


@pytest.mark.parametrize(("kind", "step", "link"), [(1, 0, 0), (2, -1, 0)])
def test_links_are_bound_too(kind: int, step: int, link: int) -> None:
    of = loaded()
    allowed(of)
    answer = answer_to(of, request_for(of, kind, step, link, binding=bytes(32)))
    assert isinstance(answer, Decision)
    assert (answer.outcome, answer.reason) == (Outcome.DENY, Reason.BINDING_MISMATCH)
    assert answer.permit == b""
    allowed(of, kind, step, link)


@pytest.mark.parametrize("field", ["require", "assume", "maintain", "fallback", "record"])
def test_binding_covers_fields_omitted_in_paper(field: str) -> None:
    """`pre`, `sc`, `inv`, `f_b`, `ev`: weakened after binding, the bundle does not load, whoever signed it."""
    payload = bundle.policy_payload(POLICY)
    bound = binding.bind(MISSION, bundle.policy_digest(payload))
    weaker = replace(bound.invocations[2], contract=replace(bound.invocations[2].contract, **{field: ()}))
    mission = replace(bound, invocations=(*bound.invocations[:2], weaker, bound.invocations[3]))
    data = bundle.seal(payload, bundle.mission_payload(mission), policy_key=POLICY_KEY, mission_key=MISSION_KEY)
    refusal = try_load(data)
    assert isinstance(refusal, Refusal)
    assert refusal.slug == "binding-mismatch"


@pytest.mark.parametrize("field", ["require", "assume", "maintain", "fallback", "record"])
def test_bound_mission_that_weakens_policy_is_refused(field: str) -> None:
    weaker = replace(INVOCATIONS[2], contract=replace(INVOCATIONS[2].contract, **{field: ()}))
    refusal = try_load(sealed(mission=replace(MISSION, invocations=(*INVOCATIONS[:2], weaker, INVOCATIONS[3]))))
    assert isinstance(refusal, Refusal)
    assert refusal.slug == "malformed"


@pytest.mark.parametrize("hidden", [{"speed": 9_000}, {"altitude": 30_000}])
def test_plan_that_differs_from_arguments_is_refused(hidden: dict[str, int]) -> None:
    """Whoever approves a step sees its arguments: who signs the mission may not choose a speed beside them."""
    step = 0 if "speed" in hidden else 3  # a takeoff has no speed, a return no altitude
    odd = replace(INVOCATIONS[step], plan=replace(INVOCATIONS[step].plan, **hidden))
    steps = (*INVOCATIONS[:step], odd, *INVOCATIONS[step + 1 :])
    refusal = try_load(sealed(mission=replace(MISSION, invocations=steps)))
    assert isinstance(refusal, Refusal)
    assert "differs from the argument, 0" in refusal.text


def test_a_tampered_request_in_the_air_flies_the_contingency() -> None:
    of = loaded()
    first, second = (of.bundle.mission.invocations[step].binding for step in (0, 1))

    class Tampering:
        lost = None

        def enforce(self, request: bytes) -> bytes:
            return of.boundary.enforce(request.replace(second, first))

    run = Run(replace(of, boundary=Tampering())).until_over()
    assert (0, 1, -1, "deny", "integrity/binding-mismatch") in run.decisions
    assert run.flown == ["takeoff", "hover", "return_home"]
