"""What waited on the link while the computer stood still is of then: it tells neither who flies now, nor that what we
sent is somebody else's.
"""

from functools import cache

import pytest

from rtshcua.model.faults import FlightMode, PilotMode
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Succeeded, TakenOver
from virtual.copying import copied
from virtual.flyer import Flyer, climbed
from virtual.sampling import each_once

MS, S = 1_000, 1_000_000
FLAVOURS = ("px4", "ardupilot")


@cache
def in_a_leg(flavour: str) -> Flyer:
    """A vehicle five seconds into a leg."""
    one: Flyer = copied(climbed(flavour, 20_000))
    one.begin(MotionKind.FLY, (200_000, 0), altitude=20_000, speed=5_000)
    one.wait(5)
    return one


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_stopping_point_reached_during_a_stall_is_ours(flavour: str) -> None:
    """A stop was sent just before the stall and a return just after; the stopping point is reported in between."""
    one = copied(in_a_leg(flavour))
    one.begin(MotionKind.HOLD)
    one.wait(0.2)
    one.vehicle.stand_still(6 * S)
    one.begin(MotionKind.HOME)
    end = one.until((Succeeded, TakenOver))
    assert isinstance(end, Succeeded), end


@pytest.mark.parametrize(
    ("taken_us", "kind", "flavour"),
    each_once((100 * MS, 3 * S, 5_300 * MS), (MotionKind.HOME, MotionKind.LAND, MotionKind.HOLD), FLAVOURS),
)
def test_a_pilot_who_took_over_meanwhile_is_not_flown_over(taken_us: int, kind: MotionKind, flavour: str) -> None:
    """Queued reports of the earlier mode do not show who flies now."""
    one = copied(in_a_leg(flavour))
    one.vehicle.simulation.inject(PilotMode(one.vehicle.simulation.now_us + taken_us, FlightMode.POSITION))
    one.vehicle.stand_still(6 * S)
    one.begin(kind)
    end = one.until((Succeeded, TakenOver), 20)
    assert isinstance(end, TakenOver), end
    assert one.truth.mode is FlightMode.POSITION
