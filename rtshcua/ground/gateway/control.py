"""Who is in control. Two clients that contradict each other are decided by rank and policy, never by who sent last.

The client whose step flies or waits is in control, and for `KEEPS_US` after its last step. Another client's command is
taken if its rank in the configuration is higher, or if its skill is one of the policy's `contingency`, which stops,
returns or lands, and the step that flies is none that stands later there: nobody stops another one's landing. Otherwise
it is rejected. The policy decides on every step besides.

A pilot who requests control keeps all clients out. It belongs to one sender at one station, until that sender releases
it, another pilot requests it, or the station is gone: frames of a radio on the way to it change nothing. If the relay
ends, control stays, until the station is heard again or another pilot takes it. Other frames of pilots went to the
vehicle.
"""

from typing import Final

from rtshcua.ground.gateway.client_frames import SETPOINTS, Received, received
from rtshcua.ground.gateway.client_link import ClientLink
from rtshcua.ground.gateway.client_proposal import ClientProposal
from rtshcua.ground.gateway.gateway_state import ConnectedClient, GatewayState
from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.command_results import ACCEPTED, DENIED

_NO_STATION: Final = -1
#: how long a client keeps control after its last step, us
KEEPS_US: Final = 10_000_000
#: what of a pilot's frames is recorded
_RECORDED: Final = frozenset(
    {
        layouts.COMMAND_LONG, layouts.COMMAND_INT, layouts.COMMAND_CANCEL, layouts.SET_MODE, layouts.PARAM_SET,
        layouts.MISSION_COUNT, layouts.MISSION_CLEAR_ALL, *SETPOINTS, layouts.SETUP_SIGNING,
    }
)  # fmt: skip


class Pilots:
    """The pilots of one vehicle."""

    def __init__(self, system: int) -> None:
        self._system = system
        self.links: dict[int, ClientLink] = {}  # the stations that are there, by number
        self._holder: tuple[int, int] | None = None  # the station's number, and the system of the sender
        self._unheard = ""  # the name of the holder's station, if the relay ended since it was heard

    @property
    def in_control(self) -> int:
        """The system id of the pilot who keeps all clients out; 0 if nobody does."""
        return 0 if self._holder is None else self._holder[1]

    def leave(self, client: int, *, relay_ended: bool = False) -> None:
        """A station is gone, and with it the control that it had, unless only the relay ended."""
        link = self.links.pop(client, None)
        if link is None or self._holder is None or self._holder[0] != client:
            return
        if relay_ended:
            self._holder, self._unheard = (_NO_STATION, self._holder[1]), link.name
        else:
            self._holder = None

    def take(self, client: int, frame: bytes, now_us: int) -> bool:
        """Record a frame of a pilot. Return whether it changed who is in control."""
        link, message = self.links.get(client), received(frame)
        if link is None or message is None:
            return False
        link.hear(message, now_us)
        if self._holder == (_NO_STATION, message.system) and link.name == self._unheard:
            self._holder = client, message.system
        if message.message not in _RECORDED:
            return False
        command = message.fields.get("command")
        asks = (
            command == enums.MAV_CMD_REQUEST_OPERATOR_CONTROL
            and message.message != layouts.COMMAND_CANCEL
            and message.is_for(self._system)
        )
        detail = {} if command is None else {"command": command}
        link.record("absorbed" if asks else "passed", now_us, message=message.message, **detail)
        if not asks:
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


class Control:
    """Who is in control of one vehicle."""

    def __init__(self, state: GatewayState) -> None:
        self._state = state
        self.pilots = Pilots(state.settings.system)
        self._kept: tuple[ClientLink, int] | None = None  # who was in control last, and until when

    def forget(self) -> None:
        """The flight ended, and with it the control of whom it flew for."""
        self._kept = None

    def holder(self, now_us: int) -> ClientLink | None:
        """The client in control: that of the last proposal under way, or for some time after its end."""
        for proposal in reversed(self._state.proposals.values()):
            link = None if proposal.ended or proposal.borrows else self._state.connected(proposal.link)
            if link is not None:
                self._kept = link, now_us + KEEPS_US
                return link
        if self._kept is not None and now_us < self._kept[1] and self._state.flight.stage == "flying":
            return self._state.connected(self._kept[0])
        return None

    def outranked(self, client: ConnectedClient, now_us: int) -> ClientLink | None:
        """Another client that is in control, whose rank is not lower: also one that is gone, while its step brings the
        vehicle down.
        """
        flown, name = self._state.flight.flown, client.link.name
        if flown is not None and flown.flies >= 0 and self._state.brings_down(flown) and flown.link.name != name:
            rival = flown.link
        else:
            holder = self.holder(now_us)
            if holder is None or holder.name == name:
                return None
            rival = holder
        return rival if client.link.settings.rank <= rival.settings.rank else None

    def is_safer(self, skill: str) -> bool:
        """Whether a skill is of the contingency, and not before the one that flies there."""
        if skill not in self._state.safe:
            return False
        under_way = {
            each.steps[min(max(each.flies, each.done), len(each.steps) - 1)].skill
            for each in self._state.proposals.values()
            if not each.ended
        }
        furthest = max((self._state.safe.index(each) for each in under_way if each in self._state.safe), default=0)
        return self._state.safe.index(skill) >= furthest

    def asks_for_control(self, client: ConnectedClient, command: int, now_us: int) -> int:
        """The answer to REQUEST_OPERATOR_CONTROL of a client: steps give control, and nothing else does."""
        holder = self.holder(now_us)
        if holder is not None and holder.name == client.link.name and not self.pilots.in_control:
            return ACCEPTED
        nobody = "nobody is in control: a step that is flown gives control"
        who = "the pilot" if self.pilots.in_control else "" if holder is None else holder.name
        client.reject(f"{who} is in control" if who else nobody, command, now_us)
        return DENIED

    def tell(self, now_us: int) -> None:
        """Tell everybody by CONTROL_STATUS who is in control, for the whole system."""
        holder = self.holder(now_us)
        system = self.pilots.in_control or (0 if holder is None else holder.system_id)
        for link in (*self.pilots.links.values(), *(each.link for each in self._state.clients.values())):
            link.send(layouts.CONTROL_STATUS, flags=1, gcs_main=system)

    def responsible(self) -> ClientProposal | None:
        """What flies, or waits, or flew last; None where it brings the vehicle down."""
        flown = self._state.flight.flown
        waiting = [each for each in self._state.proposals.values() if not each.ended]
        of = waiting[-1] if waiting and (flown is None or flown.ended) else flown
        return None if of is None or (of.flies >= 0 and self._state.brings_down(of)) else of

    def anybody_beats(self, now_us: int) -> bool:
        """Whether a client sends regular heartbeats, which may take over."""
        return any(each.link.beats_now(now_us) for each in self._state.clients.values())
