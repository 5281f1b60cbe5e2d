"""The pure part of the gateway: from frames of clients, frames of the vehicle, lines of the flight and time to answers
and proposals. It never passes a client's frame on.
"""

from collections.abc import Callable
from typing import Final

from rtshcua.ground.gateway import interface
from rtshcua.ground.gateway.accepted import COMMAND, MESSAGE, MODE
from rtshcua.ground.gateway.client_frames import SETPOINTS, Received, received
from rtshcua.ground.gateway.client_link import NOTICE, ClientLink
from rtshcua.ground.gateway.client_mission import ClientMissions
from rtshcua.ground.gateway.control import Control
from rtshcua.ground.gateway.gateway_state import SECOND_US, ClientSource, ConnectedClient, GatewayState
from rtshcua.ground.gateway.habits import ShownState, set_parameter
from rtshcua.ground.gateway.harmless_requests import COMMANDS as REQUESTING
from rtshcua.ground.gateway.interface import Action, Event, GatewaySettings
from rtshcua.ground.gateway.plan_transfer import PlanTransfer
from rtshcua.ground.gateway.proposing import Handler, Proposing
from rtshcua.ground.gateway.vehicle_seen import parameter_name
from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.command_results import ACCEPTED, DENIED, UNSUPPORTED
from rtshcua.mavlink.modes import COPTER_NAMES, PX4, PX4_NAMES, CopterMode, Px4Mode
from rtshcua.mavlink.parameters import is_bytewise
from rtshcua.model.flat.situation import Now

#: how long the same command gets the same refusal, and after a refused setpoint the next ones are passed over, us
REFUSED_US: Final = 200_000
_MOST_CLIENTS: Final = 256

#: commands that would change the vehicle itself are denied; other commands without a mapping are not supported. Here:
#: home, relays, servos, termination, actuators, fence, motor test, calibration, offsets, storage, reboot, failures
_DANGEROUS: Final = frozenset({179, 181, 183, 184, 185, 187, 207, 209, 241, 242, 245, 246, 420})
#: frames that say something about the client, and request nothing
_SAYS_NOTHING: Final = frozenset(
    {
        layouts.HEARTBEAT, layouts.SYSTEM_TIME, layouts.PING, layouts.PARAM_VALUE, layouts.COMMAND_ACK,
        layouts.RADIO_STATUS, layouts.ALTITUDE, layouts.AUTOPILOT_VERSION, layouts.STATUSTEXT, layouts.PROTOCOL_VERSION,
        layouts.MISSION_CURRENT, layouts.GLOBAL_POSITION_INT,
    }
)  # fmt: skip
#: what an absorbed mode is: clients ask for it before they send targets
_WITHOUT_EFFECT: Final = (CopterMode.GUIDED, Px4Mode.OFFBOARD)
_COMMANDS: Final = (layouts.COMMAND_LONG, layouts.COMMAND_INT)
_MISSION_MODES: Final = (CopterMode.AUTO, Px4Mode.MISSION)


