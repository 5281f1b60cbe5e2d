"""A typical MAVSDK program: `python mavsdk_flight.py FLAVOUR SERVER-PORT`. It prints each completed action.

It imports no code of the project. Telemetry decides about success, not the result of a call.
"""

import asyncio
import sys
from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import aclosing
from math import cos, nan, radians
from typing import Any, TypeVar

from mavsdk_grpc import System
from mavsdk_grpc.action import ActionError
from mavsdk_grpc.geofence import FenceType, GeofenceData, GeofenceError, Point, Polygon
from mavsdk_grpc.mission import MissionError, MissionItem, MissionPlan
from mavsdk_grpc.mission_raw import MissionItem as RawItem
from mavsdk_grpc.mission_raw import MissionRawError
from mavsdk_grpc.telemetry import FlightMode, LandedState

LIMIT_S = 60.0
WAYPOINT, RELATIVE_INT = 16, 6
M_PER_DEGREE = 111_319.5
RATES = ("position", "home", "in_air", "landed_state", "health", "gps_info", "battery", "velocity_ned")
T = TypeVar("T")


async def seen(stream: AsyncGenerator[T, None], wanted: Callable[[T], bool], limit_s: float = LIMIT_S) -> T:
    """The first value of a stream that is wanted."""
    last: Any = "nothing"
    try:
        async with asyncio.timeout(limit_s), aclosing(stream):
            async for last in stream:
                if wanted(last):
                    return last
    except TimeoutError:
        raise AssertionError(f"not seen in {limit_s} s; last: {last}") from None
    raise AssertionError(f"the stream ended; last: {last}")


async def again(upload: Callable[[], Awaitable[None]], refused: type[Exception]) -> None:
    """Uploads, a few times if need be: the vehicle, whose time runs faster, gives up on a machine that is busy."""
    for left in reversed(range(5)):
        try:
            return await upload()
        except refused:
            if not left:
                raise
    return None


def check(holds: bool, what: object) -> None:
    """Ends the program unless it holds."""
    if not holds:
        raise AssertionError(what)


def done(what: str) -> None:
    """Tells the test."""
    print(what, flush=True)


