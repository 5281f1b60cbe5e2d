"""One client: what it is, and what is sent to it and recorded about it."""

from collections import deque
from typing import Any, Final

from rtshcua.ground.gateway.client_frames import Received, made, received
from rtshcua.ground.gateway.interface import Action, ClientNote, ClientSettings, ToClient
from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.command_results import TEMPORARILY_REJECTED
from rtshcua.mavlink.layouts import TEXT_OCTETS

#: a text with the same key is sent once in this time, us
TEXT_EVERY_US: Final = 5_000_000
#: the most chunks of one text
_MOST_CHUNKS: Final = 4
_MOST_KEYS: Final = 64
#: what a client can cause as often as it likes; everything else is recorded at any rate
_OFTEN: Final = frozenset({"refused", "withdrawn", "absorbed", "passed"})
#: how many records at once, and the interval after that, us
_RECORDS: Final = 20
_RECORD_EVERY_US: Final = 200_000
_TARGET: Final = ("target_system", "target_component")
_FIRST_SYSTEM: Final = 1  # what autopilots are unless they are told otherwise
_UNHEARD: Final = "no vehicle was heard yet"
#: MAV_SEVERITY
WARNING: Final = 4
NOTICE: Final = 5
#: a client that sent regular heartbeats is dead after this silence, us
DEAD_US: Final = 5_000_000
#: heartbeats are regular once so many came, none later than this after the one before, us: many scripts send one or two
#: only to open a UDP link
_REGULAR: Final = 3
_REGULAR_US: Final = 3_000_000


class ClientLink:
    """A client's identity and its way back. `actions` is the list that all clients of a gateway share."""

    def __init__(self, client: int, settings: ClientSettings, system: int, actions: list[Action], now_us: int) -> None:
        self.client = client
        self.settings = settings
        #: when a frame came last, monotonic us
        self.heard_us = now_us
        self._beat_us = now_us
        self._in_a_row = 0
        self.is_dead = False
        #: the system id of its last frame
        self.system_id = 0
        #: the client's values of parameters that only give defaults; all its connections share them
        self.shadows: dict[str, float] = {}
        self._autopilot = system, enums.MAV_COMP_ID_AUTOPILOT1
        self._actions = actions
        self._sequence = 0
        self._texts = 0
        self._told: dict[str, int] = {}
        self._recorded: deque[int] = deque(maxlen=_RECORDS)
        self._left_out = 0

    @property
    def name(self) -> str:
        """Its configured name."""
        return self.settings.name

    def hear(self, message: Received, now_us: int) -> None:
        """A frame came. One of a radio on the way says nothing about the client."""
        if message.component == enums.MAV_COMP_ID_TELEMETRY_RADIO:
            return
        self.heard_us, self.system_id, self.is_dead = now_us, message.system, False
        if now_us - self._beat_us > DEAD_US:
            self._in_a_row = 0  # whoever is there now, perhaps another program, sends none
        if message.message == layouts.HEARTBEAT:
            self._in_a_row = min(self._in_a_row + 1, _REGULAR) if now_us - self._beat_us <= _REGULAR_US else 1
            self._beat_us = now_us

    @property
    def is_regular(self) -> bool:
        """Whether it sent regular heartbeats: only then does silence, or a disconnection, mean that it is dead."""
        return self._in_a_row >= _REGULAR

    def beats_now(self, now_us: int) -> bool:
        """Whether it sends regular heartbeats."""
        return self.is_regular and not self.is_dead and now_us - self.heard_us <= DEAD_US

    def silent(self, now_us: int) -> bool:
        """Whether it sent regular heartbeats and is silent for too long."""
        return self.is_regular and now_us - self.heard_us > DEAD_US

    def send(self, number: int, **values: Any) -> None:
        """Send a message as the autopilot."""
        self._actions.append(ToClient(self.client, made(number, values, self._autopilot, self._sequence)))
        self._sequence = (self._sequence + 1) % 256

    def forward(self, frame: bytes) -> None:
        """Send a frame of the vehicle again."""
        self._actions.append(ToClient(self.client, frame))

    def ack(self, to: tuple[int, int], command: int, result: int) -> None:
        """Answer a command with a MAV_RESULT."""
        system, component = to
        self.send(
            layouts.COMMAND_ACK,
            command=command,
            result=result,
            progress=255,
            target_system=system,
            target_component=component,
        )

    def text(self, text: str, now_us: int, key: str = "", severity: int = WARNING) -> None:
        """Send a STATUSTEXT, in chunks. With a key it is sent once in `TEXT_EVERY_US`."""
        if key:
            if now_us - self._told.get(key, -TEXT_EVERY_US) < TEXT_EVERY_US:
                return
            if len(self._told) >= _MOST_KEYS:
                self._told.clear()
            self._told[key] = now_us
        chunks = _chunks(text.encode("ascii", "replace"))
        self._texts = self._texts % 0xFFFF + 1
        number = self._texts if len(chunks) > 1 else 0
        for at, chunk in enumerate(chunks):
            self.send(layouts.STATUSTEXT, severity=severity, text=chunk, id=number, chunk_seq=at)

    def record(self, effect: str, now_us: int, **detail: Any) -> None:
        """Record what happened to a frame of the client: `refused`, `absorbed`, `passed`, `accepted`. Beyond a rate,
        records are counted, and the count is in the next one.
        """
        full = len(self._recorded) == _RECORDS and effect in _OFTEN
        if full and now_us - self._recorded[0] < _RECORDS * _RECORD_EVERY_US:
            self._left_out += 1
            return
        self._recorded.append(now_us)
        said: dict[str, Any] = {"client": self.name, "effect": effect}
        if self._left_out:
            said["left_out"] = self._left_out
            self._left_out = 0
        said |= detail
        self._actions.append(ClientNote(said))

    def answer_without_vehicle(self, frame: bytes, now_us: int) -> None:
        """Answer a command before a vehicle was heard: not now, with a text, from whom it is for. Of a pilot's commands
        only those that request control are answered; all others went to the vehicle's link.
        """
        message = received(frame)
        if message is None or message.message not in (layouts.COMMAND_LONG, layouts.COMMAND_INT):
            return
        command, system, component = (message.fields[each] for each in ("command", *_TARGET))
        if self.settings.pilot and command != enums.MAV_CMD_REQUEST_OPERATOR_CONTROL:
            self.record("passed", now_us, message=message.message, command=command)
            return
        self._autopilot = system or _FIRST_SYSTEM, component or enums.MAV_COMP_ID_AUTOPILOT1
        self.text(f"{_UNHEARD}: ask again", now_us)
        self.ack(message.sender, command, TEMPORARILY_REJECTED)
        self.record("refused", now_us, command=command, reason=_UNHEARD)


def _chunks(text: bytes) -> list[bytes]:
    """The chunks of a STATUSTEXT. All but the last are full, as its `chunk_seq` demands; they are cut between words and
    filled with spaces, because many clients show each chunk as a line of its own.
    """
    chunks: list[bytes] = []
    while len(text) > TEXT_OCTETS and len(chunks) < _MOST_CHUNKS:
        cut = text.rfind(b" ", 0, TEXT_OCTETS)
        cut = TEXT_OCTETS if cut <= 0 else cut
        chunks.append(text[:cut].ljust(TEXT_OCTETS))
        text = text[cut:].lstrip()
    if len(chunks) < _MOST_CHUNKS:
        chunks.append(text)
    if len(chunks) > 1 and len(chunks[-1]) == TEXT_OCTETS:
        chunks.append(b"")  # a text ends with a chunk that is not full
    return chunks
