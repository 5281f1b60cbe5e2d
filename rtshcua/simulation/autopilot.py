"""The autopilot: vehicle, battery, sensors, air and settings, and the interface of its flavours."""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from enum import StrEnum
from functools import partial
from math import inf, sin
from random import Random
from types import MappingProxyType
from typing import NamedTuple, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Message
from rtshcua.mavlink.layouts import TEXT_OCTETS
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.answers import Lanes
from rtshcua.simulation.battery import Battery
from rtshcua.simulation.camera import Shot, SimulatedCamera
from rtshcua.simulation.command import VehicleCommand
from rtshcua.simulation.config import Answers, Boot, Equipment, Estimate, Purpose, SimulationConfig
from rtshcua.simulation.failsafe import FailsafeRules, Failsafes
from rtshcua.simulation.fence import Breach, FenceRules, FenceWatch
from rtshcua.simulation.gimbal import SimulatedGimbal
from rtshcua.simulation.handling import Handling
from rtshcua.simulation.kinematics import Body
from rtshcua.simulation.mission import MissionProgress, MissionRules
from rtshcua.simulation.mission_protocol import MISSION, PlanItem, Plans, Transfer, TransferRules
from rtshcua.simulation.modes import NEEDS_POSITION, ModeTable
from rtshcua.simulation.parameters import AutopilotParameter, Parameters
from rtshcua.simulation.place import HomePosition, Point
from rtshcua.simulation.sensors import FAST_S, BootPlan, Sensors
from rtshcua.simulation.signing import VehicleSigning
from rtshcua.simulation.streams import Reports, Streams
from rtshcua.simulation.surroundings import Air, Surroundings
from rtshcua.simulation.vehicle import Landed, Multirotor, VehicleEvent

TICK_US = 20_000
_TICK_S = TICK_US / 1_000_000
_RIPPLE = 0.01
"""Amplitude of the variation of the wind estimate, m/s."""
LOW_TO_ARM = 0.08
"""The battery level below which arming is refused."""
OFF_US = 1_500_000
"""Silence after a restart: the first frame comes one to two seconds later (recorded)."""
_REMIND_FIRST_US, _REMIND_US = 1_200_000, 30_000_000
SYSTEM_PARAMETERS = ("MAV_SYS_ID", "SYSID_THISMAV")
"""The parameters that hold the vehicle's own system id."""


Handler = Callable[["Autopilot", VehicleCommand], tuple[int, ...]]
"""Obeys or refuses a command and returns the results (MAV_RESULT) to acknowledge with, usually one."""
_FEEDS_MOTORS = frozenset({Purpose.FLIGHT, Purpose.PROPULSION})
Builder = Callable[["Autopilot"], Message | None]
"""Builds a message from the current state; None if there is nothing to report."""


class Speaker(Protocol):
    """A second sender under the vehicle's ids, started and ended by a fault (`fault_effects.SecondSender`)."""

    def due(self, autopilot: "Autopilot", system: int, now_us: int) -> list[bytes]:
        """Return the frames that are due by `now_us`."""
        ...


class Taker(StrEnum):
    """Who took the vehicle over from the link."""

    PILOT = "pilot"
    FAILSAFE = "failsafe"


class AutopilotStatus(NamedTuple):
    """The mode, landed state and destination that an autopilot reports."""

    mode: FlightMode
    landed: Landed
    destination: Point | None


