"""The start of a leg on ArduCopter, which does not acknowledge legs: the speed is sent, the leg not repeated."""

from rtshcua.adapters.vehicle.ardupilot import ARDUPILOT
from rtshcua.adapters.vehicle.flavour import Stage
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Command

PLACE = (473_987_600, 85_469_800)


def vehicle(latitude: int, height: int, speed: int, target: tuple[int, int, int] | None = None) -> ObservedVehicle:
    return ObservedVehicle(
        latitude=latitude, longitude=PLACE[1], height=height, located=True, levelled=True, speed=speed,
        home_amsl=488_000, landed_state=2, target=target,
    )  # fmt: skip


def leg(begins: ObservedVehicle) -> Stage:
    """The frame of the leg, with the condition that ends the wait for its start."""
    command = Command(1, "goto", MotionKind.FLY, (0, 0), PLACE, 20_000, 6_000, 0)
    (found,) = [each for each in ARDUPILOT.stages(command, begins, 1) if each.message is not None and each.repeat_us]
    return found


def test_residual_takeoff_motion_does_not_start_a_leg() -> None:
    """No target is reported before the first leg. Its frame was lost, and was never sent again."""
    begun = leg(vehicle(473_977_398, 19_600, 300)).done
    assert begun is not None
    assert not begun(vehicle(473_977_398, 19_900, 300)), "it rises on"
    assert not begun(vehicle(473_977_310, 19_900, 900)), "it drifts away"
    assert begun(vehicle(473_977_498, 19_900, 900)), "it is a metre nearer"


def test_reported_target_decides_whether_a_leg_began() -> None:
    begun = leg(vehicle(473_977_398, 19_600, 0)).done
    assert begun is not None
    assert begun(vehicle(473_977_398, 19_600, 0, (*PLACE, 508_000)))
    assert not begun(vehicle(473_977_998, 19_600, 5_000, (473_990_000, PLACE[1], 508_000))), "somebody else's"
