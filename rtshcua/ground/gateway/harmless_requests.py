"""Requests of clients that move nothing: values of parameters, single messages, rates, clocks, the list of logs.

What was seen of the vehicle is answered at once. The rest becomes a frame of our own making, which is handed to the
flight and passes its gate as housekeeping, or not at all; never is a client's frame passed on. A rate is never lowered:
a client that asks for less gets what is there.
"""

from collections import deque
from dataclasses import dataclass
from math import isnan
from typing import Any, Final

from rtshcua.ground.gateway.client_frames import Received, made
from rtshcua.ground.gateway.client_link import ClientLink
from rtshcua.ground.gateway.habits import tell_parameter
from rtshcua.ground.gateway.interface import Action, GatewaySettings, RequestFrame
from rtshcua.ground.gateway.vehicle_seen import FRESH_US, LASTING, VehicleSeen
from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.command_results import ACCEPTED, DENIED, FAILED, IN_PROGRESS, TEMPORARILY_REJECTED, UNSUPPORTED
from rtshcua.mavlink.parameters import is_bytewise

#: the interval of request frames to the flight, us, and how many may wait
REQUEST_EVERY_US: Final = 50_000
_MOST_WAITING: Final = 128
_MOST_OF_ONE: Final = 64
_MOST_AWAITED: Final = 64
#: what the flight answers while it cannot take a request; when that is handed in again, us, and how often
_NOT_YET: Final = frozenset({"busy", "refused", "no-vehicle"})
_AGAIN_US: Final = 500_000
_MOST_TRIES: Final = 7
#: how long an answer of the vehicle is waited for, us
_PATIENCE_US: Final = 1_000_000
#: the interval of requests for all parameters, and of the parameters that are sent to a client at once, us
_LIST_EVERY_US: Final = 10_000_000
_PARAMETERS_AT_ONCE: Final = 25
#: the shortest interval of a message that a client can ask for, us
SHORTEST_US: Final = 20_000

_GET_HOME_POSITION: Final = 410
_REQUEST_PROTOCOL_VERSION: Final = 519
_REQUEST_AUTOPILOT_CAPABILITIES: Final = 520
_REQUESTS: Final = {
    _GET_HOME_POSITION: layouts.HOME_POSITION,
    _REQUEST_AUTOPILOT_CAPABILITIES: layouts.AUTOPILOT_VERSION,
}
#: the commands that are answered here
COMMANDS: Final = frozenset(
    {*_REQUESTS, enums.MAV_CMD_REQUEST_MESSAGE, enums.MAV_CMD_SET_MESSAGE_INTERVAL, _REQUEST_PROTOCOL_VERSION}
)
#: the messages of each MAV_DATA_STREAM, as ArduCopter groups them (GCS_MAVLink of its source), by message number
_STREAMS: Final = {
    1: (27, 29, 116, 129),  # raw sensors
    2: (1, 24, 62, 125, 152),  # extended status
    3: (36, 65),  # RC channels
    6: (32, 33),  # position
    10: (30, 178, 163),  # extra 1
    11: (74,),  # extra 2
    12: (2, 168, 132, 147, 241, 242, 193),  # extra 3
}
_ALL_STREAMS: Final = 0
#: the shortest interval at which a lasting message is repeated, us
_REPEAT_US: Final = 200_000


@dataclass(slots=True)
class _Request:
    """A frame for the flight. `rate_of` is the message whose interval it sets, None if it sets none; `before` the
    interval that it had, and `every_us` the one that it is to get, us.
    """

    link: ClientLink
    frame: bytes
    rate_of: int | None
    before: int | None = None
    every_us: int | None = None
    not_before_us: int = 0
    tries: int = 1


@dataclass(slots=True)
class _Repeated:
    """A message that stays true, which a client gets at an interval, us, and when next."""

    link: ClientLink
    message: int
    every_us: int
    next_us: int


@dataclass(slots=True)
class _Awaited:
    """A single message that a client requested, by its number and parameters 2 to 6, until it comes."""

    link: ClientLink
    to: tuple[int, int]
    command: int
    wanted: tuple[int, tuple[float, ...]]
    until_us: int