class Flavour(ABC):
    """The behaviour in which PX4 and ArduCopter differ."""

    autopilot: int
    """HEARTBEAT.autopilot (MAV_AUTOPILOT)."""
    modes: ModeTable
    commands: Mapping[int, Handler]
    streams: Mapping[int, int]
    """The intervals, in microseconds, of the streams that run from boot."""
    builders: Mapping[int, Builder]
    """Every message that can be streamed or requested."""
    constant: frozenset[int] = frozenset()
    """The messages whose interval cannot be changed."""
    only_streamed: frozenset[int] = frozenset()
    """The messages that REQUEST_MESSAGE refuses."""
    least_us: Mapping[int, int] = MappingProxyType({})
    """The shortest interval of a message, where the flavour has a limit."""
    handling: Handling
    """The default handling; the configuration and parameters may change it."""
    parameters: tuple[AutopilotParameter, ...]
    bytewise: bool
    """Whether integer parameters are encoded bytewise in the float field."""
    texts: Mapping[VehicleEvent, str]
    """Status texts. `{speed}` is the touchdown speed; `{amsl}` and `{up}` the return height above sea and home."""
    boot: BootPlan
    lanes: Lanes
    failsafes: FailsafeRules
    fix: int
    """GPS_RAW_INT.fix_type of a good fix."""
    coast_s: float
    """How long the estimator continues without a fix."""
    speaks_for_payload: bool
    """Whether it triggers the camera and moves the gimbal itself, and answers for them and for any other component."""
    texts_need_ground_station: bool
    """Whether STATUSTEXT is sent only after a ground station's heartbeat."""
    check_text: str
    """The prefix of texts that answer RUN_PREARM_CHECKS."""
    falls_back: bool
    """Whether selecting Position without a position enters Altitude instead of being refused."""
    status_lag_us: tuple[int, int] = (0, 0)
    """How long reports show the previous mode after a mode change: shortest, longest."""
    beats_on_mode: bool
    """Whether a mode change sends a heartbeat at once."""
    reminds: bool
    """Whether it repeats failed arming checks while disarmed."""
    names_batteries: bool
    """Whether BATTERY_STATUS has the function and type of a battery."""
    transfer: TransferRules
    missions: MissionRules
    fence: FenceRules
    key_ahead_us: int = 0
    """How far its time stamps begin ahead of the time that came with the key."""
    target_timeout_us: int | None = None
    """How long a position target is valid in GUIDED; then the mode is LOITER. None: without limit."""
    tells_fence: bool
    """Whether SYS_STATUS has the geofence: always present, enabled if in force, healthy unless breached (recorded)."""

    @abstractmethod
    def arming(self, a: "Autopilot") -> tuple[str, ...]:
        """Return the failed arming checks, apart from the mode; empty if it would arm."""

    @abstractmethod
    def release(self, *, keyed: bool) -> tuple[int, int]:
        """Return the default release; `keyed`: it has a signing key from the start."""

    @abstractmethod
    def obeys_unsigned(self, a: "Autopilot", name: str) -> bool:
        """Return whether a message of this name is obeyed without a valid signature although a key is set."""

    @abstractmethod
    def on_set_mode(self, a: "Autopilot", number: int) -> tuple[int, ...]:
        """Handle SET_MODE with this `custom_mode`; return the results to acknowledge with."""

    @abstractmethod
    def on_position_target(self, a: "Autopilot", message: Message) -> None:
        """Handle SET_POSITION_TARGET_GLOBAL_INT; there is no answer."""

    @abstractmethod
    def on_setup_signing(self, a: "Autopilot", message: Message) -> None:
        """Handle SETUP_SIGNING; there is no answer."""

    @abstractmethod
    def on_breach(self, a: "Autopilot", breach: Breach) -> None:
        """Take the fence's action when a breach begins."""

    @abstractmethod
    def on_sticks(self, a: "Autopilot", for_us: int) -> None:
        """Handle sticks that steer it east for so many microseconds."""

    # The hooks below do nothing unless a flavour overrides them.

    def home_item(self, home: HomePosition) -> PlanItem | None:
        """Return the item in slot 0 of every mission, if the flavour reserves it for home."""
        return None

    def on_data_stream(self, a: "Autopilot", stream: int, rate_hz: int) -> None:  # noqa: B027
        """Handle REQUEST_DATA_STREAM (rate in Hz, 0 to stop). PX4 ignores it: its streams run by default."""

    def on_local_target(self, a: "Autopilot", message: Message) -> None:  # noqa: B027
        """Handle SET_POSITION_TARGET_LOCAL_NED. PX4, which obeys it in OFFBOARD only, is not simulated to."""

    def on_entered(self, a: "Autopilot") -> None:  # noqa: B027
        """React to a mode change."""

    def on_plan(self, a: "Autopilot", kind: int) -> None:  # noqa: B027
        """React to a stored plan of this kind (MAV_MISSION_TYPE)."""

    def on_mode_in_breach(self, a: "Autopilot") -> None:  # noqa: B027
        """React to a mode change while the fence is breached."""

    def on_breach_cleared(self, a: "Autopilot") -> None:  # noqa: B027
        """React to the end of a breach."""


