"""Import a plan of QGroundControl with MAVSDK: `python mavsdk_plan.py SERVER-PORT PLAN`. Prints the items as JSON.

It imports no code of the project.
"""

import asyncio
import json
import sys
from typing import Any

from mavsdk_grpc import System

LIMIT_S = 60.0


def item(each: Any) -> list[float | None]:
    """Frame, command and parameters; a place in 1e-7 degree, and null for NaN."""
    values = [each.frame, each.command, each.param1, each.param2, each.param3, each.param4, each.x, each.y, each.z]
    return [None if value != value else value for value in values]


async def imported(port: int, path: str) -> dict[str, list[list[float | None]]]:
    """The items that MAVSDK would upload: of mission, fence and rally points."""
    system = System(mavsdk_server_address="127.0.0.1", port=port)
    await system.connect()
    async for state in system.core.connection_state():
        if state.is_connected:
            break
    found = await system.mission_raw.import_qgroundcontrol_mission(path)
    parts = {"mission": found.mission_items, "fence": found.geofence_items, "rally": found.rally_items}
    return {name: [item(each) for each in items] for name, items in parts.items()}


if __name__ == "__main__":
    print(json.dumps(asyncio.run(asyncio.wait_for(imported(int(sys.argv[1]), sys.argv[2]), LIMIT_S))))
