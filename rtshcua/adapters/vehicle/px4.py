"""The stages of each kind of motion for PX4. Altitudes in its commands are above mean sea level, whatever the frame
says. An acknowledgement of DO_REPOSITION or DO_SET_MODE proves nothing: the heartbeat shows the mode, and for a stop
only the speed counts.
"""

from functools import cache

from rtshcua.adapters.vehicle import effects, flavour, messages, returns
from rtshcua.adapters.vehicle.bounds import OwnFence
from rtshcua.adapters.vehicle.effects import Effect
from rtshcua.adapters.vehicle.flavour import AutopilotFlavour, ExpectedTarget, FenceHabits, ReturnAltitude, Stage
from rtshcua.adapters.vehicle.messages import NAN
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.adapters.vehicle.returns import ReturnLimit
from rtshcua.mavlink import enums
from rtshcua.mavlink.modes import PX4_NAMES, Px4Mode
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Command

_HOLD = frozenset({Px4Mode.HOLD})


def stages(command: Command, seen: ObservedVehicle, system: int) -> list[Stage]:
    """The stages of a manoeuvre. Raises NoDatum where they need an altitude and `seen.home_amsl` is not known."""
    match command.kind:
        case MotionKind.HOME | MotionKind.LAND:
            return list(_coming_down(system, command.kind))
        case MotionKind.CLIMB:
            return _climb(command, seen, system)
        case MotionKind.FLY | MotionKind.COVER:
            legs: list[Stage] = []
            for number, place in enumerate(zip(command.geo[::2], command.geo[1::2], strict=True)):
                height, heading = command.height_at(number), command.heading_at(number)
                amsl = seen.amsl(height)
                message = messages.reposition_amsl(system, *place, amsl / 1_000, command.speed, heading)
                settled = messages.in_hold(message)
                leg = flavour.leg(message, messages.REPOSITION, _HOLD, place, height, amsl, settled=settled)
                legs += [leg, *flavour.turning(leg, heading)]
            return legs
        case _:
            return [_stop(seen, system), Stage(None, None, effects.still, _HOLD, powered=True, stops=True)]


@cache
def _coming_down(system: int, kind: int) -> tuple[Stage, ...]:
    """Return or land: the stages never change, so they are made once (`Driver` has them made in advance)."""
    home = kind == MotionKind.HOME
    return tuple(flavour.returning(system, Px4Mode.RETURN) if home else flavour.landing(system, Px4Mode.LAND))


def _climb(command: Command, seen: ObservedVehicle, system: int) -> list[Stage]:
    """Arm in Hold, and then command the takeoff. PX4 also accepts the opposite order, but if the arming was refused, it
    would take off whenever somebody armed it.
    """
    height, amsl = command.altitude, seen.amsl(command.altitude)
    own = frozenset({Px4Mode.TAKEOFF, Px4Mode.HOLD})
    takeoff = messages.command(system, messages.TAKEOFF, NAN, 0, 0, NAN, NAN, NAN, amsl / 1_000)
    rises = flavour.climbing(height)
    above = ExpectedTarget(seen.latitude, seen.longitude, amsl, flavour.TAKES_OFF)
    begun = effects.in_mode(Px4Mode.TAKEOFF)
    return [
        flavour.entering(system, Px4Mode.HOLD),
        flavour.arming(system, _HOLD),
        Stage(takeoff, messages.TAKEOFF, begun, own, flavour.MODE_US, powered=True, target=above),
        Stage(None, None, _is_above(height), own, powered=True, target=above, progress=rises),
    ]


def _is_above(height: int) -> Effect:
    """Climbed and in Hold, which follows by itself: so the next leg names no mode, and cannot undo a pilot's."""
    climbed = effects.climbed(height)
    return lambda seen: seen.mode == Px4Mode.HOLD and climbed(seen)


def _stop(seen: ObservedVehicle, system: int) -> Stage:
    """A stop by DO_REPOSITION. Not by DO_SET_MODE: in Hold, flying to a place, PX4 acknowledges that and flies on
    (vehicles.md 5).
    """
    stop, here = messages.stop_here(system), flavour.stopping(seen)
    return Stage(
        stop, messages.REPOSITION, None, _HOLD, flavour.MODE_US, powered=True, target=here, stops=True,
        settled=messages.in_hold(stop),
    )  # fmt: skip


PX4 = AutopilotFlavour(
    name="px4",
    autopilot=enums.MAV_AUTOPILOT_PX4,
    mode_names=PX4_NAMES,
    stages=stages,
    estimator="ESTIMATOR_STATUS",
    natural=frozenset({(Px4Mode.TAKEOFF, Px4Mode.HOLD)}),
    ours=frozenset({Px4Mode.TAKEOFF, Px4Mode.HOLD, Px4Mode.RETURN}),
    shows={
        MotionKind.CLIMB: frozenset({Px4Mode.TAKEOFF, Px4Mode.HOLD}),  # armed in Hold, and in Hold again above
        MotionKind.FLY: _HOLD,
        MotionKind.COVER: _HOLD,
        MotionKind.HOLD: _HOLD,
        MotionKind.HOME: frozenset({Px4Mode.RETURN}),
        MotionKind.LAND: frozenset({Px4Mode.LAND}),
    },
    aims=frozenset({Px4Mode.TAKEOFF, Px4Mode.HOLD}),
    lag_us=20_000,  # 10 to 15 ms, recorded
    mode_within_us=300_000,  # HEARTBEAT is requested at twice that rate: by itself it comes once a second
    returns=(ReturnAltitude("RTL_RETURN_ALT", 1_000),),
    limits=(
        (ReturnLimit("RTL_MIN_DIST", 1_000, returns.near),),
        (ReturnLimit("NAV_MC_ALT_RAD", 1_000, returns.corner),),
        (returns.RTL_TYPE,),
    ),
    critical_acts=True,  # since 1.15 a warning alone does not count (PX4-Autopilot pull request 22879)
    bytewise=True,
    fence=FenceHabits(frame=enums.MAV_FRAME_GLOBAL_RELATIVE_ALT, all_inclusions=False, switches=()),
    own_fence=OwnFence("GF_MAX_HOR_DIST", "GF_MAX_VER_DIST"),
    counts_rally_points=True,
)
