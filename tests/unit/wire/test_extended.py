"""Records that have got more fields: those that do not use them keep their bytes, which have one form only."""

from typing import Any

import pytest
from msgspec.structs import replace

from reference import flat_case as flat
from reference import payload_case
from reference.bundle_case import THE_MISSION, THE_POLICY
from rtshcua.model.flat.contract import Facing, Motion
from rtshcua.model.flat.mission import ALONG, Mission, Plan
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.struct import Flat
from rtshcua.wire import artefact, bundle, cbor, names
from rtshcua.wire.builtins import builtins_of
from rtshcua.wire.untrusted import Untrusted
from virtual.rows import rows


@rows(
    ("part", "made"),
    [
        (Plan(3, (1, 2), 5, 0), [3, (1, 2), 5, 0]),
        (Plan(3, (1, 2), 5, 0, (4,)), [3, (1, 2), 5, 0, (4,)]),
        (Plan(3, (1, 2), 5, 0, (4,), (ALONG,)), [3, (1, 2), 5, 0, (4,), (ALONG,)]),
        (Plan(3, (1, 2), 5, 0, (), (90,)), [3, (1, 2), 5, 0, (), (90,)]),
        (Motion(3, 1, 2), [3, 1, 2, -1]),
        (Motion(3, 1, 2, -1, 4), [3, 1, 2, -1, 4]),
        (Motion(3, 1, 2, facing=Facing.INWARD), [3, 1, 2, -1, -1, 1]),
    ],
)
def test_last_fields_with_their_defaults_are_left_out(part: Flat, made: Any) -> None:
    assert builtins_of(part) == made


def test_motions_and_plans_deep_inside_are_shortened() -> None:
    contract = builtins_of(THE_POLICY)[Policy.__struct_fields__.index("contracts")][0]
    assert (len(contract), len(contract[2])) == (16, 4)
    assert len(builtins_of(THE_POLICY)[Policy.__struct_fields__.index("vehicle")]) == 23
    for step in builtins_of(THE_MISSION)[Mission.__struct_fields__.index("invocations")]:
        assert len(step[10][2]) == len(step[11]) == 4


SHOT = payload_case.emission(2000)


def test_contracts_and_vehicles_with_payload_have_all_fields() -> None:
    contract, vehicle = THE_POLICY.contracts[0], THE_POLICY.vehicle
    assert builtins_of(replace(contract, emits=(SHOT,)))[16] == (builtins_of(SHOT),)
    assert builtins_of(replace(vehicle, servos=(9, 10)))[23] == (9, 10)


def with_plan(*fields: Any) -> bytes:
    """A mission whose first plan has these fields, as bytes."""
    made = builtins_of(flat.MISSION)
    made[Mission.__struct_fields__.index("invocations")][0][11] = list(fields)
    return artefact.wrap(names.MISSION, made)


def test_one_mission_has_one_form() -> None:
    plan = flat.MISSION.invocations[0].plan
    given = int(plan.kind), plan.path, plan.altitude, plan.speed
    assert bundle.parse(names.MISSION, with_plan(*given), Mission) == flat.MISSION
    for more in (((),), ((), ()), ((7,), ())):
        with pytest.raises(Untrusted, match="encodes to"):
            bundle.parse(names.MISSION, with_plan(*given, *more), Mission)
    for fields in (given[:3], (*given, (), (0,), 0)):
        with pytest.raises(Untrusted):
            bundle.parse(names.MISSION, with_plan(*fields), Mission)
    heights = replace(plan, heights=(5, 7), headings=(0, 9_000))
    first = replace(flat.MISSION.invocations[0], plan=heights)
    mission = replace(flat.MISSION, invocations=(first, *flat.MISSION.invocations[1:]))
    assert bundle.parse(names.MISSION, bundle.mission_payload(mission), Mission) == mission
    assert cbor.decode(bundle.mission_payload(mission))
