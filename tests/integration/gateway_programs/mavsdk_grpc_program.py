"""A MAVSDK program by gRPC (`mavsdk-grpc`): `mavsdk_grpc_program.py ADDRESS ACTIONS`, as `mavsdk_program.py`."""

import asyncio
import json
import os
import socket
import sys
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from typing import TypeVar

from mavsdk_grpc import System
from mavsdk_grpc.action import ActionError

LIMIT_S = 90.0
T = TypeVar("T")


async def seen(stream: AsyncGenerator[T, None], wanted: Callable[[T], bool]) -> T:
    """The first value of a stream that is wanted."""
    async with asyncio.timeout(LIMIT_S), aclosing(stream):
        async for value in stream:
            if wanted(value):
                return value
    raise AssertionError("the stream ended")


class Program:
    """One vehicle, and its last texts."""

    def __init__(self) -> None:
        with socket.socket() as probe:  # several programs at once: each with a server of its own
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        self.vehicle = System(port=port)
        self.texts: list[str] = []

    async def connect(self, address: str) -> None:
        """Wait for the vehicle and its position."""
        await self.vehicle.connect(system_address=address)
        await seen(self.vehicle.core.connection_state(), lambda state: state.is_connected)
        self.telemetry, self.action = self.vehicle.telemetry, self.vehicle.action
        await self.telemetry.set_rate_position(4.0)
        await self.telemetry.set_rate_home(4.0)
        self.listening = asyncio.create_task(self.listen())
        await seen(self.telemetry.health(), lambda health: health.is_global_position_ok and health.is_home_position_ok)

    async def listen(self) -> None:
        """Keep the texts of the vehicle."""
        async for said in self.telemetry.status_text():
            self.texts.append(said.text)

    async def takeoff(self, height: float) -> None:
        """Arm, take off, and wait for the height."""
        await self.action.set_takeoff_altitude(height)
        await self.action.arm()
        await self.action.takeoff()
        await seen(self.telemetry.position(), lambda at: at.relative_altitude_m > height - 1.5)

    async def goto(self, latitude: float, longitude: float, height: float) -> None:
        """Go to a place and wait for the arrival."""
        home = await seen(self.telemetry.home(), lambda _: True)
        await self.action.goto_location(latitude, longitude, home.absolute_altitude_m + height, 0.0)
        await seen(
            self.telemetry.position(),
            lambda at: abs(at.latitude_deg - latitude) < 4e-5 and abs(at.longitude_deg - longitude) < 6e-5,
        )

    async def land(self) -> None:
        """Land and wait for the motors to stop."""
        await self.action.land()
        await seen(self.telemetry.armed(), lambda armed: not armed)


async def main() -> None:
    """Carry out the actions."""
    program = Program()
    await program.connect(sys.argv[1])
    for name, *values in json.loads(sys.argv[2]):
        program.texts.clear()
        said: list[str] = []
        try:
            await getattr(program, name)(*values)
        except ActionError as error:
            said.append(str(error))
            await asyncio.sleep(0.5)
        print(json.dumps({"action": name, "succeeded": not said, "reads": [*said, *program.texts]}), flush=True)
    os._exit(0)  # a thread that reads the server's output would wait for it; the server ends with our process group


if __name__ == "__main__":
    asyncio.run(main())
