"""The simulated vehicle's fence: its area, refusals, and each flavour's reaction to a breach."""

import struct
from collections.abc import Callable
from math import inf
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.model.faults import FlightMode
from rtshcua.simulation.config import HOME
from rtshcua.simulation.fence import FenceArea, FenceCircle, FenceLimits, FencePolygon
from rtshcua.simulation.mission_protocol import draws_no_fence, from_message
from rtshcua.simulation.place import Point
from virtual import plans as p
from virtual.rows import rows

Pilots = Callable[..., Any]
SQUARE = FencePolygon(((-10.0, -10.0), (10.0, -10.0), (10.0, 10.0), (-10.0, 10.0)))
NOTCHED = FencePolygon(((-10.0, -10.0), (10.0, -10.0), (10.0, 10.0), (0.0, 0.0), (-10.0, 10.0)))


def set_param(a: Any, name: str, value: float) -> float:
    kind = 9
    replies = a.send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, kind))
    read: float = next(f.message.param_value for f in replies if f.name == "PARAM_VALUE")
    return read


def fenced(a: Any, rows: list[Any], **params: float) -> Any:
    """Upload this fence and wait until it is in force."""
    assert p.upload(a, rows, p.FENCE)[1] == 0
    if not a.px4:
        set_param(a, "FENCE_ENABLE", 1)
        set_param(a, "FENCE_TYPE", 4)
    for name, value in params.items():
        set_param(a, name, value)
    a.wait(0.5)
    return a


def bytewise(value: int) -> float:
    return float(struct.unpack("<f", struct.pack("<i", value))[0])


# ------------------------------------------------------------------------------------------------- geometry


@given(st.floats(-20, 20), st.floats(-20, 20))
def test_square_contains_the_points_within_its_bounds(north: float, east: float) -> None:
    if min(abs(abs(north) - 10), abs(abs(east) - 10)) > 1e-6:
        assert SQUARE.holds(north, east) == (abs(north) < 10 and abs(east) < 10)
    inside = max(abs(north), abs(east)) < 10
    expected = 10 - max(abs(north), abs(east)) if inside else 0
    away = ((max(0, abs(north) - 10)) ** 2 + (max(0, abs(east) - 10)) ** 2) ** 0.5
    assert SQUARE.edge(north, east) == pytest.approx(expected if inside else away, abs=1e-9)


def test_polygon_can_be_concave() -> None:
    assert NOTCHED.holds(-5, 0)
    assert not NOTCHED.holds(1, 9)
    assert not NOTCHED.holds(0, 5)
    assert NOTCHED.holds(5, 4)


@rows(
    ("area", "inside", "outside"),
    [
        (FenceArea(), (500, 500), None),
        (FenceArea((SQUARE,)), (0, 0), (11, 0)),
        (FenceArea((), (SQUARE,)), (11, 0), (9, 0)),
        (FenceArea((SQUARE, FenceCircle((30, 0), 5))), (30, 1), (20, 0)),
        (FenceArea((SQUARE, FenceCircle((0, 0), 5)), every=True), (1, 1), (6, 0)),
        (FenceArea((SQUARE,), (FenceCircle((0, 0), 2),)), (5, 5), (1, 0)),
    ],
)
def test_area_combines_included_and_excluded_shapes(
    area: FenceArea, inside: tuple[float, float], outside: tuple[float, float] | None
) -> None:
    assert area.holds(*inside)
    assert area.outside_by(*inside) == 0
    if outside is not None:
        assert not area.holds(*outside)
        assert area.outside_by(*outside) == pytest.approx(1) or area.outside_by(*outside) > 1


def test_ceiling_limits_the_allowed_height() -> None:
    limits = FenceLimits(FenceArea(), 50)
    assert limits.holds(Point(0, 0, 50))
    assert not limits.holds(Point(0, 0, 50.1))


def test_uploaded_items_become_an_area(pilot: Pilots) -> None:
    a = pilot("px4")
    rows = [
        *p.square(50),
        *p.square(5, 20, 0, command=5002),
        (5003, 0, (30, 0, 0, 0), 0, 90, 0),
        (5004, 0, (3, 0, 0, 0), 0, 0, 0),
        (5000, 0, (0, 0, 0, 0), 0, 0, 0),
    ]
    items = [from_message(p.item(a, row, number, p.FENCE)) for number, row in enumerate(rows)]
    assert not draws_no_fence([item for item in items if item])
    area = FenceArea.of([item for item in items if item], HOME, every=False)
    for place, allowed in {(40, 0): 1, (20, 0): 0, (0, 0): 0, (0, 100): 1, (60, 0): 0, (0, 55): 0}.items():
        assert area.holds(*place) == bool(allowed)


# ------------------------------------------------------------------------------------------------- in flight


