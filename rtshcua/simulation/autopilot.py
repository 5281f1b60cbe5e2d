"""The autopilot: vehicle, battery, sensors, air and settings in one place, and what a flavour makes of them."""

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
from rtshcua.simulation.command import VehicleCommand
from rtshcua.simulation.config import Answers, Boot, Equipment, Estimate, Purpose, SimulationConfig
from rtshcua.simulation.failsafe import FailsafeRules, Failsafes
from rtshcua.simulation.fence import Breach, FenceRules, FenceWatch
from rtshcua.simulation.handling import Handling
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
"""m/s by which an estimate of the wind goes up and down."""
LOW_TO_ARM = 0.08
"""The battery level at which it does not arm any more."""
OFF_US = 1_500_000
"""How long an autopilot that starts again says nothing: the first frame comes one to two seconds later (recorded)."""
_REMIND_FIRST_US, _REMIND_US = 1_200_000, 30_000_000
SYSTEM_PARAMETERS = ("MAV_SYS_ID", "SYSID_THISMAV")
"""The parameters that hold the vehicle's own system id."""


Handler = Callable[["Autopilot", VehicleCommand], tuple[int, ...]]
"""Obeys a command or refuses it; the results (MAV_RESULT) to acknowledge with, usually one."""
_FEEDS_MOTORS = frozenset({Purpose.FLIGHT, Purpose.PROPULSION})
Builder = Callable[["Autopilot"], Message | None]
"""A message with what the vehicle knows now; None if it knows nothing."""


class Speaker(Protocol):
    """Who else sends frames under the vehicle's own ids, which a fault begins and ends (`voices.SecondVoice`)."""

    def due(self, autopilot: "Autopilot", system: int, now_us: int) -> list[bytes]:
        """What it sends by now, as frames."""
        ...


class Taker(StrEnum):
    """Who took the vehicle over from whoever flies it over the link."""

    PILOT = "pilot"
    FAILSAFE = "failsafe"


class AutopilotStatus(NamedTuple):
    """What an autopilot's reports tell of what it is about."""

    mode: FlightMode
    landed: Landed
    destination: Point | None


