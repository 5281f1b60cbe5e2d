"""The binding covers every field: change any one, and it no longer fits."""

from typing import Any

import msgspec

from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract, Motion
from rtshcua.model.flat.mission import Invocation, Mission, Plan
from rtshcua.wire.binding import ID_BYTES, bind, binding_of, first_unbound
from virtual.rows import rows

DIGEST = bytes(range(32))


def contract() -> Contract:
    return Contract(
        name="hover",
        parameters=(),
        motion=Motion(kind=0, altitude=-1, speed=-1),
        timing_class=1,
        deadline_us=5,
        validity_us=6,
        phases=("a",),
        duration_us=7,
        grace_us=8,
        require=(Clause("x", 0, 1, 2, (1, 5, 0, 1, 6, 0, 16, 0, 0)),),
        assume=(),
        maintain=(),
        fallback=(),
        energy=9,
        record=("intent",),
        reads=(),
    )


def mission(at: int = 1_000) -> Mission:
    steps = tuple(
        Invocation(
            invocation_id=b"",
            step=step,
            phase=0,
            skill=0,
            source=0,
            role=0,
            arguments=(),
            issued_at_us=at,
            phases=1,
            on_inadmissible=0,
            contract=contract(),
            plan=Plan(kind=0, path=(), altitude=0, speed=0),
            text="hover()",
            file=0,
            start=1,
            end=2,
            binding=b"",
        )
        for step in range(2)
    )
    return Mission(
        name="m",
        intent="",
        proposer="p",
        vehicle="v",
        policy="q",
        policy_version=3,
        policy_digest=b"",
        issued_at_us=at,
        phases=("a",),
        invocations=steps,
        sources=("f.rts",),
        source_digests=(DIGEST,),
    )


def test_every_step_gets_an_id_and_a_binding() -> None:
    bound = bind(mission(), DIGEST)
    assert bound.policy_digest == DIGEST
    assert first_unbound(bound) is None
    assert {len(step.invocation_id) for step in bound.invocations} == {ID_BYTES}
    assert len({step.invocation_id for step in bound.invocations}) == 2


def test_the_same_mission_gives_the_same_bytes_and_another_time_other_ids() -> None:
    assert bind(mission(), DIGEST) == bind(bind(mission(), DIGEST), DIGEST)
    ids = [{step.invocation_id for step in bind(mission(at), DIGEST).invocations} for at in (1_000, 1_001)]
    assert ids[0].isdisjoint(ids[1])
    other = {step.invocation_id for step in bind(mission(), bytes(32)).invocations}
    assert other.isdisjoint(ids[0])


@rows("field", [field for field in Invocation.__struct_fields__ if field != "binding"])
def test_binding_covers_every_invocation_field(field: str) -> None:
    bound = bind(mission(), DIGEST)
    changed = msgspec.structs.replace(bound.invocations[1], **{field: other(getattr(bound.invocations[1], field))})
    forged = msgspec.structs.replace(bound, invocations=(bound.invocations[0], changed))
    assert first_unbound(forged) == 1


@rows("field", Contract.__struct_fields__)
def test_binding_covers_every_contract_field(field: str) -> None:
    bound = bind(mission(), DIGEST)
    invocation = bound.invocations[0]
    weaker = msgspec.structs.replace(invocation.contract, **{field: other(getattr(invocation.contract, field))})
    assert binding_of(bound, msgspec.structs.replace(invocation, contract=weaker)) != invocation.binding


@rows("field", ["policy_digest", "policy", "policy_version", "vehicle", "name", "issued_at_us", "phases"])
def test_binding_covers_context(field: str) -> None:
    bound = bind(mission(), DIGEST)
    assert first_unbound(msgspec.structs.replace(bound, **{field: other(getattr(bound, field))})) == 0


def other(value: Any) -> Any:
    """Another value of the same type."""
    match value:
        case int():
            return value + 1
        case str():
            return value + "x"
        case bytes():
            return value + b"x"
        case tuple():
            return (*value, *value) if value else (1,)
        case Contract():
            return msgspec.structs.replace(value, energy=value.energy + 1)
        case Plan():
            return msgspec.structs.replace(value, speed=value.speed + 1)
        case _:
            return msgspec.structs.replace(value, kind=value.kind + 1)