def ordered_out(a: Any) -> list[int]:
    """Reposition to 150 m north, at 10 m."""
    latitude, longitude = a.config.home.globe(150, 0)
    up = 10 + (a.config.home.amsl_mm / 1000 if a.px4 else 0)
    result: list[int] = a.int(192, 5 if a.px4 else 6, [-1, 1, 0, float("nan")], latitude, longitude, up)
    return result


def test_target_outside_the_fence_is_refused_or_dropped(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour)
    a.take_off(10)
    fenced(a, p.square(60))
    assert ordered_out(a) == [0 if a.px4 else 4]
    a.target(*a.config.home.globe(150, 0), 10)
    a.wait(6)
    assert abs(a.truth.north_mm) < 2_000
    if a.px4:
        assert any("outside geofence" in text for text in a.texts())


def test_target_outside_is_accepted_right_after_an_upload(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour)
    a.take_off(10)
    if not a.px4:
        set_param(a, "FENCE_ENABLE", 1)
        set_param(a, "FENCE_TYPE", 4)
        a.wait(0.5)
    p.upload(a, p.square(60), p.FENCE)
    assert ordered_out(a) == [0]
    a.until(lambda: a.truth.north_mm > 58_000)
    a.wait(10)
    assert a.truth.mode is (FlightMode.LOITER if a.px4 else FlightMode.RETURN)
    if a.px4:
        assert 59_000 < a.truth.north_mm < 64_000
        assert any(f.name == "HEARTBEAT" and f.message.system_status == 5 for f in a.seen)
    else:
        assert "Polygon fence breached" in a.texts()
        assert a.texts()[-1] in ("Manual recovery started", "Fence breach cleared")
        status = a.last("FENCE_STATUS")
        assert (status.breach_status, status.breach_count, status.breach_type) == (1, 1, 3)
        a.until(lambda: "Fence breach cleared" in a.texts())
        a.until(lambda: not a.truth.armed)


def on_the_way_out(a: Any) -> Any:
    """Fly out of a square of 30 m, with a target from before the fence was in force."""
    assert ordered_out(a) == [0]
    return fenced(a, p.square(30))


@pytest.mark.parametrize(
    ("flavour", "action", "mode"),
    [
        ("px4", 3, FlightMode.RETURN),
        ("px4", 5, FlightMode.LAND),
        ("px4", 2, FlightMode.LOITER),
        ("px4", 1, FlightMode.LOITER),
        ("px4", 0, FlightMode.LOITER),
        ("ardupilot", 0, FlightMode.GUIDED),
        ("ardupilot", 1, FlightMode.RETURN),
        ("ardupilot", 2, FlightMode.LAND),
        ("ardupilot", 4, FlightMode.BRAKE),
    ],
)
def test_breach_triggers_the_configured_action(pilot: Pilots, flavour: str, action: int, mode: FlightMode) -> None:
    a = pilot(flavour)
    a.take_off(10)
    if a.px4:
        replies = a.send(mavlink.MAVLink_param_set_message(1, 1, b"GF_ACTION", bytewise(action), 6))
        assert any(f.name == "PARAM_VALUE" for f in replies)
    else:
        set_param(a, "FENCE_ACTION", action)
    a = on_the_way_out(a)
    a.until(lambda: a.truth.north_mm > 31_000)
    a.wait(1)
    assert a.truth.mode is (FlightMode.LOITER if a.px4 else mode), "PX4 holds for COM_FAIL_ACT_T first"
    a.wait(6)
    assert a.truth.mode is mode
    goes_on = action in ((0, 1) if a.px4 else (0,))
    assert (a.truth.north_mm > 50_000) == goes_on


def test_px4_takeover_during_hold_cancels_the_return(pilot: Pilots) -> None:
    a = pilot("px4")
    a.take_off(10)
    a.send(mavlink.MAVLink_param_set_message(1, 1, b"GF_ACTION", bytewise(3), 6))
    a = on_the_way_out(a)
    a.until(lambda: a.truth.north_mm > 31_000)
    a.wait(1)
    assert set(a.mode(FlightMode.POSITION)) == {0}
    a.wait(10)
    assert a.truth.mode is FlightMode.POSITION


def test_px4_breach_can_terminate_the_flight(pilot: Pilots) -> None:
    a = pilot("px4")
    a.take_off(10)
    a.send(mavlink.MAVLink_param_set_message(1, 1, b"GF_ACTION", bytewise(4), 6))
    on_the_way_out(a)
    a.until(lambda: not a.truth.armed)
    a.until(lambda: not a.truth.in_air)


def test_commands_during_a_breach_are_obeyed(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour)
    a.take_off(10)
    on_the_way_out(a)
    a.until(lambda: a.truth.north_mm > 31_000)
    a.wait(1)
    a.mode(FlightMode.LOITER)
    a.wait(1)
    assert a.truth.mode is FlightMode.LOITER
    if not a.px4:
        assert a.texts().count("Manual recovery started") == 2
    a.wait(12)
    assert a.truth.mode is FlightMode.LOITER