class HarmlessRequests:
    """The requests of all clients of a gateway."""

    def __init__(self, settings: GatewaySettings, seen: VehicleSeen, actions: list[Action]) -> None:
        self._own = settings.system, enums.MAV_COMP_ID_ONBOARD_COMPUTER
        self._target = {"target_system": settings.system, "target_component": enums.MAV_COMP_ID_AUTOPILOT1}
        self._seen = seen
        self._actions = actions
        self._bytewise = is_bytewise(settings.autopilot)
        self._number = 0
        self._sequence = 0
        self._waiting: deque[_Request] = deque()
        self._handed: dict[int, _Request] = {}
        self._last = ""  # the client whose request was handed in last
        self._next_us = 0
        self._awaited: list[_Awaited] = []
        self._listed_us = -_LIST_EVERY_US
        self._lists: dict[int, tuple[ClientLink, deque[Received]]] = {}
        self._repeated: dict[tuple[int, int], _Repeated] = {}
        #: the shortest interval that was asked for, by message, us
        self._intervals: dict[int, int] = dict(settings.needed_us)
        self._needed_us = settings.needed_us

    # ---------------------------------------------------------------- commands

    def command(self, link: ClientLink, message: Received, now_us: int) -> int | None:
        """Answer a command in `COMMANDS`: its MAV_RESULT, None if that comes later."""
        command = message.fields["command"]
        if command == _REQUEST_PROTOCOL_VERSION:
            return UNSUPPORTED
        number = message.whole("param1") if command not in _REQUESTS else _REQUESTS[command]
        if not 0 <= number < 1 << 24:
            return DENIED
        if command == enums.MAV_CMD_SET_MESSAGE_INTERVAL:
            return self._set_interval(link, number, message.number("param2"), now_us)
        more = () if command in _REQUESTS else tuple(message.number(f"param{at}") for at in range(2, 7))
        return self.message(link, message.sender, command, number, now_us, more if any(more) else ())

    def message(
        self, link: ClientLink, to: tuple[int, int], command: int, number: int, now_us: int,
        more: tuple[float, ...] = (),
    ) -> int | None:  # fmt: skip
        """Send a message as it was seen, or request it; `command` is acknowledged then. `more`: parameters 2 to 6,
        which choose among several of the same number.
        """
        more = tuple(0.0 if isnan(each) else each for each in more)
        known = None if any(more) else self._seen.frame(number)
        if known is not None and (number in LASTING or self._seen.message(number, FRESH_US, now_us) is not None):
            link.forward(known)
            return ACCEPTED
        if not self._may(link, "messages", now_us):
            return DENIED
        if len(self._awaited) >= _MOST_AWAITED:
            return TEMPORARILY_REJECTED
        asked = any(each.wanted == (number, more) for each in self._awaited)
        if not asked and not self._request_message(link, number, more):
            return TEMPORARILY_REJECTED
        self._awaited.append(_Awaited(link, to, command, (number, more), now_us + _PATIENCE_US))
        return None

    def _request_message(self, link: ClientLink, number: int, more: tuple[float, ...] = ()) -> bool:
        chosen: dict[str, Any] = {f"param{at}": value for at, value in enumerate((float(number), *more), start=1)}
        return self._hand_in(
            link, layouts.COMMAND_LONG, command=enums.MAV_CMD_REQUEST_MESSAGE, **chosen, **self._target
        )

    def _set_interval(self, link: ClientLink, number: int, interval: float, now_us: int) -> int:
        if not self._may(link, "rates", now_us):
            return DENIED
        if number in LASTING:
            self._repeat(link, number, interval, now_us)
            return ACCEPTED
        if isnan(interval) or interval <= 0 or interval > 1e9:
            return ACCEPTED  # the default rate, or none: what others need goes on
        return ACCEPTED if self._faster(link, number, max(int(interval), SHORTEST_US)) else TEMPORARILY_REJECTED

    def _repeat(self, link: ClientLink, number: int, interval: float, now_us: int) -> None:
        """Send what is known of a lasting message again and again: the vehicle sends it when it changes, and the flight
        lets nobody change that rate, because it takes each one as an answer.
        """
        self._repeated.pop((link.client, number), None)
        if 0 < interval <= 1e9:
            every_us = max(int(interval), _REPEAT_US)
            self._repeated[link.client, number] = _Repeated(link, number, every_us, now_us)

    def _faster(self, link: ClientLink, number: int, interval_us: int) -> bool:
        """Request a message at an interval, if it is not requested as often already."""
        asked = self._intervals.get(number)
        if asked is not None and asked <= interval_us:
            return True
        handed = self._hand_in(
            link,
            layouts.COMMAND_LONG,
            command=enums.MAV_CMD_SET_MESSAGE_INTERVAL,
            rate_of=number,
            param1=float(number),
            param2=float(interval_us),
            **self._target,
        )
        if handed:
            self._intervals[number] = self._waiting[-1].every_us = interval_us
        return handed

    # ---------------------------------------------------------------- messages

    def data_stream(self, link: ClientLink, message: Received, now_us: int) -> None:
        """REQUEST_DATA_STREAM: intervals of the messages of a stream. The message itself would undo others' rates."""
        rate, stream = message.fields["req_message_rate"], message.fields["req_stream_id"]
        if not message.fields["start_stop"] or not rate or not self._may(link, "rates", now_us):
            return
        numbers = _STREAMS.get(stream, ())
        if stream == _ALL_STREAMS:
            numbers = tuple(number for each in _STREAMS.values() for number in each)
        for number in numbers:
            if number in LASTING:
                self._repeat(link, number, 1_000_000 / rate, now_us)
                continue
            self._faster(link, number, max(1_000_000 // rate, SHORTEST_US))

    def read_parameter(self, link: ClientLink, message: Received, name: str, now_us: int) -> None:
        """PARAM_REQUEST_READ, by name or index."""
        index = message.fields["param_index"]
        known = self._seen.parameters.get(name)
        if index >= 0:
            every = self._seen.parameters.values()
            known = next((each for each in every if each.fields["param_index"] == index), None)
        if known is not None:
            tell_parameter(link, known, bytewise=self._bytewise)
        elif self._may(link, "parameters", now_us):
            self._hand_in(
                link,
                layouts.PARAM_REQUEST_READ,
                param_index=index,
                param_id=message.fields["param_id"],
                **self._target,
            )

    def want_parameter(self, link: ClientLink, name: str) -> None:
        """Request a parameter that a translation needs."""
        self._hand_in(link, layouts.PARAM_REQUEST_READ, param_index=-1, param_id=name.encode("latin-1"), **self._target)

    def list_parameters(self, link: ClientLink, now_us: int) -> None:
        """PARAM_REQUEST_LIST: from what was seen if that is everything, else requested. All clients see the answers."""
        every = self._seen.parameters
        counts = [each.fields["param_count"] for each in every.values()]
        if every and len(every) >= max(counts):
            self._lists[link.client] = link, deque(every.values())
        elif self._may(link, "parameters", now_us) and now_us - self._listed_us >= _LIST_EVERY_US:
            self._listed_us = now_us
            self._hand_in(link, layouts.PARAM_REQUEST_LIST, **self._target)

    def time(self, link: ClientLink, message: Received, now_us: int) -> None:
        """TIMESYNC: the vehicle answers to all."""
        if message.fields["tc1"] == 0 and self._may(link, "time", now_us):
            self._hand_in(link, layouts.TIMESYNC, tc1=0, ts1=message.fields["ts1"])

    def logs(self, link: ClientLink, message: Received, now_us: int) -> None:
        """LOG_REQUEST_LIST."""
        if self._may(link, "logs", now_us):
            start, end = message.fields["start"], message.fields["end"]
            self._hand_in(link, layouts.LOG_REQUEST_LIST, start=start, end=end, **self._target)

    def _may(self, link: ClientLink, kind: str, now_us: int) -> bool:
        if kind in link.settings.requests:
            return True
        link.text(f"requests of {kind} are not open to {link.name}", now_us, f"request {kind}")
        link.record("refused", now_us, request=kind)
        return False

    # ---------------------------------------------------------------- time and answers

    def seen(self, number: int) -> None:
        """A message of the vehicle came, which went to all clients: answer those who requested it. If it refuses a
        message to the flight, that is the oldest that is awaited: the flight itself requests only messages that it has.
        """
        self._end([each for each in self._awaited if each.wanted[0] == number], ACCEPTED)
        answer = self._seen.message(layouts.COMMAND_ACK) if number == layouts.COMMAND_ACK and self._awaited else None
        if answer is not None and answer.fields["command"] == enums.MAV_CMD_REQUEST_MESSAGE:
            ours = self._is_ours(answer) and answer.fields["result"] not in (ACCEPTED, IN_PROGRESS)
            refused = [each for each in self._awaited if ours and each.wanted == self._awaited[0].wanted]
            self._end(refused, answer.fields["result"])

    def _is_ours(self, answer: Received) -> bool:
        """Whether a COMMAND_ACK is for the flight, or names no target."""
        to = answer.fields["target_system"], answer.fields["target_component"]
        return all(each in (0, ours) for each, ours in zip(to, self._own, strict=True))

    def _end(self, awaited: list[_Awaited], result: int) -> None:
        for each in awaited:
            self._awaited.remove(each)
            each.link.ack(each.to, each.command, result)

    def forget_vehicle(self) -> None:
        """The vehicle has started again, with its own rates."""
        self._intervals = dict(self._needed_us)
        self._listed_us = -_LIST_EVERY_US

    def tick(self, now_us: int) -> None:
        """Hand in the next request, send parts of lists, and end requests that the vehicle did not answer."""
        request = self._next(now_us) if now_us >= self._next_us else None
        if request is not None:
            self._waiting.remove(request)
            self._last = request.link.name
            self._next_us = now_us + REQUEST_EVERY_US
            self._number += 1
            self._handed[self._number] = request
            while len(self._handed) > _MOST_WAITING:
                self._handed.pop(next(iter(self._handed)))
            self._actions.append(RequestFrame(self._number, request.link.client, request.frame))
        self._end([each for each in self._awaited if now_us >= each.until_us], FAILED)
        self._send_lasting(now_us)
        for client, (link, rest) in list(self._lists.items()):
            for _ in range(min(_PARAMETERS_AT_ONCE, len(rest))):
                tell_parameter(link, rest.popleft(), bytewise=self._bytewise)
            if not rest:
                del self._lists[client]

    def _send_lasting(self, now_us: int) -> None:
        """Send the messages that stay true to those who asked for an interval of them."""
        for lasting in self._repeated.values():
            if now_us >= lasting.next_us:
                known = self._seen.frame(lasting.message)
                lasting.next_us = now_us + (lasting.every_us if known is not None else _LIST_EVERY_US)
                if known is not None:
                    lasting.link.forward(known)
                else:
                    self._request_message(lasting.link, lasting.message)

    def answered(self, number: int, slug: str, now_us: int) -> None:
        """The flight passed a request on, or not. A rate that it cannot take yet is asked for again; if it does not
        change one, the client is told.
        """
        request = self._handed.pop(number, None)
        if request is None or request.rate_of is None or slug == "accepted":
            return
        if slug in _NOT_YET and request.tries < _MOST_TRIES and len(self._waiting) < _MOST_WAITING:
            request.not_before_us = now_us + (_AGAIN_US << request.tries - 1)
            request.tries += 1
            self._waiting.append(request)
            return
        self._undo(request)
        request.link.text(f"the rate of message {request.rate_of} stays as it is ({slug})", now_us, "rate")

    def _next(self, now_us: int) -> _Request | None:
        """The request whose turn it is: of another client than the last one, if there is one."""
        due = [each for each in self._waiting if now_us >= each.not_before_us]
        return next((each for each in due if each.link.name != self._last), due[0] if due else None)

    def _undo(self, request: _Request) -> None:
        """A rate was not set: the interval is as before, unless another request changed it meanwhile."""
        if request.rate_of is None or self._intervals.get(request.rate_of) != request.every_us:
            return
        if request.before is None:
            self._intervals.pop(request.rate_of, None)
        else:
            self._intervals[request.rate_of] = request.before

    def forget(self, client: int) -> None:
        """A client is gone."""
        for each in (*self._waiting, *self._handed.values()):
            if each.link.client == client:
                self._undo(each)
        self._handed = {number: each for number, each in self._handed.items() if each.link.client != client}
        self._awaited = [each for each in self._awaited if each.link.client != client]
        self._waiting = deque(each for each in self._waiting if each.link.client != client)
        self._lists.pop(client, None)
        self._repeated = {key: each for key, each in self._repeated.items() if key[0] != client}

    def _hand_in(self, link: ClientLink, number: int, rate_of: int | None = None, **values: Any) -> bool:
        """Queue a frame of our own for the flight; False if too many wait."""
        own = sum(each.link.name == link.name for each in self._waiting)
        if len(self._waiting) >= _MOST_WAITING or own >= _MOST_OF_ONE:
            return False
        before = None if rate_of is None else self._intervals.get(rate_of)
        self._waiting.append(_Request(link, made(number, values, self._own, self._sequence), rate_of, before))
        self._sequence = (self._sequence + 1) % 256
        return True
