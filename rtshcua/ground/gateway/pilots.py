"""The stations of pilots: their frames went to the vehicle, except requests for control, which are answered here.

Control belongs to one sender at one station, until that sender releases it, another pilot requests it, or the station
is gone: frames of a radio on the way to it, or of another system behind it, change nothing.
"""

from typing import Final

from rtshcua.ground.gateway.client_frames import SET_MODE, SETPOINTS, SETUP_SIGNING, Received, received
from rtshcua.ground.gateway.client_link import ClientLink
from rtshcua.ground.gateway.translation import ACCEPTED, DENIED
from rtshcua.mavlink import enums, layouts

#: what of a pilot's frames is recorded
_RECORDED: Final = frozenset(
    {
        layouts.COMMAND_LONG, layouts.COMMAND_INT, SET_MODE, layouts.PARAM_SET, layouts.MISSION_COUNT,
        layouts.MISSION_CLEAR_ALL, *SETPOINTS, SETUP_SIGNING,
    }
)  # fmt: skip


class Pilots:
    """The pilots of one vehicle."""

    def __init__(self, system: int) -> None:
        self._system = system
        self._links: dict[int, ClientLink] = {}
        self._holder: tuple[int, int] | None = None  # the station's number, and the system of the sender

    @property
    def in_control(self) -> int:
        """The system id of the pilot who keeps all clients out; 0 if nobody does."""
        return 0 if self._holder is None else self._holder[1]

    @property
    def links(self) -> tuple[ClientLink, ...]:
        """The stations that are there."""
        return tuple(self._links.values())

    def join(self, link: ClientLink) -> None:
        """A station is there."""
        self._links[link.client] = link

    def leave(self, client: int) -> None:
        """A station is gone, and with it the control that it had."""
        if self._links.pop(client, None) is not None and self._holder is not None and self._holder[0] == client:
            self._holder = None

    def take(self, client: int, frame: bytes, now_us: int) -> bool:
        """Record a frame of a pilot. Return whether it changed who is in control."""
        link, message = self._links.get(client), received(frame)
        if link is None or message is None:
            return False
        link.hear(message, now_us)
        if message.message not in _RECORDED:
            return False
        command = message.fields.get("command")
        asks = command == enums.MAV_CMD_REQUEST_OPERATOR_CONTROL
        detail = {} if command is None else {"command": command}
        link.record("absorbed" if asks else "passed", now_us, message=message.message, **detail)
        if not asks or not message.is_for(self._system):
            return False
        before, who = self._holder, (client, message.system)
        if _requests_control(message):
            self._holder = who
        elif before in (None, who):
            self._holder = None
        else:
            link.text("another pilot is in control", now_us, "control")
        denied = before == self._holder and before not in (None, who)
        link.ack(message.sender, enums.MAV_CMD_REQUEST_OPERATOR_CONTROL, DENIED if denied else ACCEPTED)
        return self._holder != before


def _requests_control(message: Received) -> bool:
    """Whether REQUEST_OPERATOR_CONTROL requests control: `param1` is 1. Stations of 2025 have their system id or 0 in
    `param1`, the action in `param2`, and in `param3` 0 or 1, where now is a time of 3 s and more.
    """
    action, before, more = (message.number(f"param{at}") for at in (1, 2, 3))
    return action == 1 or (before == 1 and more in (0, 1))
