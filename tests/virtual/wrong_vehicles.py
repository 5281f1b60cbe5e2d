"""Deliberately wrong vehicles: the simulated one with one behaviour that the adapters exclude.

A function changes the virtual vehicle after its construction. Other checks than the intended one may fail too.
"""

from collections import deque
from collections.abc import Callable, Sequence
from copy import copy
from typing import Any

from rtshcua.codec.frames import Codec
from rtshcua.mavlink import enums
from rtshcua.model.faults import FlightMode, MessageSilence
from rtshcua.virtual.vehicle import SECOND, VirtualVehicle

ASKED = (enums.MAV_CMD_SET_MESSAGE_INTERVAL, enums.MAV_CMD_REQUEST_MESSAGE)
HEARTBEAT = 0


def _of(vehicle: VirtualVehicle) -> Any:
    """Return the simulated autopilot inside."""
    return vehicle.simulation._autopilot


def _filtered(vehicle: VirtualVehicle, change: Callable[[Any, bytes], Sequence[bytes]]) -> None:
    """Replace each frame of the vehicle, given parsed and raw."""
    codec = Codec(0, 0)

    def hurt(datagram: bytes) -> list[bytes]:
        return [octets for frame in codec.parse(datagram) for octets in change(frame, frame.frame)]

    vehicle.hurt = hurt


def _each_tick(vehicle: VirtualVehicle, act: Callable[[], None]) -> None:
    """Call a function whenever the vehicle sends frames."""

    def change(_: Any, octets: bytes) -> Sequence[bytes]:
        act()
        return [octets]

    _filtered(vehicle, change)


def hold_that_does_not_stop(vehicle: VirtualVehicle) -> None:
    _of(vehicle).vehicle.hold = lambda up=None: None


def hold_that_drifts(vehicle: VirtualVehicle) -> None:
    body = _of(vehicle).vehicle

    def act() -> None:
        if body.mode in (FlightMode.BRAKE, FlightMode.LOITER) and body.in_air and body.destination is not None:
            body.shift_east(0.015)  # with each of some fifty messages a second

    _each_tick(vehicle, act)


def _delayed(vehicle: VirtualVehicle, is_late: Callable[[Any], bool], late_us: int) -> None:
    """Some frames are delayed by this much, and others overtake them."""
    late: deque[tuple[int, bytes]] = deque()

    def change(frame: Any, octets: bytes) -> Sequence[bytes]:
        now_us = vehicle.clock.elapsed_us
        out = [] if is_late(frame) else [octets]
        if not out:
            late.append((now_us + late_us, octets))
        while late and late[0][0] <= now_us:
            out.append(late.popleft()[1])
        return out

    _filtered(vehicle, change)


def late_heartbeat(vehicle: VirtualVehicle) -> None:
    _delayed(vehicle, lambda frame: frame.name == "HEARTBEAT" and frame.component == 1, SECOND)


def seldom_heartbeat(vehicle: VirtualVehicle) -> None:
    """HEARTBEAT is not sent on request, only once a second."""
    last = [0]

    def change(frame: Any, octets: bytes) -> Sequence[bytes]:
        if frame.name != "HEARTBEAT" or frame.component != 1:
            return [octets]
        now_us = vehicle.clock.elapsed_us
        if now_us - last[0] < SECOND:
            return []
        last[0] = now_us
        return [octets]

    _filtered(vehicle, change)


def fence_switched_off(vehicle: VirtualVehicle) -> None:
    autopilot = _of(vehicle)

    def act() -> None:
        if autopilot.vehicle.in_air:
            autopilot.parameters.assign("FENCE_ENABLE", 0)

    _each_tick(vehicle, act)


def fence_that_keeps_other_items(vehicle: VirtualVehicle) -> None:
    """It accepts the upload but stores nothing."""

    def change(frame: Any, octets: bytes) -> Sequence[bytes]:
        return [] if frame.name == "MISSION_COUNT" else [octets]

    _filtered(vehicle, change)


def silent_mode_change(vehicle: VirtualVehicle) -> None:
    """Its heartbeat never reports a return."""
    reports = _of(vehicle).reports
    build = reports._build[HEARTBEAT]
    kept: list[int] = []

    def heartbeat() -> Any:
        told = copy(build())
        if _of(vehicle).vehicle.mode in (FlightMode.RETURN, FlightMode.LAND) and kept:
            told.custom_mode = kept[-1]
        else:
            kept.append(told.custom_mode)
        return told

    reports._build[HEARTBEAT] = heartbeat


def target_never_told(vehicle: VirtualVehicle) -> None:
    vehicle.simulation.inject(MessageSilence(0, "POSITION_TARGET_GLOBAL_INT"))


def slow_climb(vehicle: VirtualVehicle) -> None:
    body = _of(vehicle).vehicle
    rate = body._climb_rate
    body._climb_rate = lambda north, east: min(rate(north, east), 0.7)


def fast_leg(vehicle: VirtualVehicle) -> None:
    """It flies at twice the commanded speed."""
    body = _of(vehicle).vehicle
    of = type(body)
    body.__class__ = type("Fast", (of,), {"speed": property(lambda self: 8.0, lambda self, value: None)})


def return_that_does_not_move(vehicle: VirtualVehicle) -> None:
    body = _of(vehicle).vehicle
    body.return_home = body.hold


def return_that_does_not_climb(vehicle: VirtualVehicle) -> None:
    """Ignores its parameters."""
    _of(vehicle).vehicle.handling.return_height = lambda handling, away, up: up


def landing_that_does_not_descend(vehicle: VirtualVehicle) -> None:
    body = _of(vehicle).vehicle
    body.land_here = body.hold


def answers_that_never_come(vehicle: VirtualVehicle) -> None:
    def change(frame: Any, octets: bytes) -> Sequence[bytes]:
        lost = frame.name == "COMMAND_ACK" and frame.message.command not in ASKED
        return [] if lost else [octets]

    _filtered(vehicle, change)


def answers_that_come_late(vehicle: VirtualVehicle) -> None:
    _delayed(vehicle, lambda frame: frame.name == "COMMAND_ACK" and frame.message.command not in ASKED, 2 * SECOND)


def stream_at_a_third(vehicle: VirtualVehicle) -> None:
    count = [0]

    def change(frame: Any, octets: bytes) -> Sequence[bytes]:
        if frame.name != "EXTENDED_SYS_STATE":
            return [octets]
        count[0] += 1
        return [octets] if count[0] % 3 == 0 else []

    _filtered(vehicle, change)


def returns_when_we_are_silent(vehicle: VirtualVehicle) -> None:
    """It treats two seconds of silence of the companion as a loss of its ground station."""
    heard = [0]
    body = _of(vehicle).vehicle
    advance = vehicle.simulation.advance

    def lose(_: bytes) -> bool:
        heard[0] = vehicle.clock.elapsed_us
        return False

    def act(to_us: int) -> list[bytes]:
        if body.in_air and to_us - heard[0] > 2 * SECOND:
            body.set_mode(FlightMode.RETURN)
        return advance(to_us)

    vehicle.lose = lose
    vehicle.simulation.advance = act  # type: ignore[method-assign]


def silent_version(vehicle: VirtualVehicle) -> None:
    def change(frame: Any, octets: bytes) -> Sequence[bytes]:
        return [] if frame.name == "AUTOPILOT_VERSION" else [octets]

    _filtered(vehicle, change)
