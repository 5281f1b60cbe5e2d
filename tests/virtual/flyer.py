"""A driver that flies the simulated vehicle in virtual time, without a runtime."""

from functools import cache
from typing import Any

from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Command, CommandFailed, Event, Readings, Ready, Succeeded, TakenOver
from rtshcua.simulation.config import AutopilotKind, SimulationConfig
from rtshcua.virtual.vehicle import SECOND, VirtualVehicle
from virtual.policy import POLICY, geo


class Flyer:
    """Begins commands and stores every event."""

    def __init__(self, flavour: str, *, return_mm: int = 22_000, **config: Any) -> None:
        """Return a vehicle with a low return, to shorten flights."""
        self.vehicle = VirtualVehicle(
            POLICY, SimulationConfig(flavour=AutopilotKind(flavour), return_mm=return_mm, **config)
        )
        self.events: list[Event] = []
        self.token = 0

    @property
    def now_us(self) -> int:
        return self.vehicle.clock.now().monotonic_us

    @property
    def truth(self) -> Any:
        return self.vehicle.simulation.truth()

    def wait(self, seconds: float) -> list[Event]:
        """Advance and return the events."""
        before = len(self.events)
        end_us = self.now_us + round(seconds * SECOND)
        while self.now_us < end_us:
            self.events += self.vehicle.poll(self.now_us, end_us - self.now_us)
        return self.events[before:]

    def until(self, kind: type[Event] | tuple[type[Event], ...], seconds: float = 300) -> Any:
        """Advance until an event of the kind comes."""
        end_us = self.now_us + round(seconds * SECOND)
        while self.now_us < end_us:
            new = self.vehicle.poll(self.now_us, SECOND)
            self.events += new
            found = [event for event in new if isinstance(event, kind)]
            if found:
                return found[0]
        raise AssertionError(
            f"no {kind} in {seconds} s; {self.truth}; {[e for e in self.events if not isinstance(e, Readings)]}"
        )

    def begin(
        self, kind: MotionKind, *points: tuple[int, int], altitude: int = 0, speed: int = 0, hold_us: int = 0,
        heights: tuple[int, ...] = (), headings: tuple[int, ...] = (),
    ) -> int:  # fmt: skip
        """Start a command and return its token."""
        self.token += 1
        path = tuple(part for point in points for part in point)
        command = Command(
            self.token, kind.name.lower(), kind, path, geo(*points), altitude, speed, hold_us,
            heights=heights, headings=headings,
        )  # fmt: skip
        self.vehicle.begin(command, self.now_us)
        return self.token

    def fly(self, kind: MotionKind, *points: tuple[int, int], seconds: float = 300, **more: Any) -> Any:
        """Start a command and wait for its end."""
        token = self.begin(kind, *points, **more)
        end = self.until((Succeeded, CommandFailed, TakenOver), seconds)
        assert isinstance(end, TakenOver) or end.token == token
        return end

    def up(self, altitude: int = 20_000) -> "Flyer":
        """Wait until ready, and climb."""
        self.until(Ready)
        end = self.fly(MotionKind.CLIMB, altitude=altitude)
        assert isinstance(end, Succeeded), end
        return self


@cache
def climbed(flavour: str, altitude: int) -> Flyer:
    """Return a flyer in the air. Copy it before flying on."""
    return Flyer(flavour).up(altitude)
