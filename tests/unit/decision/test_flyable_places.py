"""Limits of links and plans: the vehicle's speed, places on the earth, one zone to cover."""

import pytest
from msgspec.structs import replace

from reference import flat_case as flat
from reference.flat_case import INSPECT, M
from rtshcua.decision.prepare import PreparedPolicy, prepare, prepare_invocation, prepare_mission
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.contract import PLACE, QUANTITY, ZONE, Motion, MotionKind, Parameter
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import SignalSource
from rtshcua.model.flat.zone import HIGHEST, Projection

P = flat.POLICY
DASH = len(P.contracts)


def with_link(*arguments: int) -> Policy:
    """A contingency whose one link flies to a place, at an altitude and a speed in mm and mm/s."""
    dash = flat.contract(
        "dash",
        Motion(MotionKind.FLY, 2, 3),
        parameters=(
            Parameter("to", PLACE, "", 0, 0, 0, ()),
            Parameter("altitude", QUANTITY, "altitude", 2, 0, 4 * HIGHEST, ()),
            Parameter("speed", QUANTITY, "speed", 3, 0, 500 * M, ()),
        ),
    )
    return replace(P, contracts=(*P.contracts, dash), contingency=(flat.link(DASH, *arguments),))


def wrong(policy: Policy) -> str:
    found = prepare(policy)
    return found.text if isinstance(found, Refusal) else ""


def test_a_link_flies_no_faster_than_the_vehicle() -> None:
    assert wrong(with_link(0, 0, 30 * M, 12 * M)) == ""
    assert wrong(with_link(0, 0, 30 * M, 12 * M + 1)) == "contingency: link 0: speed 12001 is not in 0..12000"


def test_a_link_flies_no_higher_than_an_altitude_can_be() -> None:
    assert wrong(with_link(0, 0, HIGHEST, 1)) == ""
    assert wrong(with_link(0, 0, HIGHEST + 1, 1)).startswith(f"contingency: link 0: altitude {HIGHEST + 1} is not in")


@pytest.mark.parametrize(
    ("projection", "place", "what"),
    [
        (Projection(473_977_400, 85_455_900, 7_900_000, 1), (0, 10 * M), "latitude"),
        (Projection(-170_000_000, 1_799_990_000, 1 << 6, 11_600_000), (200 * M, 0), "longitude is half around"),
        (Projection(899_900_000, 0, 2_000, 11_712_000), (0, 2_000 * M), "latitude"),
    ],
)
def test_place_outside_earth_is_refused(projection: Projection, place: tuple[int, int], what: str) -> None:
    at = f"place {place[0]}, {place[1]}: {what} "
    assert wrong(replace(with_link(*place, 30 * M, 1), projection=projection)).startswith(f"contingency: link 0: {at}")
    policy = prepare(replace(P, projection=projection))
    assert isinstance(policy, PreparedPolicy)
    step = flat.INVOCATIONS[1]
    there = replace(step, arguments=(*place, 20 * M), plan=replace(step.plan, path=place))
    found = prepare_invocation(there, policy, flat.MISSION.phases)
    assert isinstance(found, Refusal)
    assert found.text.startswith(f"plan: {at}")


def test_a_skill_that_covers_has_one_zone() -> None:
    inspect = P.contracts[INSPECT]
    second = Parameter("other", ZONE, "", 4, 0, 2, ())
    changed = replace(inspect, parameters=(*inspect.parameters, second))
    contracts = tuple(changed if one is inspect else one for one in P.contracts)
    assert wrong(replace(P, contracts=contracts)) == (
        "skill `inspect_area`: motion: a skill that covers a zone needs exactly one zone argument"
    )


def test_two_phases_of_one_name() -> None:
    policy = prepare(P)
    assert isinstance(policy, PreparedPolicy)
    twice = replace(flat.MISSION, phases=("departure", "inspection", "inspection"))
    assert prepare_mission(twice, policy) == Refusal("malformed", "two phases have the same name")


@pytest.mark.parametrize("numerator", [0, -1])
def test_a_source_that_scales_to_nothing(numerator: int) -> None:
    source = SignalSource("BATTERY_STATUS", ("battery_remaining",), numerator, 1, ())
    signals = (replace(P.signals[0], sources=(source,)), *P.signals[1:])
    assert wrong(replace(P, signals=signals)).startswith(f"signal `battery`: numerator {numerator} is not in 1..")
