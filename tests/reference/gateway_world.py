"""A gateway with hand-made tables, a policy of the frozen library, and a vehicle that reports what a test says.

Frames are made and read by pymavlink, which the gateway does not use.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from reference.sources import CHECKOUT
from rtshcua.app.propose import Missions
from rtshcua.decision.prepare import PreparedPolicy, prepare
from rtshcua.ground.gateway.accepted import (
    COMMAND,
    ITEM,
    MESSAGE,
    MODE,
    AcceptedCommand,
    ArgumentSource,
    FixedField,
)
from rtshcua.ground.gateway.interface import (
    REQUESTS,
    Action,
    ClientSettings,
    ClientUp,
    Event,
    FlightLine,
    FromClient,
    FromPilot,
    FromVehicle,
    GatewaySettings,
    ProposalAnswered,
    ProposalChecked,
    Propose,
    Tick,
    ToClient,
)
from rtshcua.ground.gateway.translator import Gateway
from rtshcua.mavlink.modes import PX4, CopterMode, Px4Mode
from rtshcua.model.flat.situation import Now, State

POLICY = CHECKOUT / "policies" / "bridge_inspection.rts"
HOME_LATITUDE, HOME_LONGITUDE, HOME_MM = 473_977_400, 85_455_900, 488_000
#: 60 m north of home, above the meadow
NORTH = 473_983_000, 85_455_900
SYSTEM = 1
#: the error of UTC that a gateway assumes where nobody states another
UTC_ERROR_US = 500_000
#: 10:00 of a day in 2026, UTC, us
MORNING = 1_780_308_000_000_000

_Z = ("param7",)
_XY = ("param5", "param6")
_ALTITUDE_SEA = ArgumentSource("altitude", _Z, 1_000, "sea", "MIS_TAKEOFF_ALT above home")
_ALTITUDE_HOME = ArgumentSource("altitude", _Z, 1_000, "home", "")
_IN_FRAME = ArgumentSource("altitude", _Z, 1_000, "frame", "")
_OR_HERE = ArgumentSource("altitude", _Z, 1_000, "frame", "here")
_TARGET = ArgumentSource("target", _XY, 10_000_000, "", "")
_TARGET_OR_HERE = ArgumentSource("target", _XY, 10_000_000, "", "here")
_SPEED = ArgumentSource("speed", ("param1",), 1_000, "", "default")
_TIME = ArgumentSource("time", ("param1",), 1_000_000, "", "")
_NO_PLACE = FixedField("param5", 0), FixedField("param6", 0)
_UNSET = FixedField("param5", None), FixedField("param6", None)


def _row(
    skill: str, kind: str, name: str, number: int, *arguments: ArgumentSource, on: str = "", fixed: Any = ()
) -> AcceptedCommand:
    return AcceptedCommand(skill, kind, name, number, on, tuple(fixed), arguments)


#: the table of the library's skills, by hand
ROWS = (
    _row("takeoff", COMMAND, "MAV_CMD_NAV_TAKEOFF", 22, _ALTITUDE_SEA, on="px4"),
    _row("takeoff", COMMAND, "MAV_CMD_NAV_TAKEOFF", 22, _ALTITUDE_HOME, on="ardupilot"),
    _row("takeoff", ITEM, "MAV_CMD_NAV_TAKEOFF", 22, _IN_FRAME),
    _row(
        "takeoff", MODE, "TAKEOFF", Px4Mode.TAKEOFF,
        ArgumentSource("altitude", (), 1_000, "", "MIS_TAKEOFF_ALT above home"), on="px4",
    ),
    _row("goto", COMMAND, "MAV_CMD_DO_REPOSITION", 192, _TARGET, _OR_HERE, _SPEED),
    _row("goto", COMMAND, "MAV_CMD_DO_REPOSITION", 192, _TARGET_OR_HERE, _IN_FRAME, _SPEED),
    _row("goto", ITEM, "MAV_CMD_NAV_WAYPOINT", 16, _TARGET, _IN_FRAME),
    _row(
        "goto", MESSAGE, "SET_POSITION_TARGET_GLOBAL_INT", 86,
        ArgumentSource("target", ("lat_int", "lon_int"), 1, "", ""),
        ArgumentSource("altitude", ("alt",), 1_000, "frame", ""),
        fixed=(FixedField("type_mask", 504, 504), FixedField("type_mask", 0, 7)),
    ),
    _row("hover", COMMAND, "MAV_CMD_DO_PAUSE_CONTINUE", 193, fixed=(FixedField("param1", 0),)),
    _row("hover", COMMAND, "MAV_CMD_DO_REPOSITION", 192, fixed=(*_UNSET, FixedField("param7", None))),
    _row("hover", ITEM, "MAV_CMD_NAV_LOITER_TIME", 19, _TIME, fixed=_NO_PLACE),
    _row("hover", MODE, "HOLD", Px4Mode.HOLD, on="px4"),
    _row("hover", MODE, "LOITER", CopterMode.LOITER, on="ardupilot"),
    _row("return_home", COMMAND, "MAV_CMD_NAV_RETURN_TO_LAUNCH", 20),
    _row("return_home", ITEM, "MAV_CMD_NAV_RETURN_TO_LAUNCH", 20),
    _row("return_home", MODE, "RETURN", Px4Mode.RETURN, on="px4"),
    _row("return_home", MODE, "RTL", CopterMode.RTL, on="ardupilot"),
    _row("emergency_land", COMMAND, "MAV_CMD_NAV_LAND", 21),
    _row("emergency_land", ITEM, "MAV_CMD_NAV_LAND", 21, fixed=_NO_PLACE),
    _row("emergency_land", MODE, "LAND", Px4Mode.LAND, on="px4"),
    _row("emergency_land", MODE, "LAND", CopterMode.LAND, on="ardupilot"),
)  # fmt: skip
#: default arguments of the library's skills
DEFAULTS: Mapping[str, Mapping[str, tuple[int, ...]]] = {
    "goto": {"speed": (6_000,)},
    "hover": {"time": (10_000_000,)},
}


@cache
def policy(path: Path = POLICY) -> PreparedPolicy:
    """A shipped policy, lowered and prepared."""
    prepared = prepare(Missions([path]).policy)
    assert isinstance(prepared, PreparedPolicy)
    return prepared


class GatewayWorld:
    """A gateway, its time in us, and what it did. Signals are canonical values by name; others are unknown."""

    def __init__(
        self, autopilot: int = PX4, under: PreparedPolicy | None = None, needed_us: Any = None,
        more: tuple[AcceptedCommand, ...] = (),
    ) -> None:  # fmt: skip
        self.autopilot = autopilot
        self.policy = policy() if under is None else under
        self.now_us = 1_000_000
        self.utc_us = MORNING
        self.signals: dict[str, tuple[int, ...]] = {
            "position": (0, 0), "height": (0,), "battery": (9_000,), "battery.cell": (4_000,), "gps.fix": (3,),
            "landed": (1,), "velocity.north": (0,), "velocity.east": (0,), "velocity.down": (0,),
        }  # fmt: skip
        self.settings = GatewaySettings(
            SYSTEM, autopilot, self.policy, DEFAULTS, (*ROWS, *more), lambda now: self.state(), needed_us or {}
        )
        self.gateway = Gateway(self.settings)
        self.done: list[Action] = []
        self._vehicle = mavlink.MAVLink(None, SYSTEM, 1)
        self._client = mavlink.MAVLink(None, 245, 190)
        self._mode: int = Px4Mode.HOLD if autopilot == PX4 else CopterMode.STABILIZE
        self._armed = False
        self._airborne = False
        self.client(1, "script")
        self.report()

    def state(self) -> State:
        """The state that decisions read."""
        flat = self.policy.policy
        values: list[int | None] = [None] * flat.slots
        for signal in flat.signals:
            for slot, value in zip(signal.slots, self.signals.get(signal.name, ()), strict=False):
                values[slot] = value
        return State(tuple(values), (0,) * flat.slots, (4,) * len(flat.monitors))

    # ------------------------------------------------------------ events

    def take(self, event: Event) -> list[Action]:
        """Pass an event in; return what is to be done."""
        actions = self.gateway.take(event, Now(self.now_us, self.utc_us + self.now_us, UTC_ERROR_US))
        self.done += actions
        return actions

    def client(self, number: int, name: str, **settings: Any) -> None:
        """A client comes."""
        made = ClientSettings(name, **{"role": "operator", "requests": frozenset(REQUESTS), **settings})
        self.take(ClientUp(number, made))

    def send(
        self, message: Any, client: int = 1, sender: tuple[int, int] = (245, 190), pilot: bool = False
    ) -> list[Action]:
        """A client sends a message of pymavlink."""
        self._client.srcSystem, self._client.srcComponent = sender
        frame = message.pack(self._client)
        return self.take(FromPilot(client, frame) if pilot else FromClient(client, frame))

    def vehicle(self, message: Any) -> list[Action]:
        """The autopilot sends a message."""
        return self.take(FromVehicle(message.pack(self._vehicle)))

    def report(
        self, *, armed: bool | None = None, mode: int | None = None, airborne: bool | None = None
    ) -> list[Action]:
        """The autopilot reports its state: HOME_POSITION, GLOBAL_POSITION_INT, EXTENDED_SYS_STATE, HEARTBEAT."""
        self._armed = self._armed if armed is None else armed
        self._airborne = self._airborne if airborne is None else airborne
        self._mode = self._mode if mode is None else mode
        here = HOME_LATITUDE, HOME_LONGITUDE, HOME_MM
        self.vehicle(mavlink.MAVLink_home_position_message(*here, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0))
        height = self.signals["height"][0]
        self.vehicle(mavlink.MAVLink_global_position_int_message(0, *here[:2], HOME_MM + height, height, 0, 0, 0, 0))
        self.vehicle(mavlink.MAVLink_extended_sys_state_message(0, 2 if self._airborne else 1))
        base = 1 | (128 if self._armed else 0)
        return self.vehicle(mavlink.MAVLink_heartbeat_message(2, self.autopilot, base, self._mode, 4, 3))

    def wait(self, us: int = 0, *, step_us: int = 50_000) -> list[Action]:
        """Time passes, with ticks; without a time one tick."""
        actions: list[Action] = []
        until_us = self.now_us + us
        while True:
            self.now_us = min(self.now_us + step_us, until_us) if us else self.now_us
            actions += self.take(Tick())
            if self.now_us >= until_us:
                return actions

    def line(self, **fields: Any) -> list[Action]:
        """A line of the flight."""
        return self.take(FlightLine(fields))

    def ready(self) -> None:
        """A flight waits for its mission."""
        self.line(type="hello", flight="00")
        self.line(type="waiting")
        self.line(type="vehicle", ready=True, unready=None)

    def fly(self, height_mm: int = 10_000) -> None:
        """A flight is in the air, without a step of a client under way."""
        self.ready()
        self.line(type="mission")
        self.signals |= {"height": (height_mm,), "landed": (2,)}
        self.report(armed=True, airborne=True, mode=Px4Mode.HOLD if self.autopilot == PX4 else CopterMode.GUIDED)

    def offboard(self, client: int = 1) -> list[Action]:
        """A client asks for the mode in which setpoints are heeded."""
        mode = (6, 0) if self.autopilot == PX4 else (CopterMode.GUIDED, 0)
        return self.send(command_long(176, 1, *mode), client)

    def accept(self, actions: list[Action], first: int = 0) -> int:
        """The worker signs the only proposal of these actions, and the flight takes it; return its number."""
        (number,) = (each.number for each in actions if isinstance(each, Propose))
        self.take(ProposalChecked(number, None, first))
        self.take(ProposalAnswered(number, "accepted"))
        return number

    def dispatch(self, step: int = 0) -> list[Action]:
        """The flight dispatches a step."""
        self.line(type="mission")
        return self.line(type="effect", event="dispatched", kind=0, step=step)


def proposals(actions: list[Action]) -> list[tuple[str, dict[str, str], tuple[int, ...]]]:
    """Every step that is proposed for flight: skill, arguments, cells."""
    found = [step for each in actions if isinstance(each, Propose) and each.fly for step in each.steps]
    return [(step.skill, dict(step.arguments), step.values) for step in found]


def told(actions: list[Action], client: int = 1) -> list[Any]:
    """The messages to a client, as pymavlink reads them. CONTROL_STATUS, which it does not know, is left out."""
    reader = mavlink.MAVLink(None)
    found = []
    for each in actions:
        if isinstance(each, ToClient) and each.client == client and int.from_bytes(each.frame[7:10], "little") != 512:
            message = reader.decode(bytearray(each.frame))
            assert (message.get_srcSystem(), message.get_srcComponent()) == (SYSTEM, 1)
            found.append(message)
    return found


def acks(actions: list[Action], client: int = 1) -> list[tuple[int, int]]:
    """Command and result of each COMMAND_ACK to a client."""
    return [(m.command, m.result) for m in told(actions, client) if m.get_type() == "COMMAND_ACK"]


def texts(actions: list[Action], client: int = 1) -> list[str]:
    """The texts to a client: chunks joined, with one space for those that fill one."""
    found: list[str] = []
    for message in told(actions, client):
        if message.get_type() == "STATUSTEXT":
            if message.chunk_seq:
                found[-1] += message.text
            else:
                found.append(message.text)
    return [" ".join(each.split()) for each in found]


def command_long(number: int, *parameters: float, confirmation: int = 0) -> Any:
    """A COMMAND_LONG to the autopilot; missing parameters are 0."""
    filled = [*parameters, *[0.0] * (7 - len(parameters))]
    return mavlink.MAVLink_command_long_message(SYSTEM, 1, number, confirmation, *filled)


def command_int(number: int, frame: int, *parameters: float, x: int, y: int, z: float) -> Any:
    """A COMMAND_INT to the autopilot; missing parameters are 0."""
    filled = [*parameters, *[0.0] * (4 - len(parameters))]
    return mavlink.MAVLink_command_int_message(SYSTEM, 1, frame, number, 0, 0, *filled, x, y, z)


def reposition(latitude: int = NORTH[0], longitude: int = NORTH[1], z: float = 508.0, frame: int = 5) -> Any:
    """A DO_REPOSITION as MAVSDK sends it; 508 m above sea is 20 m above home."""
    return command_int(192, frame, float("nan"), 1, float("nan"), 0, x=latitude, y=longitude, z=z)


def item(number: int, command: int, *parameters: float, x: int = 0, y: int = 0, z: float = 0.0, frame: int = 6) -> Any:
    """A MISSION_ITEM_INT of a mission."""
    filled = [*parameters, *[0.0] * (4 - len(parameters))]
    return mavlink.MAVLink_mission_item_int_message(SYSTEM, 1, number, frame, command, 0, 1, *filled, x, y, z, 0)


def setpoint(
    latitude: int = NORTH[0], longitude: int = NORTH[1], z: float = 20.0, mask: int = 0xDF8, frame: int = 6
) -> Any:
    """A SET_POSITION_TARGET_GLOBAL_INT of a position."""
    return mavlink.MAVLink_set_position_target_global_int_message(
        0, SYSTEM, 1, frame, mask, latitude, longitude, z, 0, 0, 0, 0, 0, 0, 0, 0
    )