def test_arducopter_lands_far_outside_the_fence(pilot: Pilots) -> None:
    a = pilot("ardupilot")
    a.take_off(10)
    a.go_to(140, 0, 10)
    a.until(lambda: a.truth.north_mm > 138_000)
    fenced(a, p.square(30))
    a.wait(1)
    assert a.truth.mode is FlightMode.LAND


def test_arducopter_checks_height_and_circle(pilot: Pilots) -> None:
    a = pilot("ardupilot")
    a.take_off(10)
    set_param(a, "FENCE_ENABLE", 1)
    set_param(a, "FENCE_ALT_MAX", 20)
    a.go_to(0, 0, 19)
    a.wait(10)
    assert a.truth.mode is FlightMode.GUIDED
    a.go_to(0, 0, 30)  # refused
    a.wait(10)
    assert a.truth.up_mm < 20_000
    set_param(a, "FENCE_ALT_MAX", 15)
    a.wait(1)
    assert a.truth.mode is FlightMode.RETURN
    assert "Max Alt fence breached" in a.texts()
    assert a.last("FENCE_STATUS").breach_type == 2
    b = pilot("ardupilot")
    b.take_off(10)
    b.go_to(60, 0, 10)
    b.until(lambda: b.truth.north_mm > 58_000)
    set_param(b, "FENCE_RADIUS", 40)
    set_param(b, "FENCE_ENABLE", 1)
    b.wait(1)
    assert "Circle fence breached" in b.texts()


def test_px4_checks_circle_and_height(pilot: Pilots) -> None:
    a = pilot("px4")
    a.take_off(10)
    set_param(a, "GF_MAX_HOR_DIST", 40)
    a.wait(0.5)
    assert ordered_out(a) == [0]
    a.wait(3)
    assert a.truth.north_mm < 2_000
    set_param(a, "GF_MAX_HOR_DIST", 0)
    set_param(a, "GF_MAX_VER_DIST", 8)
    a.wait(1)
    assert "Failsafe activated: switching to Hold\t" in a.texts()


def test_disabled_or_absent_fence_has_no_effect(pilot: Pilots) -> None:
    a = pilot("ardupilot")
    a.take_off(10)
    p.upload(a, p.square(5), p.FENCE)
    a.wait(1)
    assert ordered_out(a) == [0]
    a.until(lambda: a.truth.north_mm > 40_000)
    assert a.truth.mode is FlightMode.GUIDED


def test_arming_outside_the_fence_is_refused(pilot: Pilots, flavour: str) -> None:
    a = fenced(pilot(flavour).ready(), p.square(20, 100, 0))
    if not a.px4:
        a.mode(FlightMode.GUIDED)
    assert a.arm() == [1 if a.px4 else 4]
    assert any("ence" in text for text in a.texts())
    assert not a.last("SYS_STATUS").onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK if a.px4 else 1


def test_px4_status_does_not_report_the_fence(pilot: Pilots) -> None:
    a = fenced(pilot("px4").ready(), p.square(20))
    assert not a.last("SYS_STATUS").onboard_control_sensors_present & mavlink.MAV_SYS_STATUS_GEOFENCE


def test_arducopter_status_reports_the_fence(pilot: Pilots) -> None:
    a = pilot("ardupilot")
    a.take_off(10)
    a.long(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_SYS_STATUS, 200_000)
    bit = mavlink.MAV_SYS_STATUS_GEOFENCE

    def shown() -> tuple[bool, bool]:
        a.wait(1)
        status = a.last("SYS_STATUS")
        return bool(status.onboard_control_sensors_enabled & bit), bool(status.onboard_control_sensors_health & bit)

    assert shown() == (False, True)
    p.upload(a, p.square(30), p.FENCE)
    set_param(a, "FENCE_ACTION", 0)
    assert a.long(mavlink.MAV_CMD_DO_FENCE_ENABLE, 1) == [0]
    assert shown() == (True, True)
    p.upload(a, p.square(30, north=200), p.FENCE)
    assert shown() == (True, False)
    assert a.long(mavlink.MAV_CMD_DO_FENCE_ENABLE, 0) == [0]
    assert shown() == (False, True)
    assert a.long(mavlink.MAV_CMD_DO_FENCE_ENABLE, 7) == [4]


def test_absent_ceiling_is_infinite() -> None:
    assert FenceLimits().ceiling == inf


def test_px4_circle_applies_in_addition_to_areas(pilot: Pilots) -> None:
    """`Geofence::checkPointAgainstAllGeofences`."""
    a = fenced(pilot("px4"), p.square(500), GF_MAX_HOR_DIST=40)
    a.take_off(10)
    assert ordered_out(a) == [0]
    a.wait(5)
    assert a.truth.north_mm < 2_000
    set_param(a, "GF_MAX_HOR_DIST", 400)
    a.wait(0.5)
    assert ordered_out(a) == [0]
    a.until(lambda: a.truth.north_mm > 20_000)