class Flavour(ABC):
    """What PX4 and ArduCopter do differently."""

    autopilot: int
    """HEARTBEAT.autopilot (MAV_AUTOPILOT)."""
    modes: ModeTable
    commands: Mapping[int, Handler]
    streams: Mapping[int, int]
    """The streams that run from boot, and their intervals in microseconds."""
    builders: Mapping[int, Builder]
    """Every message that can be streamed or requested."""
    constant: frozenset[int] = frozenset()
    """The messages whose interval is refused to be changed."""
    only_streamed: frozenset[int] = frozenset()
    """The messages that REQUEST_MESSAGE is refused for."""
    least_us: Mapping[int, int] = MappingProxyType({})
    """The shortest interval that is delivered, whatever is asked for, where there is one."""
    handling: Handling
    """How it flies, unless the configuration or a parameter says otherwise."""
    parameters: tuple[AutopilotParameter, ...]
    bytewise: bool
    """Whether integer parameters travel as their bytes."""
    texts: Mapping[VehicleEvent, str]
    """`{speed}` is the one of touching down; `{amsl}` and `{up}` are the height of a return, above the sea and home."""
    boot: BootPlan
    lanes: Lanes
    failsafes: FailsafeRules
    fix: int
    """GPS_RAW_INT.fix_type of a good fix."""
    coast_s: float
    """How long the estimator goes on without a fix."""
    texts_need_ground_station: bool
    """Whether STATUSTEXT is sent only once a ground station's heartbeat was seen."""
    check_text: str
    """How a text begins that says what stands against arming, when only asked."""
    falls_back: bool
    """Whether a switch that asks for Position without a position gets Altitude, and is not refused."""
    status_lag_us: tuple[int, int] = (0, 0)
    """How long after it entered a mode its reports go on telling of the one before: from, to."""
    beats_on_mode: bool
    """Whether another mode is told by a heartbeat at once."""
    reminds: bool
    """Whether it says again and again, while disarmed, why it would not arm."""
    names_batteries: bool
    """Whether BATTERY_STATUS says what a battery feeds, and of which type it is."""
    transfer: TransferRules
    missions: MissionRules
    fence: FenceRules
    key_ahead_us: int = 0
    """How far ahead of the time that came with a key its time stamps begin."""
    target_timeout_us: int | None = None
    """In GUIDED, how long one position target is good for; then LOITER."""
    tells_fence: bool
    """Whether SYS_STATUS has the geofence: always present, enabled if in force, healthy unless breached (recorded)."""

    @abstractmethod
    def arming(self, a: "Autopilot") -> tuple[str, ...]:
        """What stands against arming, the mode apart; nothing if it would arm."""

    @abstractmethod
    def release(self, *, keyed: bool) -> tuple[int, int]:
        """Which release it is where none is chosen; `keyed`: it has a key from the start."""

    @abstractmethod
    def obeys_unsigned(self, a: "Autopilot", name: str) -> bool:
        """Whether, with a key, a message of this name is obeyed without a right signature."""

    @abstractmethod
    def on_set_mode(self, a: "Autopilot", number: int) -> tuple[int, ...]:
        """Obeys a SET_MODE message with this `custom_mode`; the results to acknowledge with."""

    @abstractmethod
    def on_position_target(self, a: "Autopilot", message: Message) -> None:
        """Obeys SET_POSITION_TARGET_GLOBAL_INT, or does not; there is no answer."""

    @abstractmethod
    def on_setup_signing(self, a: "Autopilot", message: Message) -> None:
        """Obeys SETUP_SIGNING, refuses it, or does not know it; there is no answer."""

    @abstractmethod
    def on_breach(self, a: "Autopilot", breach: Breach) -> None:
        """Does what the fence's action asks for when a breach begins."""

    @abstractmethod
    def on_sticks(self, a: "Autopilot", for_us: int) -> None:
        """Obeys sticks that steer it east for so many microseconds, or does not mind."""

    # What follows is nothing unless a flavour does something then.

    def home_item(self, home: HomePosition) -> PlanItem | None:
        """What slot 0 of every mission is, where the flavour keeps it for home."""
        return None

    def on_data_stream(self, a: "Autopilot", stream: int, rate_hz: int) -> None:  # noqa: B027
        """Obeys REQUEST_DATA_STREAM: (stream, rate in Hz, 0 to stop). PX4 does not know it; its streams run unasked."""

    def on_local_target(self, a: "Autopilot", message: Message) -> None:  # noqa: B027
        """Obeys SET_POSITION_TARGET_LOCAL_NED, or does not; PX4, in OFFBOARD only, is not simulated to."""

    def on_entered(self, a: "Autopilot") -> None:  # noqa: B027
        """Another mode than before, whoever chose it."""

    def on_plan(self, a: "Autopilot", kind: int) -> None:  # noqa: B027
        """Tells of a plan of this kind (MAV_MISSION_TYPE) that was stored."""

    def on_mode_in_breach(self, a: "Autopilot") -> None:  # noqa: B027
        """Another mode while the fence is breached."""

    def on_breach_cleared(self, a: "Autopilot") -> None:  # noqa: B027
        """The vehicle is inside again."""


