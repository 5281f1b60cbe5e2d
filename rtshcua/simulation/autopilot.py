"""The autopilot: vehicle, battery, sensors, air and settings in one place, and what a flavour makes of them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from random import Random

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.mavlink.frames import Message
from rtshcua.simulation.battery import Battery
from rtshcua.simulation.command import Command
from rtshcua.simulation.config import SimulationConfig
from rtshcua.simulation.modes import NEEDS_POSITION, Mode, ModeTable
from rtshcua.simulation.parameters import Parameter, Parameters
from rtshcua.simulation.sensors import Sensors
from rtshcua.simulation.streams import Streams
from rtshcua.simulation.vehicle import Event, Handling, Vehicle
from rtshcua.simulation.wind import Air

TICK_US = 20_000
_TICK_S = TICK_US / 1_000_000
_LOW_TO_ARM = 0.08
LOW_TO_LAND = 0.04
"""The battery level at which the autopilot lands by itself."""
_TEXT_LENGTH = 50

Handler = Callable[["Autopilot", Command], tuple[int, ...]]
"""Obeys a command or refuses it; the results (MAV_RESULT) to acknowledge with, usually one."""
Builder = Callable[["Autopilot"], Message | None]
"""A message with what the vehicle knows now; None if it knows nothing."""


@dataclass(frozen=True, slots=True)
class Flavour:
    """What PX4 and ArduCopter do differently."""

    autopilot: int
    """HEARTBEAT.autopilot (MAV_AUTOPILOT)."""
    modes: ModeTable
    handling: Callable[[SimulationConfig], Handling]
    commands: Mapping[int, Handler]
    on_set_mode: Callable[["Autopilot", int], tuple[int, ...]]
    """Obeys a SET_MODE message with this `custom_mode`."""
    on_position_target: Callable[["Autopilot", Message], None]
    """Obeys SET_POSITION_TARGET_GLOBAL_INT, or does not; there is no answer."""
    on_data_stream: Callable[["Autopilot", int, int], None]
    """Obeys REQUEST_DATA_STREAM: (stream, rate in Hz, 0 to stop)."""
    streams: Mapping[int, int]
    """The streams that run from boot, and their intervals in microseconds."""
    builders: Mapping[int, Builder]
    """Every message that can be streamed or requested."""
    parameters: tuple[Parameter, ...]
    bytewise: bool
    """Whether integer parameters travel as their bytes."""
    texts: Mapping[Event, str]
    gps_failsafe: str
    battery_failsafe: str
    coast_s: float
    """How long the estimator goes on without a fix."""
    texts_need_ground_station: bool
    """Whether STATUSTEXT is sent only once a ground station's heartbeat was seen."""
    target_timeout_us: int | None
    """In GUIDED, how long one position target is good for; then LOITER."""


class Autopilot:
    """One simulated vehicle. `tick` lets time pass; the face hands it messages and collects what it has to say."""

    def __init__(self, flavour: Flavour, config: SimulationConfig) -> None:
        self.flavour = flavour
        self.home = config.home
        self.now_us = 0
        self.link_quality = 10_000
        """What the radio tells of the link, in 1/10000."""
        self.ground_station_seen = False
        self.last_target_us: int | None = None
        self.outbox: list[Message] = []
        self.air = Air(config.wind, Random(f"{config.seed} wind"))
        self.battery = Battery(config.battery / 10_000, config.hover_us / 1_000_000)
        self.sensors = Sensors(Random(f"{config.seed} sensors"), config.noise, flavour.coast_s)
        self.vehicle = Vehicle(flavour.handling(config), flavour.modes.start)
        self.parameters = Parameters(flavour.parameters, self.vehicle.handling, flavour.bytewise)
        self.streams = Streams(flavour.streams)
        self._text_id = 0

    # ----------------------------------------------------------------------------------------------- time

    def tick(self) -> None:
        """Lets `TICK_US` pass."""
        self.now_us += TICK_US
        self.air.step(_TICK_S)
        self.sensors.step(_TICK_S)
        wind = (self.air.north, self.air.east)
        load = self.vehicle.step(_TICK_S, wind, self.sensors.error, powered=self.battery.level > 0)
        self.battery.drain(_TICK_S, load)
        self._watch()
        for event in self.vehicle.events:
            if event in self.flavour.texts:
                self.say(mavlink.MAV_SEVERITY_INFO, self.flavour.texts[event])
        self.vehicle.events.clear()

    def _watch(self) -> None:
        """The autopilot's own failsafes: it takes over, asked by nobody."""
        vehicle = self.vehicle
        if not vehicle.in_air or not vehicle.armed:
            return
        if vehicle.mode in NEEDS_POSITION and not self.sensors.has_position:
            self.say(mavlink.MAV_SEVERITY_CRITICAL, self.flavour.gps_failsafe)
            vehicle.set_mode(Mode.LAND)
        elif vehicle.mode is not Mode.LAND and self.battery.level <= LOW_TO_LAND:
            self.say(mavlink.MAV_SEVERITY_CRITICAL, self.flavour.battery_failsafe)
            vehicle.set_mode(Mode.LAND)
        timeout, last = self.flavour.target_timeout_us, self.last_target_us
        if vehicle.mode is Mode.GUIDED and timeout is not None and (last is None or self.now_us - last > timeout):
            vehicle.set_mode(Mode.LOITER)

    # ---------------------------------------------------------------------------------------------- state

    @property
    def ready(self) -> bool:
        """Whether nothing stands against arming but the mode."""
        return self.sensors.has_position and self.sensors.has_fix and self.battery.level > _LOW_TO_ARM

    def can_enter(self, mode: Mode) -> bool:
        """Whether the mode may be entered now, if the flavour has it."""
        return mode in self.flavour.modes.numbers and (mode not in NEEDS_POSITION or self.sensors.has_position)

    def why_not_ready(self) -> str:
        """The reason for a refusal to arm, for a text."""
        if not self.sensors.booted:
            return "Need Position Estimate"
        return "GPS: bad fix" if not self.sensors.has_fix else "Battery too low"

    @property
    def boot_ms(self) -> int:
        """`time_boot_ms` of many messages."""
        return self.now_us // 1000

    # ------------------------------------------------------------------------------------------- speaking

    def send(self, message: Message | None) -> None:
        """Queues a message for the link."""
        if message is not None:
            self.outbox.append(message)

    def say(self, severity: int, text: str) -> None:
        """Queues STATUSTEXT, in chunks if the text is long (MAVLink 2, `id` and `chunk_seq`)."""
        if self.flavour.texts_need_ground_station and not self.ground_station_seen:
            return
        chunks = [text[at : at + _TEXT_LENGTH] for at in range(0, len(text), _TEXT_LENGTH)]
        if len(chunks) > 1:
            self._text_id = self._text_id % 65_535 + 1
        for number, chunk in enumerate(chunks):
            id_ = self._text_id if len(chunks) > 1 else 0
            self.send(mavlink.MAVLink_statustext_message(severity, chunk.encode(), id_, number))