def _sensors(flavour: Flavour, config: SimulationConfig) -> Sensors:
    pace = flavour.boot.all_s / FAST_S if config.boot is Boot.FAST else 1.0
    real = config.estimate is Estimate.REAL
    return Sensors(
        Random(f"{config.seed} sensors"), config.noise, flavour.coast_s, flavour.boot, pace,
        late=real, strays=config.noise and real,
    )  # fmt: skip


def _handling(flavour: Flavour, config: SimulationConfig) -> Handling:
    return replace(
        flavour.handling, cruise=config.cruise_mm_s / 1000, max_speed=config.max_speed_mm_s / 1000,
        return_up=config.return_mm / 1000,
        land_speed=flavour.handling.land_speed if config.land_mm_s is None else config.land_mm_s / 1000,
    )  # fmt: skip


class Autopilot:
    """One simulated autopilot. `tick` advances time; `Face` passes messages in and collects messages out."""

    def __init__(self, flavour: Flavour, config: SimulationConfig) -> None:
        self.flavour = flavour
        self.home = config.home
        self.system = config.system
        self.usb = config.usb
        self.release = config.release or flavour.release(keyed=config.signing_key is not None)
        self.utc_us = config.utc_us
        self.speed = config.speed
        self.now_us = 0
        self.since_us = 0
        """Time since the last tick: messages arrive and are answered between ticks."""
        self.off_us = 0
        """Remaining silence of a restart."""
        self.taker: Taker | None = None
        """Who first took the vehicle over in flight, if anyone."""
        self.voices: list[Speaker] = []
        """Other senders under its ids."""
        self.extras = config.extras
        self.link_quality = 10_000
        """The link quality that the radio reports, in 1/10000."""
        self.outbox: list[Message] = []
        self.air = Air(config.wind, Random(f"{config.seed} wind"))
        self.looked_down = False
        """Whether the last DISTANCE_SENSOR was from the downward range finder."""
        hover_s, others = config.hover_us / 1_000_000, config.other_batteries
        self.battery = Battery(config.battery / 10_000, hover_s)
        #: by id: what a battery feeds, and the battery
        self.batteries = [(Purpose.FLIGHT, self.battery)]
        self.batteries += [(each.purpose, Battery(each.level / 10_000, hover_s)) for each in others]
        self.battery_reports = 0
        #: by id: the shortest report interval, and the time of the last report
        self.battery_every_us = [0, *(each.every_us for each in others)]
        self.battery_told_us: dict[int, int] = {}
        self.gauge_rise = config.gauge_rise
        """Percent by which every fifth report overstates the charge."""
        self._fast = config.boot is Boot.FAST
        self.sensors = _sensors(flavour, config)
        self._phases = Random(f"{config.seed} phases") if config.answers is Answers.RECORDED else None
        self._lags = Random(f"{config.seed} lags") if config.answers is Answers.RECORDED else None
        self._lag_us = flavour.status_lag_us if config.mode_lag_us is None else (config.mode_lag_us,) * 2
        self.surroundings = Surroundings()
        handling = _handling(flavour, config)
        self.vehicle = Multirotor(handling, flavour.modes.start)
        self.vehicle.ceiling = inf if config.ceiling_mm is None else config.ceiling_mm / 1000
        self.parameters = Parameters(flavour.parameters, handling, flavour.bytewise)
        for name in SYSTEM_PARAMETERS:
            self.parameters.assign(name, config.system)
        if config.signing_key is not None:
            self.parameters.assign("MAV_SIGN_CFG", 1)  # the owner's parameters below may override it
        for name, value in config.parameters:
            self.parameters.own(name, value)
        self.gimbal = SimulatedGimbal() if config.gimbal else None
        self.camera = self._camera(config) if config.camera else None
        self.reports = Reports({number: partial(build, self) for number, build in flavour.builders.items()}, self._time)
        self.signing = VehicleSigning(config.signing_key, config.utc_us, config.speed, flavour.key_ahead_us)
        self.plans = Plans()
        self._home_item = flavour.home_item(self.home)
        if self._home_item is not None:
            self.plans.replace(MISSION, (self._home_item,))
        self._start()

    def _camera(self, config: SimulationConfig) -> SimulatedCamera:
        chance, triggered = Random(f"{config.seed} camera"), self.flavour.speaks_for_payload
        camera = SimulatedCamera(
            chance, self._body, self._where, self.gimbal, config.utc_us, triggered=triggered
        )  # fmt: skip
        if triggered:
            camera.report = self._tell_picture
        return camera

    def _tell_picture(self, shot: Shot) -> None:
        """Report the shutter's feedback; there is none of a picture that was not taken."""
        if shot.stored and not self.off_us:
            self.send(self.flavour.builders[mavlink.MAVLINK_MSG_ID_CAMERA_FEEDBACK](self))

    def _body(self) -> Body:
        return self.vehicle.body

    def _start(self) -> None:
        """Initialise the state that each restart resets. Stored state and the world are in `__init__`."""
        flavour = self.flavour
        self.ground_station_seen = False
        self._wind: tuple[float, float] | None = None
        self.last_target_us: int | None = None
        #: a DO_REPOSITION without a mode change, and until when entering Hold flies to it (PX4)
        self.kept: tuple[int, VehicleCommand] | None = None
        self._boot_texts = deque(() if self._fast else flavour.boot.texts)
        self.failsafes = Failsafes(
            flavour.failsafes, self.vehicle, self.sensors, self.battery, self.parameters.value, self.say,
            self._fail_over,
        )  # fmt: skip
        self.streams = Streams(flavour.streams, self._phases)
        self.fence = FenceWatch(flavour.fence, self.plans, self.home, self.parameters.value, self._where, self._time)
        self.mission = MissionProgress(
            flavour.missions, self.plans, self.vehicle, self.home, self.fence.allows, self._where, self.send, self.say
        )
        self.transfer = Transfer(flavour.transfer, self.plans, self.send, self._stored, self._may_clear)
        self.plans.listeners.append(partial(flavour.on_plan, self))
        self._mode_in_breach = self.vehicle.mode
        #: time and mode of a delayed failsafe; cancelled if another mode is entered before
        self.delayed: tuple[int, FlightMode] | None = None
        self._told_mode = self.vehicle.mode
        self._status = self._present
        self._published: deque[tuple[int, AutopilotStatus]] = (
            deque()
        )  # previous states, each with the time until which reports show it
        self._told_danger = False
        self._remind_us = _REMIND_US
        self._text_id = 0

    # ----------------------------------------------------------------------------------------------- time

    def tick(self) -> None:
        """Advance by `TICK_US`."""
        if self.off_us:
            self._stay_off()
            return
        self.now_us += TICK_US
        self.since_us = 0
        self.follow_mode()
        air, sensors, vehicle, battery = self.air, self.sensors, self.vehicle, self.battery
        if air.gusts:
            air.step(_TICK_S)
        sensors.step(_TICK_S)
        wind = (air.north, air.east)
        load = vehicle.step(_TICK_S, wind, sensors.error, battery.level > 0, sensors.estimates)
        self._drain(load)
        if sensors.late:
            sensors.follow(_TICK_S, vehicle.body)
        if self.surroundings.pillars and vehicle.in_air and self.surroundings.is_hit(vehicle.body):
            vehicle.crash()
        self.failsafes.step(_TICK_S)
        if vehicle.mode is FlightMode.GUIDED:
            self._keep_targets()
        self._follow_plans()
        if self._boot_texts:
            self._tell_of_boot()
        self.follow_mode()
        if vehicle.events or vehicle.mode is not self._told_mode:
            self._tell()
        if self.flavour.reminds:
            self._remind()

    def _tell_of_boot(self) -> None:
        sensors = self.sensors
        while self._boot_texts and sensors.age_s >= self._boot_texts[0][0]:
            _, severity, text = self._boot_texts.popleft()
            self.say(severity, text.format(amsl=self.home.amsl_mm // 1000))

    def reboot(self) -> None:
        """Restart: the motors stop, it is silent for a while, then it boots with its clock at 0.

        Requested streams, modes and targets are lost; parameters, plans and keys persist.
        """
        self.off_us = OFF_US
        self.vehicle.restart(self.flavour.modes.start)
        self._pass_away(self.now_us)
        self.now_us = 0
        self.battery_told_us.clear()
        self.outbox.clear()
        if self.camera is not None and self.flavour.speaks_for_payload:
            self.camera.stop()
            self.camera.forget()

    def step_payload(self, now_us: int) -> None:
        """Advance the gimbal and the camera to a time of the simulation. They run on while the autopilot's loop is
        halted.
        """
        if self.gimbal is not None:
            self.gimbal.step(_TICK_S, self.vehicle.body)
        if self.camera is not None:
            self.camera.step(now_us)

    def _drain(self, load: float) -> None:
        for purpose, battery in self.batteries:
            if purpose in _FEEDS_MOTORS:
                battery.drain(_TICK_S, load)

    def _stay_off(self) -> None:
        """Advance only the vehicle by `TICK_US`: in the air it falls."""
        self.air.step(_TICK_S)
        load = self.vehicle.step(_TICK_S, (self.air.north, self.air.east), self.sensors.error, powered=False)
        self._drain(load)
        if self.vehicle.in_air and self.surroundings.is_hit(self.vehicle.body):
            self.vehicle.crash()
        self.vehicle.events.clear()
        self.off_us -= TICK_US
        self._pass_away(TICK_US)
        if not self.off_us:
            self.sensors.restart()
            self.plans.listeners.clear()
            self._start()
            self.reports.restart()
            self.plans.read_again()
            self.outbox.clear()

    def _pass_away(self, time_us: int) -> None:
        """Advance the time of day while the autopilot is off."""
        self.utc_us += time_us
        self.signing.restart(time_us)

    def _tell(self) -> None:
        """Send texts for events, and report a mode change."""
        vehicle, flavour = self.vehicle, self.flavour
        if vehicle.events:
            for event in vehicle.events:
                if event in flavour.texts:
                    up = round(vehicle.target.up)
                    facts = {"speed": vehicle.touched_m_s, "up": up, "amsl": up + self.home.amsl_mm // 1000}
                    self.say(mavlink.MAV_SEVERITY_INFO, flavour.texts[event].format(**facts))
            vehicle.events.clear()
        if vehicle.mode is not self._told_mode:
            self.tell_mode()

    def _remind(self) -> None:
        """Repeat failed arming checks from time to time."""
        if self.vehicle.armed:
            self._remind_us = self.now_us + _REMIND_FIRST_US
        elif self.now_us >= self._remind_us:
            self._remind_us = self.now_us + _REMIND_US
            if self.sensors.consistent:
                for reason in self.flavour.arming(self):
                    self.say(mavlink.MAV_SEVERITY_CRITICAL, f"PreArm: {reason}")

    def tell_mode(self) -> None:
        """Send a heartbeat if the mode changed and the flavour reports that at once."""
        if self.flavour.beats_on_mode and self.vehicle.mode is not self._told_mode:
            self.send(self.reports.message(mavlink.MAVLINK_MSG_ID_HEARTBEAT))
        self._told_mode = self.vehicle.mode

    def _follow_plans(self) -> None:
        """Advance the mission, the fence and the plan transfers."""
        fence, now_us = self.fence, self.now_us
        self.transfer.step(now_us)
        self.mission.step(now_us)
        self.vehicle.return_under = fence.return_under
        if now_us >= fence.due_us or fence.breach is not None or self.delayed is not None:
            self._keep_to_fence()

    def _keep_to_fence(self) -> None:
        """Check the fence and react to breaches."""
        vehicle, fence = self.vehicle, self.fence
        breached, mode = fence.breach is not None, vehicle.mode
        if breached and mode is not self._mode_in_breach:
            self.flavour.on_mode_in_breach(self)
        began = fence.step(self.now_us, vehicle)
        if began is not None:
            self.take_over(Taker.FAILSAFE, partial(self.flavour.on_breach, self, began))
        elif breached and fence.breach is None:
            self.flavour.on_breach_cleared(self)
        self._mode_in_breach = vehicle.mode if self.delayed is not None and self._acts_late() else mode

    def _acts_late(self) -> bool:
        if self.vehicle.mode is not FlightMode.LOITER or not self.vehicle.in_air:
            self.delayed = None
        if self.delayed is None or self.now_us < self.delayed[0]:
            return False
        (_, mode), self.delayed = self.delayed, None
        self._fail_over(mode)
        return True

    def _where(self) -> Point:
        return self.here

    def _stored(self, kind: int) -> tuple[PlanItem, ...]:
        """Return the items that a download shows."""
        items = self.plans.items(kind)
        if kind == MISSION and items and self._home_item is not None:
            return (self._home_item, *items[1:])
        return items

    def _may_clear(self, kind: int) -> bool:
        return kind != MISSION or self._home_item is None or not self.mission.running

    def _keep_targets(self) -> None:
        """Leave GUIDED when position targets stop, if the flavour does."""
        vehicle, last, timeout_us = self.vehicle, self.last_target_us, self.flavour.target_timeout_us
        if timeout_us is None or not vehicle.in_air or not vehicle.armed:
            return
        if last is None or self.now_us - last > timeout_us:
            self._fail_over(FlightMode.LOITER)

    # ------------------------------------------------------------------------------------------- taken over

    def take_over(self, taker: Taker, act: Callable[[], object]) -> None:
        """Perform an action from outside the link; it is a takeover if the vehicle is armed and obeys."""
        vehicle = self.vehicle
        armed, before = vehicle.armed, vehicle.orders
        act()
        if armed and self.taker is None and vehicle.orders != before:
            self.taker = taker

    def _fail_over(self, mode: FlightMode) -> None:
        """Enter another mode as a failsafe."""
        self.take_over(Taker.FAILSAFE, partial(self.vehicle.set_mode, mode))

    # ---------------------------------------------------------------------------------------------- state

    @property
    def _present(self) -> AutopilotStatus:
        vehicle = self.vehicle
        return AutopilotStatus(vehicle.mode, vehicle.landed, vehicle.destination)

    def follow_mode(self) -> None:
        """Register a mode change; reports show it after a recorded lag."""
        vehicle, before = self.vehicle, self._status
        if vehicle.mode is not before.mode:
            shortest_us, longest_us = self._lag_us
            if longest_us:
                lag_us = longest_us if self._lags is None else self._lags.randint(shortest_us, longest_us)
                self._published.append((self.now_us + self.since_us + lag_us, before))
            self.flavour.on_entered(self)
        is_new = vehicle.mode is not before.mode or vehicle.landed is not before.landed
        if is_new or vehicle.destination is not before.destination:
            self._status = self._present

    @property
    def shown(self) -> AutopilotStatus:
        """The status that its reports show now."""
        published, now_us = self._published, self.now_us + self.since_us
        while published and now_us >= published[0][0]:
            published.popleft()
        return published[0][1] if published else self._present

    def tells_danger(self, danger: bool) -> bool:
        """Return whether its state is reported as critical, with the same lag as the mode."""
        if self.shown.mode is self.vehicle.mode:
            self._told_danger = danger
        return self._told_danger

    @property
    def ready(self) -> bool:
        """Whether all arming checks pass, apart from the mode."""
        return not self.flavour.arming(self)

    def can_enter(self, mode: FlightMode) -> bool:
        """Return whether the mode exists and can be entered now."""
        if mode not in self.flavour.modes.numbers or (mode is FlightMode.MISSION and not self.mission.may_enter()):
            return False
        return mode not in NEEDS_POSITION or self.sensors.has_position

    @property
    def here(self) -> Point:
        """The estimated position, without noise."""
        body, (north, east) = self.vehicle.body, self.sensors.error
        return Point(body.north + north, body.east + east, body.up)

    @property
    def wind(self) -> tuple[float, float] | None:
        """The last wind estimate, north and east in m/s; None before the first flight.

        The estimate comes from drag in flight; after a flight the last one stays (section 5 of vehicles.md). Estimates
        always differ.
        """
        if Equipment.WIND in self.extras and self.vehicle.in_air and self.sensors.locates:
            ripple = _RIPPLE * sin(self.now_us / 1_000_000)
            self._wind = self.air.north + ripple, self.air.east + ripple
        return self._wind

    def _time(self) -> int:
        return self.now_us

    @property
    def boot_ms(self) -> int:
        """`time_boot_ms` of many messages."""
        return self.now_us // 1000

    # ------------------------------------------------------------------------------------------- speaking

    def send(self, message: Message | None) -> None:
        """Queue a message for the link."""
        if message is not None and not self.reports.is_silent(message.get_msgId()):
            self.outbox.append(message)

    def say(self, severity: int, text: str) -> None:
        """Queue a STATUSTEXT, in chunks if the text is long (MAVLink 2, `id` and `chunk_seq`)."""
        if self.flavour.texts_need_ground_station and not self.ground_station_seen:
            return
        chunks = [text[at : at + TEXT_OCTETS] for at in range(0, len(text), TEXT_OCTETS)]
        if len(chunks) > 1:
            self._text_id = self._text_id % 65_535 + 1
        for number, chunk in enumerate(chunks):
            id_ = self._text_id if len(chunks) > 1 else 0
            self.send(mavlink.MAVLink_statustext_message(severity, chunk.encode(), id_, number))
