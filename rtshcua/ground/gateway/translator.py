"""The pure part of the gateway: from frames of clients, frames of the vehicle, lines of the flight and time to answers
and proposals. It never passes a client's frame on.

Two clients that contradict each other are decided by rank and policy, never by who sent last. The client whose step
flies or waits is in control, and for `KEEPS_US` after its last step. Another client's command is taken if its rank in
the configuration is higher, or if its skill is one of the policy's `contingency`, which stops, returns or lands, and
the step that flies is none that stands later there: nobody stops another one's landing. Otherwise it is rejected. The
policy decides on every step besides. A pilot who requests control keeps it until he releases it.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from math import isnan
from typing import Any, Final, TypeAlias

from rtshcua.ground.gateway.accepted import COMMAND, ITEM, MESSAGE, MODE
from rtshcua.ground.gateway.client_frames import (
    AUTOPILOT_VERSION,
    AUTOPILOT_VERSION_REQUEST,
    COMMAND_ACK,
    CONTROL_STATUS,
    FILE_TRANSFER_PROTOCOL,
    LOG_REQUEST_LIST,
    MISSION_CURRENT,
    MISSION_ITEM,
    MISSION_ITEM_REACHED,
    MISSION_SET_CURRENT,
    MISSION_WRITE_PARTIAL_LIST,
    REQUEST_DATA_STREAM,
    SET_MODE,
    SETPOINTS,
    SETUP_SIGNING,
    Received,
    received,
)
from rtshcua.ground.gateway.client_link import NOTICE, ClientLink
from rtshcua.ground.gateway.client_proposal import AGAIN_US, Asker, ClientProposal
from rtshcua.ground.gateway.habits import ShownState, set_parameter
from rtshcua.ground.gateway.harmless_requests import COMMANDS as REQUESTING
from rtshcua.ground.gateway.harmless_requests import HarmlessRequests
from rtshcua.ground.gateway.interface import (
    Action,
    Cancel,
    ClientDown,
    ClientUp,
    Event,
    FlightEnded,
    FlightLine,
    FromClient,
    FromPilot,
    FromVehicle,
    GatewaySettings,
    ProposalAnswered,
    ProposalChecked,
    Propose,
    ProposedStep,
    RequestAnswered,
    Tick,
    Withdraw,
    Withhold,
)
from rtshcua.ground.gateway.pilots import Pilots
from rtshcua.ground.gateway.plan_transfer import MISSION_DENIED, PlanTransfer, RefusedPlan, UploadedPlan, read_plan
from rtshcua.ground.gateway.quick_decision import QuickDecision, QuickRefusal
from rtshcua.ground.gateway.translation import (
    ACCEPTED,
    CANCELLED,
    DENIED,
    IN_PROGRESS,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    Translation,
    Untranslated,
    shadowed_parameters,
)
from rtshcua.ground.gateway.vehicle_seen import VehicleSeen, parameter_name
from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.modes import COPTER_NAMES, PX4, PX4_NAMES, CopterMode, Px4Mode
from rtshcua.mavlink.parameters import is_bytewise
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.situation import Now
from rtshcua.wire.request import CONTINGENCY_LINK, STEP

#: how long a client keeps control after its last step, us
KEEPS_US: Final = 10_000_000
#: the least interval of proposals that come from setpoints of one client, us
SETPOINT_US: Final = 500_000
#: how long a command waits for a flight that is not ready yet, us
HELD_US: Final = 10_000_000
_NO_FLIGHT: Final = "no flight is ready yet"
_LANDS: Final = "the vehicle is still landing"
#: the most proposals of one client that are neither taken nor refused
MOST_OPEN: Final = 4
_SECOND_US: Final = 1_000_000
#: how long the same command gets the same refusal, and after a refused setpoint the next ones are passed over, us
REFUSED_US: Final = 200_000
#: the most decisions a second on commands of one client; those that stop, return or land are counted apart
MOST_DECISIONS: Final = 20
_TOO_MANY: Final = f"too many commands: at most {MOST_DECISIONS} a second are decided"
_MOST_CLIENTS: Final = 256

_SET_MISSION_CURRENT: Final = 224
_GUIDED_ITEM: Final = 2  # `current` of a mission item that is flown to at once (ArduPilot)
#: commands that would change the vehicle itself: denied; other commands without a mapping are not supported
_DANGEROUS: Final = frozenset({179, 181, 183, 184, 185, 187, 207, 209, 241, 242, 245, 246, 420, 42_428})
#: frames that say something about the client, and request nothing
_SAYS_NOTHING: Final = frozenset(
    {
        layouts.HEARTBEAT, layouts.SYSTEM_TIME, 4, layouts.PARAM_VALUE, COMMAND_ACK, 109, 141, 148, layouts.STATUSTEXT,
        300, MISSION_CURRENT, layouts.GLOBAL_POSITION_INT,
    }
)  # fmt: skip
#: what an absorbed mode is: clients ask for it before they send targets
_WITHOUT_EFFECT: Final = (CopterMode.GUIDED, Px4Mode.OFFBOARD)
_MISSION_MODES: Final = (CopterMode.AUTO, Px4Mode.MISSION)
#: the flight's answers to a document that a later one may not get
_FOR_NOW: Final = frozenset({"busy", "already-released", "superseded", "not-flying", "falling-back"})
#: the motions at whose end the vehicle stands on the ground
_DOWN: Final = (MotionKind.HOME, MotionKind.LAND)
# MISSION_STATE
_NOT_STARTED, _ACTIVE, _PAUSED, _COMPLETE = 2, 3, 4, 5


@dataclass(slots=True)
class _Held:
    """A command that waits for a flight, until when, and when its client was last told that it is in progress."""

    client: "_Client"
    message: Received
    command: int
    until_us: int
    told_us: int


@dataclass(slots=True)
class _Source:
    """What all connections of one configured client share, also later ones: its values of parameters that only give
    defaults, and the mission that it started last with the plan of that. Its plan is in `Gateway._plans`. `withdrawn`:
    why its mission was withdrawn, until one of them is told.
    """

    role: str
    #: whether its setpoints are heeded: whether it is, as it sees it, in GUIDED or OFFBOARD
    guided: bool
    shadows: dict[str, float] = field(default_factory=dict)
    mission: tuple[ClientProposal, UploadedPlan] | None = None
    withdrawn: str = ""
    #: when its last commands were decided, us: those of other skills, and those of safe ones
    decided: tuple[deque[int], deque[int]] = field(
        default_factory=lambda: (deque(maxlen=MOST_DECISIONS), deque(maxlen=MOST_DECISIONS))
    )

    def may_decide(self, now_us: int, *, safe: bool = False) -> bool:
        """Whether one more command may be decided now. It is counted."""
        times = self.decided[safe]
        if len(times) == MOST_DECISIONS and now_us - times[0] < _SECOND_US:
            return False
        times.append(now_us)
        return True


class _Client:
    """One connection of an ordinary client with everything that is kept about it."""

    def __init__(self, link: ClientLink, source: _Source, shown: ShownState, transfer: PlanTransfer) -> None:
        self.link = link
        self.source = source
        self.shown = shown
        self.transfer = transfer
        self.latest: ClientProposal | None = None
        #: the earliest time of the next proposal from a setpoint
        self.setpoint_us = 0
        #: its last command, what it was decided on, the result, and until when that is repeated
        self.refused: tuple[object, int, int] | None = None
        self.reported: tuple[int, int] | None = None  # the last MISSION_CURRENT: item and state


_Handler: TypeAlias = Callable[[_Client, Received, Now], None]


class Gateway:
    """All clients of one vehicle. `take` is called with each event, in order, by one caller."""

    def __init__(self, settings: GatewaySettings) -> None:
        self._actions: list[Action] = []
        self._seen = VehicleSeen(settings.system)
        self._requests = HarmlessRequests(settings, self._seen, self._actions)
        self._under(settings)
        self._clients: dict[int, _Client] = {}
        self._sources: dict[str, _Source] = {}
        self._pilots = Pilots(settings.system)
        self._proposals: dict[int, ClientProposal] = {}
        self._uploads: dict[int, _Client] = {}
        #: missions that are to be checked under a renewed policy, and those that are being checked, by proposal
        self._unchecked: set[str] = set()
        self._rechecks: dict[int, tuple[str, UploadedPlan]] = {}
        self._held: list[_Held] = []
        self._holds = True
        self._plans: dict[str, UploadedPlan] = {}
        self._number = 0
        self._flown: ClientProposal | None = None  # the proposal whose step was dispatched last
        self._kept: tuple[ClientLink, int] | None = None  # who was in control last, and until when
        self._stage = ""  # of the flight: "", "waiting", "flying"
        self._unready: str | None = None
        self._flew = False  # whether the vehicle was in the air during this flight
        self._displaced = False  # whether the flight flew something else after that, which is no hold
        self._cancelled = False  # whether this flight was cancelled, because its client is dead
        self._judged = False  # whether the flight has said if the vehicle is ready
        self._second_us = 0
        self._handlers = self._by_message()

    def _under(self, settings: GatewaySettings) -> None:
        """Take what depends on the policy."""
        self._settings = settings
        self._translation = Translation(settings, self._seen)
        self._quick = QuickDecision(settings)
        self._shadowed = shadowed_parameters(settings.accepted)
        policy = settings.policy.policy
        links = enumerate(policy.contracts[link.skill].motion.kind for link in policy.contingency)
        self._holding = {number for number, kind in links if kind == MotionKind.HOLD}
        self._safe = [policy.contracts[link.skill].name for link in policy.contingency]

    def renew(self, settings: GatewaySettings, now: Now) -> list[Action]:
        """Another policy with the same signals is in force, while nothing flies. Everything is kept; stored missions
        are read again, and checked again under it.
        """
        now_us = now.monotonic_us
        self._under(settings)
        for client in self._clients.values():
            client.transfer.translation = self._translation
        for client in dict.fromkeys(self._uploads.values()):
            client.transfer.checked("the policy was renewed: upload it again", now_us)
        self._uploads.clear()
        for name, plan in list(self._plans.items()):
            source = self._sources[name]
            read = read_plan(plan.items, self._translation, source.shadows, now_us, settings.autopilot)
            if isinstance(read, RefusedPlan):
                self._withdraw(name, read.text, now_us)
                continue
            self._plans[name] = read
            self._unchecked.add(name)
            mission = source.mission
            source.mission = (mission[0], read) if mission is not None and mission[1] is plan else None
        return self._taken()

    def _check_again(self) -> None:
        """Ask for the check of missions that were stored under an earlier policy."""
        for name in sorted(self._unchecked & self._plans.keys()):
            self._number += 1
            self._rechecks = {at: each for at, each in self._rechecks.items() if each[0] != name}
            self._rechecks[self._number] = name, self._plans[name]
            client = next((each.link.client for each in self._of(name)), 0)
            steps = self._from_ground(self._plans[name].steps)[0]
            self._actions.append(Propose(self._number, client, self._sources[name].role, steps, fly=False))
        self._unchecked.clear()

    def _withdraw(self, name: str, why: str, now_us: int) -> None:
        """Forget a mission that the policy does not permit any more, and tell its client once it is there."""
        del self._plans[name]
        source = self._sources[name]
        source.mission, source.withdrawn = None, f"mission withdrawn, the policy was renewed: {why}"
        for client in self._of(name)[:1]:
            self._of_mission(client, now_us)

    def take(self, event: Event, now: Now) -> list[Action]:
        """What is to be done after an event."""
        match event:
            case FromVehicle(frame):
                self._from_vehicle(frame, now.monotonic_us)
            case FromClient(client, frame):
                self._from_client(client, frame, now)
            case FromPilot(client, frame):
                self._from_pilot(client, frame, now.monotonic_us)
            case FlightLine(line):
                self._flight_line(dict(line), now.monotonic_us)
            case Tick():
                self._tick(now)
            case _:
                self._rare(event, now)
        return self._taken()

    def _taken(self) -> list[Action]:
        actions = self._actions[:]
        self._actions.clear()
        return actions

    def _rare(self, event: Event, now: Now) -> None:
        match event:
            case ClientUp(client, of):
                link = ClientLink(client, of, self._settings.system, self._actions, now.monotonic_us)
                self._actions.append(Withhold(client, frozenset()))  # an earlier gateway may have withheld something
                if of.pilot:
                    self._pilots.join(link)
                elif len(self._clients) < _MOST_CLIENTS:
                    self._join(link, now.monotonic_us)
            case ClientDown(client):
                self._down(client, now.monotonic_us)
            case RequestAnswered(number, slug):
                self._requests.answered(number, slug, now.monotonic_us)
            case ProposalChecked():
                self._checked(event, now.monotonic_us)
            case ProposalAnswered(number, slug, text):
                self._answered(number, slug, text, now.monotonic_us)
            case FlightEnded():
                self._ended("", now.monotonic_us)

    def _join(self, link: ClientLink, now_us: int) -> None:
        """A client is there: it goes on with what its former connection left."""
        source = self._sources.setdefault(link.name, _Source(link.settings.role, self._settings.autopilot != PX4))
        link.shadows = source.shadows
        transfer = PlanTransfer(link, self._translation, self._settings.autopilot, self._plans)
        shown = ShownState(link, self._seen, self._actions, self._settings.autopilot)
        self._clients[link.client] = client = _Client(link, source, shown, transfer)
        for each in self._proposals.values():
            if each.link.name == link.name:
                each.move({asker.link.client for asker in each.askers} - self._clients.keys(), link)
        self._of_mission(client, now_us)

    # ---------------------------------------------------------------- the vehicle and the pilot

    def _from_vehicle(self, frame: bytes, now_us: int) -> None:
        number = self._seen.take(frame, now_us)
        if number == layouts.HEARTBEAT:
            self._flew |= self._stage == "flying" and not self._seen.on_ground
            for client in self._clients.values():
                client.shown.update(now_us)
                client.shown.heartbeat(now_us)
        if number in (layouts.SYSTEM_TIME, layouts.GLOBAL_POSITION_INT) and self._seen.restarted(number):
            self._requests.forget_vehicle()
        self._requests.seen(number)

    def _from_pilot(self, client: int, frame: bytes, now_us: int) -> None:
        """A pilot's frame: if he takes control, nothing begins any more that clients asked for before."""
        if not self._pilots.take(client, frame, now_us):
            return
        if self._pilots.in_control:
            self._take_back("the pilot is in control", now_us)
        self._control_status(now_us)

    # ---------------------------------------------------------------- frames of clients

    def _by_message(self) -> dict[int, _Handler]:
        def transfer(function: Callable[[PlanTransfer, Received, int], None]) -> _Handler:
            return lambda client, message, now: self._transferred(function, client, message, now)

        def asks(function: Callable[[ClientLink, Received, int], None]) -> _Handler:
            return lambda client, message, now: function(client.link, message, now.monotonic_us)

        return {
            layouts.COMMAND_LONG: self._command,
            layouts.COMMAND_INT: self._command,
            SET_MODE: self._set_mode,
            **dict.fromkeys(SETPOINTS, self._setpoint),
            layouts.PARAM_SET: self._param_set,
            layouts.PARAM_REQUEST_READ: self._param_read,
            layouts.PARAM_REQUEST_LIST: asks(lambda link, _, now_us: self._requests.list_parameters(link, now_us)),
            layouts.MISSION_COUNT: transfer(PlanTransfer.count),
            layouts.MISSION_CLEAR_ALL: transfer(PlanTransfer.clear),
            MISSION_WRITE_PARTIAL_LIST: transfer(PlanTransfer.unsupported),
            layouts.MISSION_ITEM_INT: self._item,
            MISSION_ITEM: self._item,
            layouts.MISSION_REQUEST_LIST: lambda client, message, now: client.transfer.request_list(message),
            layouts.MISSION_REQUEST: lambda client, message, now: client.transfer.request(message),
            layouts.MISSION_REQUEST_INT: lambda client, message, now: client.transfer.request(message),
            layouts.MISSION_ACK: lambda client, message, now: client.transfer.acknowledged(message),
            MISSION_SET_CURRENT: self._set_current,
            REQUEST_DATA_STREAM: asks(self._requests.data_stream),
            layouts.TIMESYNC: asks(self._requests.time),
            LOG_REQUEST_LIST: asks(self._requests.logs),
            AUTOPILOT_VERSION_REQUEST: self._version,
            FILE_TRANSFER_PROTOCOL: self._files,
        }

    def _from_client(self, number: int, frame: bytes, now: Now) -> None:
        client, message = self._clients.get(number), received(frame)
        if client is None or message is None:
            return
        client.link.hear(message, now.monotonic_us)
        if message.message in _SAYS_NOTHING or not message.is_for(self._settings.system):
            return
        handler = self._handlers.get(message.message)
        if message.message not in (layouts.COMMAND_LONG, layouts.COMMAND_INT):
            client.refused = None  # it may have changed what the command was refused for
        if handler is not None:
            handler(client, message, now)
        else:
            what = "signing set-up" if message.message == SETUP_SIGNING else f"message {message.message}"
            client.link.text(f"{what} is refused", now.monotonic_us, what)
            client.link.record("refused", now.monotonic_us, message=message.message)

    def _command(self, client: _Client, message: Received, now: Now) -> None:
        """COMMAND_LONG, COMMAND_INT. A repeated one costs nearly nothing: it has the answer of the last one."""
        command, now_us = message.fields["command"], now.monotonic_us
        seen, content = self._seen, repr({**message.fields, "confirmation": 0})  # in `repr` NaN is equal to NaN
        state = (
            content, self._stage, self._unready, self._pilots.in_control, seen.armed, seen.landed_state,
            len(seen.parameters),
        )  # fmt: skip
        if client.refused is not None and client.refused[0] == state and now_us < client.refused[2]:
            client.link.ack(message.sender, command, client.refused[1])
            return
        result = self._result(client, message, command, now)
        client.refused = None
        if result is not None:
            client.link.ack(message.sender, command, result)
            if result != ACCEPTED and self._holds:
                client.refused = state, result, now_us + REFUSED_US

    def _result(self, client: _Client, message: Received, command: int, now: Now) -> int | None:
        """The result of a command; None if the answer comes later."""
        now_us = now.monotonic_us
        result: int | None
        if command == enums.MAV_CMD_COMPONENT_ARM_DISARM:
            wanted, hindrance = message.number("param1"), None
            if wanted == 1:
                hindrance = self._cannot_take_off(client, now)
            elif wanted == 0:
                self._take_back(f"{client.link.name} disarms", now_us, client.link.name)
                hindrance = self._takes_off()
            result = client.shown.arm(message, now_us, hindrance)
        elif command in REQUESTING:
            result = self._requests.command(client.link, message, now_us)
        elif command == enums.MAV_CMD_DO_SET_MODE:
            result = self._do_set_mode(client, message, now)
        elif command == enums.MAV_CMD_MISSION_START:
            result = self._start_whole(client, message, command, now)
        elif command == enums.MAV_CMD_REQUEST_OPERATOR_CONTROL:
            result = self._asks_for_control(client, command, now_us)
        elif command == _SET_MISSION_CURRENT:
            result = self._jump(client, message.number("param1"), now_us)
        else:
            result = self._mapped(client, message, command, now)
        return result

    def _mapped(self, client: _Client, message: Received, command: int, now: Now) -> int | None:
        """A command that the table may have; its result, None if the answer comes later."""
        row, now_us = self._translation.row(COMMAND, command, message), now.monotonic_us
        if row is not None:
            return self._propose(client, message, self._step(client, row, message, now_us), command, now)
        known = self._translation.knows(COMMAND, command)
        why = "with these parameters is refused" if known else "has no mapping"
        self._reject(client, f"command {command} {why}", command, now_us)
        return DENIED if known or command in _DANGEROUS else UNSUPPORTED

    def _step(self, client: _Client, row: Any, message: Received, now_us: int) -> ProposedStep | Untranslated:
        step = self._translation.step(row, message, client.link.shadows, now_us)
        if isinstance(step, Untranslated) and step.wanted:
            self._requests.want_parameter(client.link, step.wanted)
        return step

    def _setpoint(self, client: _Client, message: Received, now: Now) -> None:
        now_us = now.monotonic_us
        if now_us < client.setpoint_us:
            return  # it comes again
        row = self._translation.row(MESSAGE, message.message, message)
        if row is None:
            what = SETPOINTS[message.message]
            client.link.text(f"{what} refused: send positions", now_us, what)
            client.link.record("refused", now_us, message=message.message)
            return
        if not client.source.guided:
            mode = "OFFBOARD" if self._settings.autopilot == PX4 else "GUIDED"
            client.setpoint_us = now_us + REFUSED_US
            client.link.text(f"setpoints wait until you ask for mode {mode}", now_us, "guided", NOTICE)
            client.link.record("refused", now_us, message=message.message, reason=f"not in {mode}")
            return
        result = self._propose(client, message, self._step(client, row, message, now_us), -1, now)
        if result not in (None, ACCEPTED):
            client.setpoint_us = now_us + REFUSED_US

    def _reject(self, client: _Client, text: str, command: int, now_us: int) -> None:
        client.link.text(text, now_us, text)
        client.link.record("refused", now_us, command=command, reason=text)

    # ---------------------------------------------------------------- modes

    def _set_mode(self, client: _Client, message: Received, now: Now) -> None:
        """SET_MODE: ArduPilot acknowledges it as a command of the same number, PX4 does not."""
        command = SET_MODE if self._settings.autopilot != PX4 else -1
        if message.fields["base_mode"] & enums.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            result = self._mode(client, message, message.fields["custom_mode"], command, now)
        else:
            self._reject(client, "modes without a custom mode are refused", SET_MODE, now.monotonic_us)
            result = DENIED
        if result is not None and command >= 0:
            client.link.ack(message.sender, command, result)

    def _do_set_mode(self, client: _Client, message: Received, now: Now) -> int | None:
        base, main, sub = (message.whole(f"param{number}") for number in (1, 2, 3))
        if base < 0 or not base & enums.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED or not 0 <= main <= 0xFF:
            self._reject(client, "modes without a custom mode are refused", SET_MODE, now.monotonic_us)
            return DENIED
        mode = main
        if self._settings.autopilot == PX4:
            mode = main << 16 | (sub << 24 if 0 <= sub <= 0xFF else 0)
        return self._mode(client, message, mode, enums.MAV_CMD_DO_SET_MODE, now)

    def _mode(self, client: _Client, message: Received, mode: int, command: int, now: Now) -> int | None:
        """A request for a mode: shown without effect, a mission's start, or a step. Return its result, None if that
        comes later.
        """
        guided, auto = (each[self._settings.autopilot == PX4] for each in (_WITHOUT_EFFECT, _MISSION_MODES))
        now_us = now.monotonic_us
        if mode == guided:
            client.source.guided = True
            if self._seen.mode != mode:
                client.shown.show_mode(mode, now_us)
            return ACCEPTED
        if mode == auto:
            return self._start(client, message, command, now)
        row = self._translation.row(MODE, mode, message)
        if row is None:
            names = PX4_NAMES if self._settings.autopilot == PX4 else COPTER_NAMES
            self._reject(client, f"mode {names.get(mode, str(mode))} has no mapping", command, now_us)
            return DENIED
        if self._rests and self._translation.contract(row.skill) is not None and not self._climbs(row.skill):
            self._take_back(f"{client.link.name} asks for {row.skill}", now_us, client.link.name)
            client.source.guided = False
            hindrance = self._takes_off()
            if hindrance is not None:
                self._reject(client, f"{row.skill} rejected: {hindrance[1]}", command, now_us)
                return hindrance[0]
            client.shown.show_mode(mode, now_us)
            return ACCEPTED
        return self._propose(client, message, self._step(client, row, message, now_us), command, now)

    @property
    def _rests(self) -> bool:
        """Whether the vehicle is on the ground and no mission flies."""
        return self._stage != "flying" and self._seen.on_ground

    @property
    def _lands(self) -> bool:
        """Whether the vehicle lands, or has touched down and its flight is not over."""
        if self._seen.landed_state == enums.MAV_LANDED_STATE_LANDING:
            return True
        return self._flew and self._seen.on_ground

    # ---------------------------------------------------------------- proposals

    def _propose(
        self, client: _Client, message: Received, step: ProposedStep | Untranslated, command: int, now: Now
    ) -> int | None:
        """Propose one step; the result for the client, None if the answer comes later."""
        if isinstance(step, Untranslated):
            now_us = now.monotonic_us
            client.link.text(step.text, now_us, step.text if command < 0 else "")
            client.link.record("refused", now_us, command=command, reason=step.text)
            return step.result
        return self._offer(client, (step,), message, command, now)

    def _offer(
        self, client: _Client, steps: tuple[ProposedStep, ...], message: Received, command: int, now: Now
    ) -> int | None:
        now_us, latest, safe = now.monotonic_us, client.latest, steps[0].skill in self._safe
        if safe:
            self._withdraw_waiting(f"{client.link.name} asks for {steps[0].skill}", now_us, client.link.name)
        guided = message.message in (layouts.MISSION_ITEM_INT, MISSION_ITEM)
        asker = Asker(client.link, message.sender, command, guided)
        if latest is not None and latest.steps == steps and self._stands(latest):
            if not latest.answered:
                latest.again(asker)
            return ACCEPTED if latest.answered else None
        own = [each for each in self._proposals.values() if each.link is client.link and not each.ended]
        waiting = [each for each in own if not each.taken]
        if command < 0 and waiting:
            return None  # it comes again
        if not client.source.may_decide(now_us, safe=safe):
            client.link.text(_TOO_MANY, now_us, _TOO_MANY)
            client.link.record("refused", now_us, skill=steps[0].skill, reason=_TOO_MANY)
            return TEMPORARILY_REJECTED
        refusal = self._refusal(client, steps[0], now)
        if refusal is not None:
            return self._refuse(client, refusal, message, command, now_us)
        if len(waiting) >= MOST_OPEN:
            return TEMPORARILY_REJECTED
        if safe:
            self._withdraw_waiting(f"{client.link.name} asks for {steps[0].skill}", now_us)
            client.source.guided = False
        client.setpoint_us = now_us + SETPOINT_US if command < 0 else client.setpoint_us
        self._number += 1
        proposal = ClientProposal(
            self._number, client.link, [asker], steps, now_us, borrows=self._outranked(client, now_us) is not None
        )
        self._proposals[self._number] = client.latest = proposal
        self._actions.append(Propose(self._number, client.link.client, client.link.settings.role, steps))
        return None

    def _refusal(self, client: _Client, step: ProposedStep, now: Now) -> QuickRefusal | None:
        """Why a step is certainly refused by the policy, or cannot be taken now."""
        if self._climbs(step.skill) and self._lands:
            return QuickRefusal(TEMPORARILY_REJECTED, _LANDS, step.skill, _LANDS)
        refusal = self._quick.refusal(step, client.link.settings.role, now)
        hindrance = None if refusal is not None else self._hindrance(client, step, now.monotonic_us)
        if hindrance is None:
            return refusal
        return QuickRefusal(TEMPORARILY_REJECTED, hindrance, step.skill, hindrance)

    def _refuse(
        self, client: _Client, refusal: QuickRefusal, message: Received, command: int, now_us: int
    ) -> int | None:
        """Tell and record a refusal, and return its result; None if the command waits instead."""
        if refusal.reason == _NO_FLIGHT and self._hold(client, message, command, now_us):
            return None
        if refusal.skill in self._safe:
            self._take_back(f"{client.link.name} asks for {refusal.skill}", now_us, client.link.name)
        client.link.text(refusal.text, now_us, f"{refusal.skill} {refusal.reason}" if command < 0 else "")
        client.link.record("refused", now_us, skill=refusal.skill, reason=refusal.reason, answer=refusal.text)
        return refusal.result

    def _hold(self, client: _Client, message: Received, command: int, now_us: int) -> bool:
        """Whether a command waits for the next flight, which is ready some seconds after a landing."""
        if command < 0 or not self._holds or message.message in (layouts.MISSION_ITEM_INT, MISSION_ITEM):
            return False
        own = [each for each in self._held if each.client is client]
        same = next((each for each in own if each.command == command), None)
        if same is not None:  # sent again, or changed: the last one counts, and waits no longer for it
            same.message, same.told_us = message, now_us
        elif len(own) < MOST_OPEN:
            self._held.append(_Held(client, message, command, now_us + HELD_US, now_us))
        else:
            return False
        client.link.ack(message.sender, command, IN_PROGRESS)
        return True

    def _take_back(self, why: str, now_us: int, name: str = "") -> None:
        """Withdraw what clients, or one of them, asked for and what did not begin yet. A flight that has such a step
        already is cancelled: on the ground it ends, in the air its contingency flies.
        """
        self._withdraw_waiting(why, now_us, name, safe_too=not name)
        for each in self._pending(name, safe_too=not name):
            each.withdrawn = why
        self._cancel_withdrawn(now_us)

    def _withdraw_waiting(self, why: str, now_us: int, name: str = "", *, safe_too: bool = False) -> None:
        """Withdraw what waits for a flight, or was not handed in to it yet, of all clients or of one of them."""
        for held in [one for one in self._held if name in ("", one.client.link.name)]:
            self._held.remove(held)
            held.client.link.ack(held.message.sender, held.command, CANCELLED)
        for each in self._pending(name, safe_too=safe_too):
            if each.first < 0:
                self._actions.append(Withdraw(each.number))
                each.refuse(CANCELLED, f"{each.steps[0].skill} withdrawn: {why}", now_us)

    def _pending(self, name: str, *, safe_too: bool) -> list[ClientProposal]:
        """The proposals of which no step was dispatched, of all clients or of one of them; those that only stop, return
        or land are left out.
        """
        return [
            each
            for each in self._proposals.values()
            if not each.ended
            and each.flies < 0
            and name in ("", each.link.name)
            and (safe_too or any(step.skill not in self._safe for step in each.steps))
        ]

    def _cancel(self, link: ClientLink, why: str, now_us: int) -> None:
        """Cancel the flight, once: its contingency flies, or on the ground it ends."""
        self._cancelled = True
        self._actions.append(Cancel(link.client, why))
        for other in self._clients.values():
            if other.link is not link:
                other.link.text(f"{why}: the flight is cancelled", now_us, severity=NOTICE)

    def _cancel_withdrawn(self, now_us: int) -> None:
        """Cancel the flight, once it can be, that has a step which is not wanted any more."""
        of = next((each for each in self._proposals.values() if each.withdrawn and not each.ended), None)
        if of is not None and self._stage == "flying" and not self._cancelled:
            self._cancel(of.link, of.withdrawn, now_us)

    def _takes_off(self) -> tuple[int, str] | None:
        """What may take off although a client disarms or lands on the ground, and the MAV_RESULT."""
        for each in self._proposals.values():
            if each.withdrawn and not each.ended:
                return TEMPORARILY_REJECTED, f"the flight of {each.steps[0].skill} is being cancelled: ask again"
            if not each.ended and not self._brings_down(each):
                return TEMPORARILY_REJECTED, f"{each.steps[0].skill} is under way: land"
        if self._held:
            return TEMPORARILY_REJECTED, f"{self._held[0].client.link.name} waits to take off"
        return None

    def _take_held(self, now: Now) -> None:
        """Take the commands that waited for a flight, now that there is one, or refuse them after too long."""
        ready = self._stage == "flying" or (self._stage == "waiting" and self._judged)
        now_us = now.monotonic_us
        self._held = [each for each in self._held if not each.client.link.is_dead]
        due = [each for each in self._held if ready or now_us >= each.until_us]
        self._held = [each for each in self._held if each not in due]
        self._holds = False
        try:
            for each in due:
                self._handlers[each.message.message](each.client, each.message, now)
        finally:
            self._holds = True
        for each in self._held:
            if now_us - each.told_us >= AGAIN_US:
                each.told_us = now_us
                each.client.link.ack(each.message.sender, each.command, IN_PROGRESS)

    def _cannot_take_off(self, client: _Client, now: Now) -> tuple[int, str] | None:
        """Why no take-off of this client could follow an arming now, whatever its height, and the MAV_RESULT."""
        if self._lands:
            return TEMPORARILY_REJECTED, _LANDS
        if self._seen.armed:
            return None
        if self._stage == "waiting" and self._unready is not None:
            return TEMPORARILY_REJECTED, self._unready
        if not client.source.may_decide(now.monotonic_us):
            return TEMPORARILY_REJECTED, _TOO_MANY
        refusals: list[QuickRefusal] = []
        for step in self._translation.takeoffs_to():
            refusal = None if step is None else self._quick.refusal(step, client.link.settings.role, now)
            if refusal is None or refusal.by_argument:
                return None
            refusals.append(refusal)
        least = min(refusals, key=lambda each: each.result, default=None)
        return None if least is None else (least.result, least.words)

    def _stands(self, proposal: ClientProposal) -> bool:
        """Whether a proposal still says what the vehicle does: it is under way, or nothing was flown after it."""
        stands = self._stage == "flying" and self._flown is proposal and proposal.done > 0 and not self._displaced
        return not proposal.ended or stands

    def _hindrance(self, client: _Client, step: ProposedStep, now_us: int) -> str | None:
        """Why a step cannot be taken now, although the policy may permit it."""
        if self._pilots.in_control:
            return "the pilot is in control"
        rival = self._outranked(client, now_us)
        if rival is not None and not self._is_safer(step.skill):
            return f"{rival.name} is in control"
        if self._stage == "flying" and (self._flown is not None or not self._seen.on_ground):
            return None
        if not self._seen.on_ground:
            return "the vehicle flies under another control"
        if not self._climbs(step.skill):
            return "the vehicle is on the ground: take off first"
        if self._stage == "":
            return _NO_FLIGHT
        return self._unready

    def _climbs(self, skill: str) -> bool:
        contract = self._translation.contract(skill)
        return contract is not None and contract.motion.kind == MotionKind.CLIMB

    def _outranked(self, client: _Client, now_us: int) -> ClientLink | None:
        """Another client that is in control, whose rank is not lower: also one that is gone, while its step brings the
        vehicle down.
        """
        flown = self._flown
        if flown is not None and flown.flies >= 0 and self._brings_down(flown) and flown.link.name != client.link.name:
            rival = flown.link
        else:
            holder = self._holder(now_us)
            if holder is None or holder.name == client.link.name:
                return None
            rival = holder
        return rival if client.link.settings.rank <= rival.settings.rank else None

    def _is_safer(self, skill: str) -> bool:
        """Whether a skill is of the contingency, and not before the one that flies there."""
        if skill not in self._safe:
            return False
        under_way = {
            each.steps[min(max(each.flies, each.done), len(each.steps) - 1)].skill
            for each in self._proposals.values()
            if not each.ended
        }
        furthest = max((self._safe.index(each) for each in under_way if each in self._safe), default=0)
        return self._safe.index(skill) >= furthest

    def _holder(self, now_us: int) -> ClientLink | None:
        """The client in control: that of the last proposal under way, or for some time after its end."""
        for proposal in reversed(self._proposals.values()):
            link = None if proposal.ended or proposal.borrows else self._connected(proposal.link)
            if link is not None:
                self._kept = link, now_us + KEEPS_US
                return link
        if self._kept is not None and now_us < self._kept[1] and self._stage == "flying":
            return self._connected(self._kept[0])
        return None

    def _connected(self, link: ClientLink) -> ClientLink | None:
        """A connection that is up, else another one of the same client."""
        if link.client in self._clients:
            return link
        return next((each.link for each in self._of(link.name)), None)

    def _of(self, name: str) -> list[_Client]:
        """The connections of a client."""
        return [each for each in self._clients.values() if each.link.name == name]

    def _asks_for_control(self, client: _Client, command: int, now_us: int) -> int:
        """The answer to REQUEST_OPERATOR_CONTROL of a client: steps give control, and nothing else does."""
        holder = self._holder(now_us)
        if holder is not None and holder.name == client.link.name and not self._pilots.in_control:
            return ACCEPTED
        who = "the pilot" if self._pilots.in_control else "nobody" if holder is None else holder.name
        more = ": a step that is flown gives control" if who == "nobody" else ""
        self._reject(client, f"{who} is in control{more}", command, now_us)
        return DENIED

    def _checked(self, event: ProposalChecked, now_us: int) -> None:
        number, refusal, first, for_now = event
        upload = self._uploads.pop(number, None)
        if upload is not None:
            upload.transfer.checked(refusal, now_us)
            self._of_mission(upload, now_us)
            return
        name, plan = self._rechecks.pop(number, ("", None))
        if plan is not None and refusal is not None and self._plans.get(name) is plan:
            if for_now:
                self._unchecked.add(name)
            else:
                self._withdraw(name, refusal, now_us)
        proposal = self._proposals.get(number)
        if proposal is None:
            return
        if refusal is not None:
            result = TEMPORARILY_REJECTED if for_now else DENIED
            proposal.refuse(result, f"{proposal.steps[0].skill} refused: {refusal}", now_us)
        else:
            proposal.first = first
        self._tidy(now_us)

    def _answered(self, number: int, slug: str, text: str, now_us: int) -> None:
        proposal = self._proposals.get(number)
        if proposal is None:
            return
        if slug == "accepted":
            proposal.taken = True
            for each in self._proposals.values():
                if each is not proposal and each.number < number:
                    each.keep_before(proposal.first)
        else:
            words = f"{proposal.steps[0].skill} refused: {slug}" + (f": {text}" if text else "")
            proposal.refuse(TEMPORARILY_REJECTED if slug in _FOR_NOW else DENIED, words, now_us)
        self._tidy(now_us)

    def _tidy(self, now_us: int) -> None:
        """Forget proposals that ended; who was in control last is kept."""
        self._holder(now_us)
        for number in [number for number, each in self._proposals.items() if each.ended]:
            del self._proposals[number]

    # ---------------------------------------------------------------- the flight

    def _flight_line(self, line: dict[str, Any], now_us: int) -> None:
        match line.get("type"):
            case "hello":
                self._stage, self._unready, self._judged, self._cancelled, self._flew = "", None, False, False, False
            case "waiting":
                self._stage = "waiting"
            case "vehicle":
                unready = line.get("unready")
                self._unready = None if line.get("ready") else str(unready or "the vehicle is not ready")
                self._judged = True
                if self._unready is not None:
                    for each in self._proposals.values():
                        each.wait_for(self._unready, now_us)
            case "mission":
                self._stage = "flying"
                self._cancel_withdrawn(now_us)
            case "decision" | "effect":
                self._step_line(line, now_us)
            case "close":
                self._ended(str(line.get("ending", "")), now_us)

    def _step_line(self, line: dict[str, Any], now_us: int) -> None:
        if line.get("event") == "taken-over":
            for client in self._clients.values():
                client.link.text("the pilot took over: the flight of your steps ended", now_us, "taken over")
        kind, link = line.get("kind", STEP), line.get("link", -1)
        if line.get("event") == "dispatched" and kind != STEP:
            self._displaced |= kind != CONTINGENCY_LINK or link not in self._holding
        for proposal in list(self._proposals.values()):
            flies, done = proposal.flies, proposal.done
            if not proposal.line(line, now_us):
                continue
            if proposal.flies != flies:
                self._flown, self._displaced = proposal, False
            if (proposal.flies, proposal.done) != (flies, done):
                self._progress(proposal, now_us)
        self._tidy(now_us)

    def _ended(self, ending: str, now_us: int) -> None:
        """The flight ended: so did every proposal."""
        if self._stage:
            for proposal in self._proposals.values():
                words = f"{proposal.steps[0].skill} ended with the flight" + (f": {ending}" if ending else "")
                proposal.refuse(TEMPORARILY_REJECTED, words, now_us)
        self._stage, self._flown, self._kept, self._cancelled, self._flew = "", None, None, False, False
        self._proposals.clear()

    # ---------------------------------------------------------------- missions of clients

    def _item(self, client: _Client, message: Received, now: Now) -> None:
        """A mission item: of an upload, or flown to at once (`current` 2)."""
        now_us = now.monotonic_us
        if message.fields["current"] == _GUIDED_ITEM and client.transfer.plan_is_idle:
            command = message.fields["command"]
            row = self._translation.row(ITEM, command, message)
            if row is None:
                self._reject(client, f"item {command} has no mapping", command, now_us)
                result: int | None = UNSUPPORTED
            else:
                result = self._propose(client, message, self._step(client, row, message, now_us), command, now)
            if result is not None:
                client.transfer.answer_guided(message.sender, result)
            return
        plan = client.transfer.item(message, client.link.shadows, now_us)
        if plan is not None:
            self._number += 1
            self._uploads = {at: each for at, each in self._uploads.items() if each is not client}
            self._uploads[self._number] = client
            steps = self._from_ground(plan.steps)[0]
            role = client.link.settings.role
            self._actions.append(Propose(self._number, client.link.client, role, steps, fly=False))

    def _from_ground(self, steps: tuple[ProposedStep, ...]) -> tuple[tuple[ProposedStep, ...], int]:
        """The steps of a mission, preceded on the ground by a take-off to the first height, as PX4 does; and the number
        of steps before its own.
        """
        first = self._translation.contract(steps[0].skill)
        if first is None or first.motion.kind == MotionKind.CLIMB or first.motion.altitude < 0 or not self._rests:
            return steps, 0
        takeoffs = self._translation.takeoffs_to(steps[0].values[first.motion.altitude])
        takeoff = next((each for each in takeoffs if each is not None), None)
        return (steps, 0) if takeoff is None else ((takeoff, *steps), 1)

    def _start_whole(self, client: _Client, message: Received, command: int, now: Now) -> int | None:
        """MISSION_START: a part of a mission is refused, as ArduCopter does."""
        plan = client.transfer.plan
        first, last = (message.number(each) for each in ("param1", "param2"))
        ends = (0, -1) if plan is None else (0, -1, len(plan.items) - 1)
        if (first != 0 and not isnan(first)) or (last not in ends and not isnan(last)):
            self._reject(client, "a part of a mission is refused: start the whole one", command, now.monotonic_us)
            return DENIED
        return self._start(client, message, command, now)

    def _start(self, client: _Client, message: Received, command: int, now: Now) -> int | None:
        """Fly the client's mission, from the step that it did not finish."""
        plan, now_us = client.transfer.plan, now.monotonic_us
        if plan is None:
            self._reject(client, "there is no mission to start", command, now_us)
            return TEMPORARILY_REJECTED
        before = 0
        mission = client.source.mission
        if mission is not None and mission[1] is plan and self._stage == "flying":
            last = mission[0]
            if not last.ended:
                last.again(Asker(client.link, message.sender, command))
                return ACCEPTED if last.answered else None
            before = 0 if last.done >= len(last.item_of) else last.done + len(plan.steps) - len(last.item_of)
        steps, more = self._from_ground(plan.steps[max(before, 0) :])
        result = self._offer(client, steps, message, command, now)
        proposal = client.latest
        if result is None and proposal is not None and proposal.steps == steps:
            items = plan.item_of[max(before, 0) :]
            proposal.item_of = (*items[:1] * more, *items)
            client.source.mission, client.source.guided = (proposal, plan), False
        return result

    def _jump(self, client: _Client, item: float, now_us: int) -> int:
        """DO_SET_MISSION_CURRENT, MISSION_SET_CURRENT: only back to the beginning, before the start."""
        if self._flies_mission(client):
            self._reject(client, "the mission flies: stop it first", _SET_MISSION_CURRENT, now_us)
            return TEMPORARILY_REJECTED
        if item == 0 and client.transfer.plan is not None:
            client.source.mission = None
            return ACCEPTED
        self._reject(client, "a mission starts at its first item", _SET_MISSION_CURRENT, now_us)
        return DENIED

    @staticmethod
    def _flies_mission(client: _Client) -> bool:
        mission = client.source.mission
        return mission is not None and mission[1] is client.transfer.plan and not mission[0].ended

    def _set_current(self, client: _Client, message: Received, now: Now) -> None:
        self._jump(client, message.fields["seq"], now.monotonic_us)
        self._mission_current(client, always=True)

    def _progress(self, proposal: ClientProposal, now_us: int) -> None:
        """A step of a client's mission began or ended: report items as an autopilot does."""
        done, items = proposal.done, proposal.item_of
        reached = bool(done) and (done == len(items) or items[done : done + 1] != items[done - 1 : done])
        for client in self._of(proposal.link.name):
            if client.source.mission is None or client.source.mission[0] is not proposal or not items:
                return
            if reached and proposal.flies == done - 1:
                client.link.send(MISSION_ITEM_REACHED, seq=items[done - 1])
            self._mission_current(client)

    def _mission_current(self, client: _Client, *, always: bool = False) -> None:
        plan = client.transfer.plan
        if plan is None:
            return
        (item, state), mission = (0, _NOT_STARTED), client.source.mission
        if mission is not None and mission[1] is plan:
            proposal = mission[0]
            items = proposal.item_of
            if items and proposal.done >= len(items):
                item, state = items[-1], _COMPLETE
            elif items:
                item = items[max(proposal.flies, proposal.done)]
                state = _PAUSED if proposal.ended else _ACTIVE
        if always or (item, state) != client.reported:
            client.reported = item, state
            client.link.send(MISSION_CURRENT, seq=item, total=len(plan.items), mission_state=state, mission_mode=1)

    def _transferred(
        self, function: Callable[[PlanTransfer, Received, int], None], client: _Client, message: Received, now: Now
    ) -> None:
        now_us, plan = now.monotonic_us, client.transfer.plan
        if self._flies_mission(client) and PlanTransfer.clears(message):
            client.transfer.refuse(message.sender, RefusedPlan(MISSION_DENIED, "it flies: stop it first"), now_us)
            return
        function(client.transfer, message, now_us)
        if client.transfer.plan is not plan:
            client.source.mission = None
        self._of_mission(client, now_us)

    def _of_mission(self, client: _Client, now_us: int) -> None:
        """Withhold the vehicle's own reports of a mission from a client that has one here, or say why it has none."""
        has = client.transfer.plan is not None
        why, client.source.withdrawn = client.source.withdrawn, ""
        for each in self._of(client.link.name):
            if why:
                each.link.text(why, now_us)
                each.link.record("withdrawn", now_us, message="MISSION_COUNT", reason=why)
            each.shown.of_mission = frozenset({MISSION_CURRENT, MISSION_ITEM_REACHED}) if has else frozenset()
            each.shown.update(now_us)

    # ---------------------------------------------------------------- parameters, files, others

    def _param_set(self, client: _Client, message: Received, now: Now) -> None:
        bytewise = is_bytewise(self._settings.autopilot)
        known = set_parameter(client.link, self._seen, message, self._shadowed, now.monotonic_us, bytewise=bytewise)
        if not known and "parameters" in client.link.settings.requests:
            self._requests.want_parameter(client.link, parameter_name(message))

    def _param_read(self, client: _Client, message: Received, now: Now) -> None:
        self._requests.read_parameter(client.link, message, parameter_name(message), now.monotonic_us)

    def _version(self, client: _Client, message: Received, now: Now) -> None:
        self._requests.message(
            client.link, message.sender, enums.MAV_CMD_REQUEST_MESSAGE, AUTOPILOT_VERSION, now.monotonic_us
        )

    def _files(self, client: _Client, message: Received, now: Now) -> None:
        """FTP is refused, with the protocol's own answer, so that no client waits for it."""
        payload = message.fields["payload"]
        sequence = int.from_bytes(payload[:2], "little") + 1 & 0xFFFF
        refusal, unknown_command = 129, 7
        answer = sequence.to_bytes(2, "little") + bytes(
            [payload[2], refusal, 1, payload[3], 0, 0, *bytes(4), unknown_command]
        )
        system, component = message.sender
        client.link.send(FILE_TRANSFER_PROTOCOL, target_system=system, target_component=component, payload=answer)
        client.link.record("refused", now.monotonic_us, message=FILE_TRANSFER_PROTOCOL)

    # ---------------------------------------------------------------- time

    def _tick(self, now: Now) -> None:
        now_us = now.monotonic_us
        self._requests.tick(now_us)
        self._take_held(now)
        for proposal in list(self._proposals.values()):
            proposal.tick(now_us)
        every_second = now_us - self._second_us >= _SECOND_US
        for client in list(self._clients.values()):
            client.transfer.tick(now_us)
            client.shown.update(now_us)
            if client.link.silent(now_us) and not client.link.is_dead:
                self._die(client, now_us)
            if every_second:
                self._mission_current(client, always=True)
        if every_second:
            self._control_status(now_us)
            self._check_again()
            self._second_us = now_us
        self._end_without_client(now_us)
        self._tidy(now_us)

    def _control_status(self, now_us: int) -> None:
        """Tell everybody by CONTROL_STATUS who is in control, for the whole system."""
        holder = self._holder(now_us)
        system = self._pilots.in_control or (0 if holder is None else holder.system_id)
        for link in (*self._pilots.links, *(each.link for each in self._clients.values())):
            link.send(CONTROL_STATUS, flags=1, gcs_main=system)

    def _down(self, number: int, now_us: int) -> None:
        self._pilots.leave(number)
        client = self._clients.pop(number, None)
        if client is None:
            return
        self._requests.forget(number)
        self._held = [each for each in self._held if each.client is not client]
        self._uploads = {at: each for at, each in self._uploads.items() if each is not client}
        if client.link.is_regular and not client.link.is_dead:
            self._die(client, now_us)

    def _die(self, client: _Client, now_us: int) -> None:
        """A client is silent: nothing begins any more that it asked for, but to stop, return or land, unless another
        connection of it lives.
        """
        name = client.link.name
        client.link.is_dead = True
        client.link.record("dead", now_us)
        if all(each.link.is_dead for each in self._of(name)):
            self._end_without_client(now_us)
            self._take_back(f"{name} is silent", now_us, name)

    def _end_without_client(self, now_us: int) -> None:
        """Cancel the mission, once, so that the contingency flies, where the client is dead whose step flies, or waits,
        or flew last while no other client beats. A step that brings the vehicle down goes on.
        """
        if self._stage != "flying" or self._cancelled:
            return
        of = self._responsible()
        if of is None or not of.link.is_dead or (of.ended and self._anybody_beats(now_us)):
            return
        self._cancel(of.link, f"{of.link.name} is silent", now_us)

    def _responsible(self) -> ClientProposal | None:
        """What flies, or waits, or flew last; None where it brings the vehicle down."""
        flown = self._flown
        waiting = [each for each in self._proposals.values() if not each.ended]
        of = waiting[-1] if waiting and (flown is None or flown.ended) else flown
        return None if of is None or (of.flies >= 0 and self._brings_down(of)) else of

    def _anybody_beats(self, now_us: int) -> bool:
        """Whether a client sends regular heartbeats, which may take over."""
        return any(each.link.beats_now(now_us) for each in self._clients.values())

    def _brings_down(self, proposal: ClientProposal) -> bool:
        """Whether what is left of a proposal only lands the vehicle."""
        contracts = (self._translation.contract(each.skill) for each in proposal.steps[max(proposal.done, 0) :])
        return all(each is not None and each.motion.kind in _DOWN for each in contracts) and not proposal.ended
