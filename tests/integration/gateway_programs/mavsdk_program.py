"""A MAVSDK program (the package `mavsdk`, 4.1 and later): `mavsdk_program.py ADDRESS ACTIONS`.

ACTIONS is a JSON list, such as [["takeoff", 8], ["goto", 47.4, 8.5, 10], ["land"]], with heights above home. For each
it prints one JSON line: whether the call succeeded, and what a user of the program reads. It imports no code of the
project.
"""

import json
import sys
import time
from collections.abc import Callable
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action, ActionError
from mavsdk.plugins.telemetry import Telemetry

LIMIT_S = 90.0


class Program:
    """One vehicle at one address, and its last telemetry."""

    def __init__(self, address: str) -> None:
        self._mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
        self._mavsdk.add_any_connection(address)
        system = self._mavsdk.first_autopilot(LIMIT_S)
        assert system is not None, "no vehicle"
        self.action, self.telemetry = Action(system), Telemetry(system)
        self.texts: list[str] = []
        self.telemetry.subscribe_status_text(lambda said, _: self.texts.append(said.text))
        for set_rate in (self.telemetry.set_rate_position, self.telemetry.set_rate_home):
            set_rate(4.0)
        self.until(
            lambda: self.telemetry.health().is_global_position_ok and self.telemetry.health().is_home_position_ok
        )

    def until(self, wanted: Callable[[], bool]) -> None:
        """Wait until telemetry shows it."""
        end_s = time.monotonic() + LIMIT_S
        while not wanted():
            assert time.monotonic() < end_s, "not seen"
            time.sleep(0.1)

    def height(self) -> float:
        """Metres above home."""
        return float(self.telemetry.position().relative_altitude_m)

    def takeoff(self, height: float) -> None:
        """Arm, take off, and wait for the height."""
        self.action.set_takeoff_altitude(height)
        self.action.arm()
        self.action.takeoff()
        self.until(lambda: self.height() > height - 1.5)

    def goto(self, latitude: float, longitude: float, height: float) -> None:
        """Go to a place and wait for the arrival."""
        ground = self.telemetry.home().absolute_altitude_m
        self.action.goto_location(latitude, longitude, ground + height, 0.0)

        def arrived() -> bool:
            at = self.telemetry.position()
            return abs(at.latitude_deg - latitude) < 4e-5 and abs(at.longitude_deg - longitude) < 6e-5

        self.until(arrived)

    def land(self) -> None:
        """Land and wait for the motors to stop."""
        self.action.land()
        self.until(lambda: not self.telemetry.armed())


def main() -> None:
    """Carry out the actions."""
    program = Program(sys.argv[1])
    for name, *values in json.loads(sys.argv[2]):
        program.texts.clear()
        said: list[Any] = []
        try:
            getattr(program, name)(*values)
        except ActionError as error:
            said.append(str(error))
            time.sleep(0.5)
        print(json.dumps({"action": name, "succeeded": not said, "reads": [*said, *program.texts]}), flush=True)


if __name__ == "__main__":
    main()
