"""The autopilot's loop: it runs in step with the world, unless it is halted."""

from rtshcua.simulation.autopilot import TICK_US, Autopilot


class Loop:
    """Lets an autopilot's time pass tick by tick; while it is halted the autopilot stands still, its clock too."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self.now_us = 0
        """How far the world's time has come."""
        self.halted = False

    def halt(self) -> None:
        """From now on the autopilot does nothing."""
        self.halted = True

    def resume(self) -> None:
        """From now on it goes on where it was."""
        self.halted = False

    def tick(self) -> None:
        """Lets `TICK_US` pass."""
        self.now_us += TICK_US
        if not self.halted:
            self._autopilot.tick()