class Flight:
    """One vehicle, from connection to disarming."""

    def __init__(self, vehicle: System, px4: bool) -> None:
        self.vehicle = vehicle
        self.px4 = px4
        self.action, self.telemetry = vehicle.action, vehicle.telemetry
        self.latitude = self.longitude = self.amsl = 0.0

    async def fly(self) -> None:
        await self.connect()
        await self.set_up()
        await self.fence()
        await self.take_off(8)
        await self.go()
        await self.mission()
        await self.come_back()
        await self.hop()

    def place(self, north: float, east: float) -> tuple[float, float]:
        """Latitude and longitude of a place, in metres from home."""
        return (
            self.latitude + north / M_PER_DEGREE,
            self.longitude + east / M_PER_DEGREE / cos(radians(self.latitude)),
        )

    async def arrive(self, north: float, east: float, up: float) -> None:
        """Waits until the vehicle is within a metre and a half."""
        latitude, longitude = self.place(north, east)
        by = 1.5 / M_PER_DEGREE
        await seen(
            self.telemetry.position(),
            lambda p: (
                abs(p.latitude_deg - latitude) < by
                and abs(p.longitude_deg - longitude) < by * 1.5
                and abs(p.relative_altitude_m - up) < 1.5
            ),
        )

    # ---------------------------------------------------------------------------------------- on the ground

    async def connect(self) -> None:
        await seen(self.vehicle.core.connection_state(), lambda state: state.is_connected)
        done("connected")
        for rate in RATES:  # ArduCopter streams only what is asked for
            await getattr(self.telemetry, f"set_rate_{rate}")(4.0)
        await seen(
            self.telemetry.health(),
            lambda h: h.is_armable and h.is_local_position_ok and h.is_global_position_ok and h.is_home_position_ok,
        )
        home = await seen(self.telemetry.home(), lambda _: True)
        self.latitude, self.longitude, self.amsl = home.latitude_deg, home.longitude_deg, home.absolute_altitude_m
        await seen(self.telemetry.battery(), lambda b: b.remaining_percent > 90)
        version = await self.vehicle.info.get_version()
        check((version.flight_sw_major, version.flight_sw_minor) == ((1, 16) if self.px4 else (4, 7)), version)
        done("healthy")

    async def set_up(self) -> None:
        """Settings: the vehicle shall wait for us on the ground, however slow this machine is, and land fast."""
        param = self.vehicle.param
        if self.px4:
            await param.set_param_float("COM_DISARM_PRFLT", 600.0)
            check(await param.get_param_float("COM_DISARM_PRFLT") == 600.0, "COM_DISARM_PRFLT")
            await param.set_param_float("MPC_LAND_SPEED", 2.0)
            await self.action.set_return_to_launch_altitude(12.0)
            check(await self.action.get_return_to_launch_altitude() == 12.0, "RTL_RETURN_ALT")
        else:
            await param.set_param_int("DISARM_DELAY", 127)
            check(await param.get_param_int("DISARM_DELAY") == 127, "DISARM_DELAY")
            await param.set_param_int("LAND_SPEED", 200)
        every = await param.get_all_params()
        check(len(every.int_params) > 1 and len(every.float_params) > 1, every)
        done("set up")

    async def fence(self) -> None:
        corners = [Point(*self.place(*corner)) for corner in ((-80, -80), (-80, 80), (80, 80), (80, -80))]
        fence = GeofenceData([Polygon(corners, FenceType.INCLUSION)], [])
        await again(lambda: self.vehicle.geofence.upload_geofence(fence), GeofenceError)
        stored = await self.vehicle.geofence.download_geofence()
        check([p.fence_type for p in stored.polygons] == [FenceType.INCLUSION], stored)
        for kept, corner in zip(stored.polygons[0].points, corners, strict=True):
            check(abs(kept.latitude_deg - corner.latitude_deg) < 1e-6, stored)
            check(abs(kept.longitude_deg - corner.longitude_deg) < 1e-6, stored)
        done("fence")

    # ------------------------------------------------------------------------------------------- in the air

    async def take_off(self, up: float) -> None:
        await self.action.set_takeoff_altitude(up)
        check(await self.action.get_takeoff_altitude() == up, "takeoff altitude")
        await self.action.arm()
        await seen(self.telemetry.armed(), lambda armed: armed)
        done("armed")
        await self.action.takeoff()
        await seen(self.telemetry.landed_state(), lambda state: state == LandedState.IN_AIR)
        await self.arrive(0, 0, up)
        done("took off")

    async def go(self) -> None:
        try:
            await self.action.disarm()
            check(False, "disarmed in the air")
        except ActionError:
            done("disarming refused")
        await self.action.goto_location(*self.place(20, 0), self.amsl + 12, 90)
        await self.arrive(20, 0, 12)
        done("went")

    async def mission(self) -> None:
        """Three waypoints: as MAVSDK's own plan for PX4, as raw items with home in slot 0 for ArduCopter."""
        places = [(20, 12), (20, 24), (8, 24)]
        raw = self.vehicle.mission_raw
        if self.px4:
            plan = MissionPlan([self.waypoint(*place, 12) for place in places])
            await self.vehicle.mission.set_return_to_launch_after_mission(False)
            await again(lambda: self.vehicle.mission.upload_mission(plan), MissionError)
        else:
            items = [self.raw(number, *place) for number, place in enumerate([(0, 0), *places])]
            await again(lambda: raw.upload_mission(items), MissionRawError)
        stored = [(item.x, item.y) for item in await raw.download_mission() if item.command == WAYPOINT]
        wanted = [tuple(round(part * 1e7) for part in self.place(*place)) for place in places]
        check(len(stored) == len(wanted) + (not self.px4), stored)
        for kept, place in zip(stored[-3:], wanted, strict=True):
            check(max(abs(kept[0] - place[0]), abs(kept[1] - place[1])) <= 1, (stored, wanted))
        done("mission stored")
        await self.enter(FlightMode.MISSION, raw.start_mission)
        await seen(raw.mission_progress(), lambda p: p.current == p.total > 3)
        await self.arrive(8, 24, 12)
        done("mission flown")

    def waypoint(self, north: float, east: float, up: float) -> MissionItem:
        none, stay = MissionItem.CameraAction.NONE, MissionItem.VehicleAction.NONE
        return MissionItem(*self.place(north, east), up, 6.0, True, nan, nan, none, nan, nan, 2.0, nan, nan, stay)

    def raw(self, number: int, north: float, east: float) -> RawItem:
        latitude, longitude = (round(part * 1e7) for part in self.place(north, east))
        return RawItem(
            number, RELATIVE_INT, WAYPOINT, int(number == 0), 1, 0.0, 2.0, 0.0, nan, latitude, longitude, 12.0, 0
        )

    async def enter(self, mode: FlightMode, ask: Callable[[], Any]) -> None:
        """Asks until the heartbeat shows the mode: PX4 accepts at first, and turns down what it is not ready for."""
        for _ in range(20):
            await ask()
            try:
                await seen(self.telemetry.flight_mode(), lambda shown: shown == mode, 1.0)
                return
            except AssertionError:
                continue
        raise AssertionError(f"it never was in {mode}")

    async def come_back(self) -> None:
        await self.enter(FlightMode.HOLD, self.action.hold)
        await self.enter(FlightMode.RETURN_TO_LAUNCH, self.action.return_to_launch)
        await self.arrive(0, 0, 0)
        await seen(self.telemetry.landed_state(), lambda state: state == LandedState.ON_GROUND)
        done("returned")
        await seen(self.telemetry.armed(), lambda armed: not armed)
        done("disarmed by itself")

    async def hop(self) -> None:
        await self.take_off(5)
        await self.action.land()
        await seen(self.telemetry.landed_state(), lambda state: state == LandedState.ON_GROUND)
        await self.arrive(0, 0, 0)
        done("landed")
        await self.action.disarm()
        await seen(self.telemetry.armed(), lambda armed: not armed)
        done("disarmed")


async def main(flavour: str, port: int) -> None:
    vehicle = System(mavsdk_server_address="127.0.0.1", port=port)
    await vehicle.connect()
    await Flight(vehicle, flavour == "px4").fly()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], int(sys.argv[2])))