class Autopilot:
    """One simulated vehicle. `tick` lets time pass; the face hands it messages and collects what it has to say."""

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
        """How long ago the last tick was: messages come and are answered between ticks."""
        self.off_us = 0
        """How long it goes on saying nothing, for it starts again."""
        self.taker: Taker | None = None
        """Who first took the vehicle over in flight, if somebody did."""
        self.voices: list[Speaker] = []
        """Who else speaks under its ids."""
        self.extras = config.extras
        self.link_quality = 10_000
        """What the radio tells of the link, in 1/10000."""
        self.outbox: list[Message] = []
        self.air = Air(config.wind, Random(f"{config.seed} wind"))
        self.looked_down = False
        """Whether the last DISTANCE_SENSOR was of the range finder that looks down, of two."""
        self.battery = Battery(config.battery / 10_000, config.hover_us / 1_000_000)
        #: what each battery feeds, by id, and the battery; and how often one was reported
        self.batteries = [
            (Purpose.FLIGHT, self.battery),
            *(
                (other.purpose, Battery(other.level / 10_000, config.hover_us / 1_000_000))
                for other in config.other_batteries
            ),
        ]
        self.battery_reports = 0
        #: of each by id: how often it is reported at the most, and when it was last
        self.battery_every_us = [0, *(other.every_us for other in config.other_batteries)]
        self.battery_told_us: dict[int, int] = {}
        self.gauge_rise = config.gauge_rise
        """Percent more that are told in one report of five."""
        self._fast = config.boot is Boot.FAST
        pace = flavour.boot.all_s / FAST_S if self._fast else 1.0
        self.sensors = Sensors(
            Random(f"{config.seed} sensors"), config.noise, flavour.coast_s, flavour.boot, pace,
            late=config.estimate is Estimate.REAL, strays=config.noise and config.estimate is Estimate.REAL,
        )  # fmt: skip
        self._phases = Random(f"{config.seed} phases") if config.answers is Answers.RECORDED else None
        self._lags = Random(f"{config.seed} lags") if config.answers is Answers.RECORDED else None
        self._lag_us = flavour.status_lag_us if config.mode_lag_us is None else (config.mode_lag_us,) * 2
        self.surroundings = Surroundings()
        handling = replace(
            flavour.handling, cruise=config.cruise_mm_s / 1000, max_speed=config.max_speed_mm_s / 1000,
            return_up=config.return_mm / 1000,
            land_speed=flavour.handling.land_speed if config.land_mm_s is None else config.land_mm_s / 1000,
        )  # fmt: skip
        self.vehicle = Multirotor(handling, flavour.modes.start)
        self.vehicle.ceiling = inf if config.ceiling_mm is None else config.ceiling_mm / 1000
        self.parameters = Parameters(flavour.parameters, handling, flavour.bytewise)
        for name in SYSTEM_PARAMETERS:
            self.parameters.assign(name, config.system)
        if config.signing_key is not None:
            self.parameters.assign("MAV_SIGN_CFG", 1)  # unless its owner says otherwise
        for name, value in config.parameters:
            self.parameters.own(name, value)
        self.reports = Reports({number: partial(build, self) for number, build in flavour.builders.items()}, self._time)
        self.signing = VehicleSigning(config.signing_key, config.utc_us, config.speed, flavour.key_ahead_us)
        self.plans = Plans()
        self._home_item = flavour.home_item(self.home)
        if self._home_item is not None:
            self.plans.replace(MISSION, (self._home_item,))
        self._start()

    def _start(self) -> None:
        """What begins anew with each start. What outlives one is in `__init__`: all that is stored, and the world."""
        flavour = self.flavour
        self.ground_station_seen = False
        self._wind: tuple[float, float] | None = None
        self.last_target_us: int | None = None
        #: what a DO_REPOSITION named that changes no mode, and until when whoever enters Hold flies to it (PX4)
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
        #: when it acts on what made it hold, and how; nothing if somebody enters another mode before
        self.delayed: tuple[int, FlightMode] | None = None
        self._told_mode = self.vehicle.mode
        self._status = self._present
        self._published: deque[tuple[int, AutopilotStatus]] = (
            deque()
        )  # until when its reports still tell of what was so
        self._told_danger = False
        self._remind_us = _REMIND_US
        self._text_id = 0

    # ----------------------------------------------------------------------------------------------- time

    def tick(self) -> None:
        """Lets `TICK_US` pass."""
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
        """Starts again: the motors stop, it says nothing for a while, then it comes up with its clock at 0.

        Asked-for streams, modes and targets are forgotten; parameters, plans and keys are stored, and stay.
        """
        self.off_us = OFF_US
        self.vehicle.restart(self.flavour.modes.start)
        self._pass_away(self.now_us)
        self.now_us = 0
        self.battery_told_us.clear()
        self.outbox.clear()

    def _drain(self, load: float) -> None:
        for purpose, battery in self.batteries:
            if purpose in _FEEDS_MOTORS:
                battery.drain(_TICK_S, load)

    def _stay_off(self) -> None:
        """Lets `TICK_US` pass for the vehicle alone: in the air it falls."""
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
        """The time of day goes on without the autopilot's clock."""
        self.utc_us += time_us
        self.signing.restart(time_us)

    def _tell(self) -> None:
        """What happened, and another mode."""
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
        """What stands against arming, once in a while."""
        if self.vehicle.armed:
            self._remind_us = self.now_us + _REMIND_FIRST_US
        elif self.now_us >= self._remind_us:
            self._remind_us = self.now_us + _REMIND_US
            if self.sensors.consistent:
                for reason in self.flavour.arming(self):
                    self.say(mavlink.MAV_SEVERITY_CRITICAL, f"PreArm: {reason}")

    def tell_mode(self) -> None:
        """A heartbeat, if the mode is another one than was told, and the flavour tells at once."""
        if self.flavour.beats_on_mode and self.vehicle.mode is not self._told_mode:
            self.send(self.reports.message(mavlink.MAVLINK_MSG_ID_HEARTBEAT))
        self._told_mode = self.vehicle.mode

    def _follow_plans(self) -> None:
        """The mission, the fence and the transfers go on."""
        fence, now_us = self.fence, self.now_us
        self.transfer.step(now_us)
        self.mission.step(now_us)
        self.vehicle.return_under = fence.return_under
        if now_us >= fence.due_us or fence.breach is not None or self.delayed is not None:
            self._keep_to_fence()

    def _keep_to_fence(self) -> None:
        """What a breach brings, and another mode in one."""
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
        """What a download shows."""
        items = self.plans.items(kind)
        if kind == MISSION and items and self._home_item is not None:
            return (self._home_item, *items[1:])
        return items

    def _may_clear(self, kind: int) -> bool:
        return kind != MISSION or self._home_item is None or not self.mission.running

    def _keep_targets(self) -> None:
        """Leaves GUIDED when position targets stop coming, where the flavour does."""
        vehicle, last, timeout_us = self.vehicle, self.last_target_us, self.flavour.target_timeout_us
        if timeout_us is None or not vehicle.in_air or not vehicle.armed:
            return
        if last is None or self.now_us - last > timeout_us:
            self._fail_over(FlightMode.LOITER)

    # ------------------------------------------------------------------------------------------- taken over

    def take_over(self, taker: Taker, act: Callable[[], object]) -> None:
        """Somebody acts who does not fly it over the link: it is taken over if it is armed and obeys."""
        vehicle = self.vehicle
        armed, before = vehicle.armed, vehicle.orders
        act()
        if armed and self.taker is None and vehicle.orders != before:
            self.taker = taker

    def _fail_over(self, mode: FlightMode) -> None:
        """It enters another mode by itself."""
        self.take_over(Taker.FAILSAFE, partial(self.vehicle.set_mode, mode))

    # ---------------------------------------------------------------------------------------------- state

    @property
    def _present(self) -> AutopilotStatus:
        vehicle = self.vehicle
        return AutopilotStatus(vehicle.mode, vehicle.landed, vehicle.destination)

    def follow_mode(self) -> None:
        """Notices another mode: what it is in shows in its reports some time after it entered it, as recorded."""
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
        """What its reports tell now."""
        published, now_us = self._published, self.now_us + self.since_us
        while published and now_us >= published[0][0]:
            published.popleft()
        return published[0][1] if published else self._present

    def tells_danger(self, danger: bool) -> bool:
        """Whether its state is told to be critical: with the mode that it is in, and as late."""
        if self.shown.mode is self.vehicle.mode:
            self._told_danger = danger
        return self._told_danger

    @property
    def ready(self) -> bool:
        """Whether nothing stands against arming but the mode."""
        return not self.flavour.arming(self)

    def can_enter(self, mode: FlightMode) -> bool:
        """Whether the mode may be entered now, if the flavour has it."""
        if mode not in self.flavour.modes.numbers or (mode is FlightMode.MISSION and not self.mission.may_enter()):
            return False
        return mode not in NEEDS_POSITION or self.sensors.has_position

    @property
    def here(self) -> Point:
        """Where the vehicle believes to be, noise apart."""
        body, (north, east) = self.vehicle.body, self.sensors.error
        return Point(body.north + north, body.east + east, body.up)

    @property
    def wind(self) -> tuple[float, float] | None:
        """The last estimate of the wind, to the north and to the east in m/s; None where there is none yet.

        It is made of what the air does to the body that flies: there is none before a flight, and after one the last
        stays (section 5 of vehicles.md). An estimate is never twice the same.
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
        """Queues a message for the link."""
        if message is not None and not self.reports.is_silent(message.get_msgId()):
            self.outbox.append(message)

    def say(self, severity: int, text: str) -> None:
        """Queues STATUSTEXT, in chunks if the text is long (MAVLink 2, `id` and `chunk_seq`)."""
        if self.flavour.texts_need_ground_station and not self.ground_station_seen:
            return
        chunks = [text[at : at + TEXT_OCTETS] for at in range(0, len(text), TEXT_OCTETS)]
        if len(chunks) > 1:
            self._text_id = self._text_id % 65_535 + 1
        for number, chunk in enumerate(chunks):
            id_ = self._text_id if len(chunks) > 1 else 0
            self.send(mavlink.MAVLink_statustext_message(severity, chunk.encode(), id_, number))
