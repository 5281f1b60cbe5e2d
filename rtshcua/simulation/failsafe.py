"""The autopilot's own failsafes: low battery and lost position."""

from collections.abc import Callable
from dataclasses import dataclass

from rtshcua.model.faults import FlightMode
from rtshcua.simulation.battery import Battery
from rtshcua.simulation.modes import NEEDS_POSITION
from rtshcua.simulation.sensors import Sensors
from rtshcua.simulation.vehicle import Multirotor

LOW_TO_LAND = 0.04
"""The battery level at which the autopilot lands."""
_LOW_VOLTAGE_S = 10.0
"""How long the voltage must be low before the failsafe acts."""
_MEASURES_S = 0.5
"""How often the voltage is checked."""
_BACK_S = 0.6
"""How long the position must be back before the failsafe ends."""

Text = tuple[int, str]
"""Severity and text."""


@dataclass(frozen=True, slots=True)
class FailsafeRules:
    """The texts and delays of a flavour."""

    position: tuple[Text, ...]
    """Sent when it lands because its position is lost."""
    level: Text
    """Sent when it lands because the battery is empty."""
    position_after_s: float = 0.0
    """The delay from the loss of the estimate to landing."""
    land_pause_s: float = 0.0
    """How long it hovers before it descends."""
    position_back: Text | None = None
    low_voltage: str | None = None
    """The parameter that holds the low-voltage threshold."""
    low_action: str | None = None
    """The parameter that selects the low-voltage action: 0 none, 1 land, 2 return."""
    low_text: str = ""


class Failsafes:
    """The failsafes of one vehicle. `parameter` reads a parameter, `say` sends a text, `enter` changes the mode."""

    def __init__(
        self,
        rules: FailsafeRules,
        vehicle: Multirotor,
        sensors: Sensors,
        battery: Battery,
        parameter: Callable[[str], float],
        say: Callable[[int, str], None],
        enter: Callable[[FlightMode], None],
    ) -> None:
        self._rules = rules
        self._vehicle = vehicle
        self._sensors = sensors
        self._battery = battery
        self._parameter = parameter
        self._say = say
        self._enter = enter
        self._without_s = self._low_s = self._back_s = self._measured_s = 0.0
        self._lands_blind = False
        self.low_voltage = False
        """Whether the low-voltage failsafe has triggered."""

    def step(self, dt: float) -> None:
        """Advance by `dt` seconds."""
        vehicle, battery = self._vehicle, self._battery
        self._measured_s += dt
        if self._measured_s >= _MEASURES_S:
            self._watch_voltage(self._measured_s)
            self._measured_s = 0.0
        if not vehicle.armed or not vehicle.in_air:
            self._lands_blind = False
            return
        if not self._lands_blind and self._sensors.has_position:
            self._without_s = 0.0
        else:
            self._watch_position(dt)
        if battery.level <= LOW_TO_LAND and vehicle.mode is not FlightMode.LAND:
            self._say(*self._rules.level)
            self._enter(FlightMode.LAND)

    def _watch_position(self, dt: float) -> None:
        has_position = self._sensors.has_position
        self._without_s = 0.0 if has_position else self._without_s + dt
        self._back_s = self._back_s + dt if has_position else 0.0
        if self._without_s > self._rules.position_after_s and self._vehicle.mode in NEEDS_POSITION:
            for text in self._rules.position:
                self._say(*text)
            self._enter(FlightMode.LAND)
            self._vehicle.blind = True
            self._vehicle.wait(self._rules.land_pause_s)
            self._lands_blind = True
        elif self._lands_blind and self._back_s >= _BACK_S:
            self._lands_blind = False
            if self._rules.position_back is not None:
                self._say(*self._rules.position_back)

    def _watch_voltage(self, dt: float) -> None:
        rules = self._rules
        if rules.low_voltage is None or rules.low_action is None or self.low_voltage:
            return
        volts = self._battery.millivolts / 1000
        self._low_s = self._low_s + dt if volts < self._parameter(rules.low_voltage) else 0.0
        if self._low_s >= _LOW_VOLTAGE_S:
            self.low_voltage = True
            self._say(4, f"Battery 1 is low {volts:.2f}V used {self._battery.used_mah:.0f} mAh")
            self._say(4, rules.low_text)
            mode = {1: FlightMode.LAND, 2: FlightMode.RETURN}.get(round(self._parameter(rules.low_action)))
            if mode is not None and self._vehicle.in_air:
                self._enter(mode)