class Gateway:
    """All clients of one vehicle. `take` is called with each event, in order, by one caller."""

    def __init__(self, settings: GatewaySettings) -> None:
        self._state = GatewayState(settings)
        self._control = Control(self._state)
        self._proposing = Proposing(self._state, self._control, self._again)
        self._missions = ClientMissions(self._state, self._proposing)
        self._second_us = 0
        self._handlers = self._by_message()

    def renew(self, settings: GatewaySettings, now: Now) -> list[Action]:
        """Another policy with the same signals is in force, while nothing flies. Everything is kept."""
        self._state.under(settings)
        self._missions.renew(now.monotonic_us)
        return self._taken()

    def take(self, event: Event, now: Now) -> list[Action]:
        """What is to be done after an event."""
        now_us = now.monotonic_us
        match event:
            case interface.FromVehicle(frame):
                self._from_vehicle(frame, now_us)
            case interface.FromClient(client, frame):
                self._from_client(client, frame, now)
            case interface.FromPilot(client, frame):
                self._from_pilot(client, frame, now_us)
            case interface.FlightLine(line):
                for each in self._proposing.hear(line, now_us):
                    self._missions.progress(each)
            case interface.Tick():
                self._tick(now)
            case interface.ClientUp(client, of):
                self._up(ClientLink(client, of, self._state.settings.system, self._state.actions, now_us), now_us)
            case interface.ClientDown(client, relay_ended):
                self._down(client, now_us, relay_ended=relay_ended)
            case interface.RequestAnswered(number, slug):
                self._state.requests.answered(number, slug, now_us)
            case interface.ProposalChecked():
                if not self._missions.checked(event, now_us):
                    self._proposing.checked(event, now_us)
            case interface.ProposalAnswered(number, slug, text):
                self._proposing.answered(number, slug, text, now_us)
            case interface.FlightEnded():
                self._proposing.ended("", now_us)
        return self._taken()

    def _taken(self) -> list[Action]:
        actions = self._state.actions[:]
        self._state.actions.clear()
        return actions

    def _up(self, link: ClientLink, now_us: int) -> None:
        """A client is there: it goes on with what its former connection left."""
        if link.settings.pilot:
            self._control.pilots.links[link.client] = link
        if link.settings.pilot or len(self._state.clients) >= _MOST_CLIENTS:
            return
        state, autopilot = self._state, self._state.settings.autopilot
        source = state.sources.setdefault(link.name, ClientSource(link.settings.role, guided=autopilot != PX4))
        link.shadows = source.shadows
        transfer = PlanTransfer(link, state.translation, autopilot, state.plans)
        shown = ShownState(link, state.seen, state.actions, autopilot)
        state.clients[link.client] = client = ConnectedClient(link, source, shown, transfer)
        for each in state.proposals.values():
            if each.link.name == link.name:
                each.move({asked.link.client for asked in each.asked_by} - state.clients.keys(), link)
        self._missions.of_mission(client, now_us)

    def _from_vehicle(self, frame: bytes, now_us: int) -> None:
        number = self._state.seen.take(frame, now_us)
        if number == layouts.HEARTBEAT:
            self._state.flight.flew |= self._state.flight.stage == "flying" and not self._state.seen.on_ground
            for client in self._state.clients.values():
                client.shown.update(now_us)
                client.shown.heartbeat(now_us)
        if number in (layouts.SYSTEM_TIME, layouts.GLOBAL_POSITION_INT) and self._state.seen.restarted(number):
            self._state.requests.forget_vehicle()
        self._state.requests.seen(number)

    def _from_pilot(self, client: int, frame: bytes, now_us: int) -> None:
        """A pilot's frame: if he takes control, nothing begins any more that clients asked for before."""
        if not self._control.pilots.take(client, frame, now_us):
            return
        if self._control.pilots.in_control:
            self._proposing.take_back("the pilot is in control", now_us)
        self._control.tell(now_us)

    def _by_message(self) -> dict[int, Handler]:
        def transfer(function: Callable[[PlanTransfer, Received, int], None]) -> Handler:
            return lambda client, message, now: self._missions.transferred(function, client, message, now)

        def asks(function: Callable[[ClientLink, Received, int], None]) -> Handler:
            return lambda client, message, now: function(client.link, message, now.monotonic_us)

        requests = self._state.requests
        return {
            layouts.COMMAND_LONG: self._command,
            layouts.COMMAND_INT: self._command,
            layouts.COMMAND_CANCEL: lambda client, message, now: self._proposing.cancel(
                client, message.fields["command"], now.monotonic_us
            ),
            layouts.SET_MODE: self._set_mode,
            **dict.fromkeys(SETPOINTS, self._setpoint),
            layouts.PARAM_SET: self._param_set,
            layouts.PARAM_REQUEST_READ: self._param_read,
            layouts.PARAM_REQUEST_LIST: asks(lambda link, _, now_us: requests.list_parameters(link, now_us)),
            layouts.MISSION_COUNT: transfer(PlanTransfer.count),
            layouts.MISSION_CLEAR_ALL: transfer(PlanTransfer.clear),
            layouts.MISSION_WRITE_PARTIAL_LIST: transfer(PlanTransfer.unsupported),
            layouts.MISSION_ITEM_INT: self._missions.item,
            layouts.MISSION_ITEM: self._missions.item,
            layouts.MISSION_REQUEST_LIST: lambda client, message, now: client.transfer.request_list(message),
            layouts.MISSION_REQUEST: lambda client, message, now: client.transfer.request(message),
            layouts.MISSION_REQUEST_INT: lambda client, message, now: client.transfer.request(message),
            layouts.MISSION_ACK: lambda client, message, now: client.transfer.acknowledged(message),
            layouts.MISSION_SET_CURRENT: self._missions.set_current,
            layouts.REQUEST_DATA_STREAM: asks(requests.data_stream),
            layouts.TIMESYNC: asks(requests.time),
            layouts.LOG_REQUEST_LIST: asks(requests.logs),
            layouts.AUTOPILOT_VERSION_REQUEST: self._version,
            layouts.FILE_TRANSFER_PROTOCOL: self._files,
        }

    def _from_client(self, number: int, frame: bytes, now: Now) -> None:
        client, message = self._state.clients.get(number), received(frame)
        if client is None or message is None:
            return
        client.link.hear(message, now.monotonic_us)
        if message.message in _SAYS_NOTHING:
            return
        if not message.is_for(self._state.settings.system):
            if message.message in _COMMANDS:
                command, system = message.fields["command"], message.fields["target_system"]
                whom = "another component" if system in (0, self._state.settings.system) else f"system {system}"
                client.reject(f"command {command} is for {whom}: refused", command, now.monotonic_us)
            return
        handler = self._handlers.get(message.message)
        if message.message not in _COMMANDS:
            client.refused = None  # it may have changed what the command was refused for
        if handler is not None:
            handler(client, message, now)
        else:
            what = "signing set-up" if message.message == layouts.SETUP_SIGNING else f"message {message.message}"
            client.link.text(f"{what} is refused", now.monotonic_us, what)
            client.link.record("refused", now.monotonic_us, message=message.message)

    def _again(self, client: ConnectedClient, message: Received, now: Now) -> None:
        """A command that waited for a flight."""
        self._handlers[message.message](client, message, now)

    def _command(self, client: ConnectedClient, message: Received, now: Now) -> None:
        """COMMAND_LONG, COMMAND_INT. A repeated one costs nearly nothing: it has the answer of the last one."""
        command, now_us = message.fields["command"], now.monotonic_us
        seen, flight = self._state.seen, self._state.flight
        content = repr({**message.fields, "confirmation": 0})  # in `repr` NaN is equal to NaN
        state = (
            content, flight.stage, flight.unready, self._control.pilots.in_control, seen.armed, seen.landed_state,
            len(seen.parameters),
        )  # fmt: skip
        if client.refused is not None and client.refused[0] == state and now_us < client.refused[2]:
            client.link.ack(message.sender, command, client.refused[1])
            return
        result = self._result(client, message, command, now)
        client.refused = None
        if result is not None:
            client.link.ack(message.sender, command, result)
            if result != ACCEPTED and self._proposing.holds:
                client.refused = state, result, now_us + REFUSED_US

    def _result(self, client: ConnectedClient, message: Received, command: int, now: Now) -> int | None:
        """The result of a command; None if the answer comes later."""
        now_us = now.monotonic_us
        result: int | None
        if command == enums.MAV_CMD_COMPONENT_ARM_DISARM:
            wanted, hindrance = message.number("param1"), None
            if wanted == 1:
                hindrance = self._proposing.cannot_take_off(client, now)
            elif wanted == 0:
                self._proposing.take_back(f"{client.link.name} disarms", now_us, client.link.name)
                hindrance = self._proposing.takes_off()
            result = client.shown.arm(message, now_us, hindrance)
        elif command in REQUESTING:
            result = self._state.requests.command(client.link, message, now_us)
        elif command == enums.MAV_CMD_DO_SET_MODE:
            result = self._do_set_mode(client, message, now)
        elif command == enums.MAV_CMD_MISSION_START:
            result = self._missions.start_whole(client, message, command, now)
        elif command == enums.MAV_CMD_REQUEST_OPERATOR_CONTROL:
            result = self._control.asks_for_control(client, command, now_us)
        elif command == enums.MAV_CMD_DO_SET_MISSION_CURRENT:
            result = self._missions.jump(client, message.number("param1"), now_us)
        else:
            result = self._mapped(client, message, command, now)
        return result

    def _mapped(self, client: ConnectedClient, message: Received, command: int, now: Now) -> int | None:
        """A command that the table may have; its result, None if the answer comes later."""
        row, now_us = self._state.translation.row(COMMAND, command, message), now.monotonic_us
        if row is not None:
            step = self._state.step(client.link, row, message, now)
            return self._proposing.propose(client, message, step, command, now)
        known = self._state.translation.knows(COMMAND, command)
        why = "with these parameters is refused" if known else "has no mapping"
        client.reject(f"command {command} {why}", command, now_us)
        return DENIED if known or command in _DANGEROUS else UNSUPPORTED

    def _setpoint(self, client: ConnectedClient, message: Received, now: Now) -> None:
        now_us = now.monotonic_us
        if now_us < client.setpoint_us:
            return  # it comes again
        row = self._state.translation.row(MESSAGE, message.message, message)
        if row is None:
            what = SETPOINTS[message.message]
            client.link.text(f"{what} refused: send positions", now_us, what)
            client.link.record("refused", now_us, message=message.message)
            return
        if not client.source.guided:
            mode = "OFFBOARD" if self._state.settings.autopilot == PX4 else "GUIDED"
            client.setpoint_us = now_us + REFUSED_US
            client.link.text(f"setpoints wait until you ask for mode {mode}", now_us, "guided", NOTICE)
            client.link.record("refused", now_us, message=message.message, reason=f"not in {mode}")
            return
        result = self._proposing.propose(client, message, self._state.step(client.link, row, message, now), -1, now)
        if result not in (None, ACCEPTED):
            client.setpoint_us = now_us + REFUSED_US

    def _set_mode(self, client: ConnectedClient, message: Received, now: Now) -> None:
        """SET_MODE: ArduPilot acknowledges it as a command of the same number, PX4 does not."""
        command = layouts.SET_MODE if self._state.settings.autopilot != PX4 else -1
        if message.fields["base_mode"] & enums.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            result = self._mode(client, message, message.fields["custom_mode"], command, now)
        else:
            client.reject("modes without a custom mode are refused", layouts.SET_MODE, now.monotonic_us)
            result = DENIED
        if result is not None and command >= 0:
            client.link.ack(message.sender, command, result)

    def _do_set_mode(self, client: ConnectedClient, message: Received, now: Now) -> int | None:
        base, main, sub = (message.whole(f"param{number}") for number in (1, 2, 3))
        if base < 0 or not base & enums.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED or not 0 <= main <= 0xFF:
            client.reject("modes without a custom mode are refused", layouts.SET_MODE, now.monotonic_us)
            return DENIED
        mode = main
        if self._state.settings.autopilot == PX4:
            mode = main << 16 | (sub << 24 if 0 <= sub <= 0xFF else 0)
        return self._mode(client, message, mode, enums.MAV_CMD_DO_SET_MODE, now)

    def _mode(self, client: ConnectedClient, message: Received, mode: int, command: int, now: Now) -> int | None:
        """A request for a mode: shown without effect, a mission's start, or a step. Return its result, None if that
        comes later.
        """
        guided, auto = (each[self._state.settings.autopilot == PX4] for each in (_WITHOUT_EFFECT, _MISSION_MODES))
        now_us = now.monotonic_us
        if mode == guided:
            client.source.guided = True
            if self._state.seen.mode != mode:
                client.shown.show_mode(mode, now_us)
            return ACCEPTED
        if mode == auto:
            return self._missions.start(client, message, command, now)
        row = self._state.translation.row(MODE, mode, message)
        if row is None:
            names = PX4_NAMES if self._state.settings.autopilot == PX4 else COPTER_NAMES
            client.reject(f"mode {names.get(mode, str(mode))} has no mapping", command, now_us)
            return DENIED
        state = self._state
        if state.rests and state.translation.contract(row.skill) is not None and not state.climbs(row.skill):
            self._proposing.take_back(f"{client.link.name} asks for {row.skill}", now_us, client.link.name)
            client.source.guided = False
            hindrance = self._proposing.takes_off()
            if hindrance is not None:
                client.reject(f"{row.skill} rejected: {hindrance[1]}", command, now_us)
                return hindrance[0]
            client.shown.show_mode(mode, now_us)
            return ACCEPTED
        return self._proposing.propose(client, message, self._state.step(client.link, row, message, now), command, now)

    def _param_set(self, client: ConnectedClient, message: Received, now: Now) -> None:
        state, bytewise = self._state, is_bytewise(self._state.settings.autopilot)
        known = set_parameter(client.link, state.seen, message, state.shadowed, now.monotonic_us, bytewise=bytewise)
        if not known and "parameters" in client.link.settings.requests:
            self._state.requests.want_parameter(client.link, parameter_name(message))

    def _param_read(self, client: ConnectedClient, message: Received, now: Now) -> None:
        self._state.requests.read_parameter(client.link, message, parameter_name(message), now.monotonic_us)

    def _version(self, client: ConnectedClient, message: Received, now: Now) -> None:
        asked = client.link, message.sender, enums.MAV_CMD_REQUEST_MESSAGE, layouts.AUTOPILOT_VERSION
        self._state.requests.message(*asked, now.monotonic_us)

    def _files(self, client: ConnectedClient, message: Received, now: Now) -> None:
        """FTP is refused, with the protocol's own answer, so that no client waits for it."""
        payload = message.fields["payload"]
        sequence = int.from_bytes(payload[:2], "little") + 1 & 0xFFFF
        refusal, unknown_command = 129, 7
        said = bytes([payload[2], refusal, 1, payload[3], 0, 0, *bytes(4), unknown_command])
        target = dict(zip(("target_system", "target_component"), message.sender, strict=True))
        number = layouts.FILE_TRANSFER_PROTOCOL
        client.link.send(number, **target, payload=sequence.to_bytes(2, "little") + said)
        client.link.record("refused", now.monotonic_us, message=number)

    def _tick(self, now: Now) -> None:
        now_us = now.monotonic_us
        self._state.requests.tick(now_us)
        self._proposing.take_held(now)
        self._proposing.tick(now_us)
        every_second = now_us - self._second_us >= SECOND_US
        for client in list(self._state.clients.values()):
            client.transfer.tick(now_us)
            client.shown.update(now_us)
            if client.link.silent(now_us) and not client.link.is_dead:
                self._proposing.die(client, now_us)
            if every_second:
                self._missions.mission_current(client, always=True)
        if every_second:
            self._control.tell(now_us)
            self._missions.check_again()
            self._second_us = now_us
        self._proposing.end_without_client(now_us)
        self._proposing.tidy(now_us)

    def _down(self, number: int, now_us: int, *, relay_ended: bool) -> None:
        self._control.pilots.leave(number, relay_ended=relay_ended)
        client = self._state.clients.pop(number, None)
        if client is None:
            return
        self._state.requests.forget(number)
        self._proposing.forget(client)
        self._missions.forget(client)
        if client.link.is_regular and not client.link.is_dead:
            self._proposing.die(client, now_us)
