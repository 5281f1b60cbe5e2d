"""The stages of each kind of motion for ArduCopter. It obeys position targets only in GUIDED, and silently ignores them
elsewhere; a takeoff takes a height above home.
"""

from functools import cache

from rtshcua.adapters.vehicle import effects, flavour, messages, returns
from rtshcua.adapters.vehicle.bounds import OwnFence
from rtshcua.adapters.vehicle.effects import Effect
from rtshcua.adapters.vehicle.flavour import AutopilotFlavour, ExpectedTarget, FenceHabits, ReturnAltitude, Stage
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.adapters.vehicle.returns import ReturnLimit
from rtshcua.mavlink import enums
from rtshcua.mavlink.modes import COPTER_NAMES, CopterMode
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Command

#: mm: a leg counts as begun when it is this much nearer to its end, whatever else moves the vehicle
_NEARER = 1_000
_SPEED_US = 5_000_000
_REPEAT_US = 2_000_000  # position targets have no acknowledgement
_GUIDED = frozenset({CopterMode.GUIDED})
_BRAKE = frozenset({CopterMode.BRAKE})
_POLYGONS = 4  # of FENCE_TYPE: inclusions and exclusions, polygons and circles


def stages(command: Command, seen: ObservedVehicle, system: int) -> list[Stage]:
    """The stages of a manoeuvre."""
    match command.kind:
        case MotionKind.HOME | MotionKind.LAND:
            return list(_coming_down(system, command.kind))
        case MotionKind.CLIMB:
            height = command.altitude
            takeoff = messages.command(system, messages.TAKEOFF, 0, 0, 0, 0, 0, 0, height / 1_000)
            rises, above = flavour.climbing(height), _above(seen, height)
            return [
                flavour.entering(system, CopterMode.GUIDED),
                flavour.arming(system, _GUIDED),
                Stage(takeoff, messages.TAKEOFF, effects.airborne, _GUIDED, flavour.ARM_US, powered=True, target=above),
                Stage(None, None, effects.climbed(height), _GUIDED, powered=True, target=above, progress=rises),
            ]
        case MotionKind.FLY | MotionKind.COVER:
            return [flavour.entering(system, CopterMode.GUIDED), *_legs(command, seen, system)]
        case _:
            # not LOITER, which obeys the throttle stick: an onboard computer has none
            mode, brakes = messages.set_mode(system, CopterMode.BRAKE), effects.in_mode(CopterMode.BRAKE)
            return [
                Stage(mode, messages.DO_SET_MODE, brakes, _BRAKE, flavour.MODE_US, powered=True, stops=True),
                Stage(None, None, effects.still, _BRAKE, powered=True, stops=True),
            ]


@cache
def _coming_down(system: int, kind: int) -> tuple[Stage, ...]:
    """Return or land: the stages never change, so they are made once (`Driver` has them made in advance)."""
    home = kind == MotionKind.HOME
    return tuple(flavour.returning(system, CopterMode.RTL) if home else flavour.landing(system, CopterMode.LAND))


def _above(seen: ObservedVehicle, height: int) -> ExpectedTarget:
    """The target of a takeoff. `ModeGuided::get_wp` has no target before a position target (recorded: none from the
    takeoff to the first leg); versions up to 4.1 report the end of the takeoff. So any other target is somebody else's.
    """
    amsl = None if seen.home_amsl is None else seen.amsl(height)
    return ExpectedTarget(seen.latitude, seen.longitude, amsl, told=False)


def _legs(command: Command, seen: ObservedVehicle, system: int) -> list[Stage]:
    """One leg after the other. A speed that is set before the first target in GUIDED is forgotten (recorded), so it is
    sent after it.
    """
    legs: list[Stage] = []
    for number, place in enumerate(zip(command.geo[::2], command.geo[1::2], strict=True)):
        height, heading = command.height_at(number), command.heading_at(number)
        amsl = None if seen.home_amsl is None else seen.amsl(height)
        message = messages.position_target(system, *place, height / 1_000, heading)
        leg = flavour.leg(message, None, _GUIDED, place, height, amsl, _REPEAT_US)
        legs += [leg, *flavour.turning(leg, heading)]
    if not command.speed or not legs:
        return legs
    first, *others = legs
    speed = messages.command(system, messages.CHANGE_SPEED, 1, command.speed / 1_000, -1)
    return [
        first._replace(done=_sets_off(first, seen)),
        Stage(speed, messages.CHANGE_SPEED, None, _GUIDED, _SPEED_US, powered=True),
        Stage(None, None, first.done, _GUIDED, powered=True, progress=first.progress),
        *others,
    ]


def _sets_off(leg: Stage, begins: ObservedVehicle) -> Effect:
    """The autopilot reports the leg's target. Without a report, the vehicle must be nearer to it than where the leg
    began. Motion alone is not enough: at the end of a takeoff it still moves without a target, and the frame of the leg
    may have been lost.
    """
    assert leg.progress is not None
    measure = leg.progress.measure
    left = measure(begins)

    def done(seen: ObservedVehicle) -> bool:
        if seen.target is not None and leg.target is not None:
            return leg.target.matches(seen.target)
        now = measure(seen)
        return left is not None and now is not None and left[0] - now[0] >= _NEARER

    return lambda seen: done(seen) or (leg.done is not None and leg.done(seen))


ARDUPILOT = AutopilotFlavour(
    name="ardupilot",
    autopilot=enums.MAV_AUTOPILOT_ARDUPILOTMEGA,
    mode_names=COPTER_NAMES,
    stages=stages,
    estimator="EKF_STATUS_REPORT",
    natural=frozenset(),
    ours=frozenset({CopterMode.GUIDED, CopterMode.BRAKE, CopterMode.RTL}),
    shows={
        MotionKind.CLIMB: _GUIDED,
        MotionKind.FLY: _GUIDED,
        MotionKind.COVER: _GUIDED,
        MotionKind.HOLD: _BRAKE,
        MotionKind.HOME: frozenset({CopterMode.RTL}),
        MotionKind.LAND: frozenset({CopterMode.LAND}),
    },
    aims=_GUIDED,
    lag_us=0,
    mode_within_us=200_000,  # HEARTBEAT is streamed at twice that rate
    returns=(ReturnAltitude("RTL_ALT", 10), ReturnAltitude("RTL_ALT_M", 1_000)),  # cm before 4.7, metres from then on
    limits=(
        (ReturnLimit("RTL_CONE_SLOPE", 1_000, returns.slope, may_be_off=True),),
        (ReturnLimit("RTL_CLIMB_MIN", 10, returns.climb), ReturnLimit("RTL_CLIMB_MIN_M", 1_000, returns.climb)),
        (ReturnLimit("WPNAV_RADIUS", 10, returns.corner), ReturnLimit("WP_RADIUS_M", 1_000, returns.corner)),
        (returns.RTL_ALT_TYPE,),
        (returns.RALLY_TOTAL,),
    ),
    critical_acts=False,  # a failsafe that acts changes the mode
    bytewise=False,
    fence=FenceHabits(
        frame=enums.MAV_FRAME_GLOBAL, all_inclusions=True, switches=(("FENCE_TYPE", _POLYGONS), ("FENCE_ENABLE", 1))
    ),
    own_fence=OwnFence(
        "FENCE_RADIUS", "FENCE_ALT_MAX", "FENCE_ALT_MIN", "FENCE_MARGIN", "FENCE_TYPE", ("FENCE_ENABLE",)
    ),
    # `ModeGuided::get_wp`, until a velocity or another mode comes; a pause keeps the target (recorded)
    names_targets=True,
)
