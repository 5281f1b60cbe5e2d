"""The interface of the gateway's pure part: what happens (events), and what is to be done (actions).

`Gateway.take(event, now)` of `translator.py` returns actions, in the order in which they arose. It does no I/O, and
reads no clock. Its caller, the service `app/gateway`, passes frames, lines of the flight and results of its worker in,
and carries out the actions.

A client is a number, as the relay gives it; all frames are complete MAVLink frames, and those to clients are unsigned.
"""

import json
from collections.abc import Callable, Mapping
from textwrap import shorten
from typing import Any, Final, NamedTuple, TypeAlias

from rtshcua.decision.prepare import PreparedPolicy
from rtshcua.ground.gateway.accepted import AcceptedCommand
from rtshcua.model.flat.situation import Now, State

#: a `client` record: its most octets, and the most characters of a text in it
LONGEST_RECORD: Final = 200
_LONGEST_TEXT: Final = 80

# ---------------------------------------------------------------- configuration


class ClientSettings(NamedTuple):
    """A configured client side.

    `role` is a role of the policy, by name. `rank` decides between clients that contradict each other: a command of a
    higher rank supersedes a running step of a lower one. `pilot`: its frames go to the vehicle.
    `requests` are the kinds of harmless requests that it may make, of `REQUESTS`.
    """

    name: str
    role: str
    rank: int = 0
    pilot: bool = False
    requests: frozenset[str] = frozenset()


#: the kinds of harmless requests, all open by default: values of parameters; single messages; rates of messages; clocks
#: (TIMESYNC); the list of logs
REQUESTS = ("parameters", "messages", "rates", "time", "logs")


class GatewaySettings(NamedTuple):
    """What holds for one policy: `Gateway.renew` takes that of another one.

    `policy` is the policy in force, `defaults` each skill's parameters with the default values, in canonical units (a
    parameter without a default is absent). `accepted` are the rows of the table for the vehicle's autopilot.
    `state_of` makes the state that a decision reads from the last frames of each message: it is called only when a
    decision needs it.
    """

    system: int
    autopilot: int
    policy: PreparedPolicy
    defaults: Mapping[str, Mapping[str, tuple[int, ...]]]
    accepted: tuple[AcceptedCommand, ...]
    state_of: Callable[[Now], State]
    #: the longest interval of each message that the policy's signals allow, us by message number: no client slows it
    needed_us: Mapping[int, int] = {}


# ---------------------------------------------------------------- events


class ClientUp(NamedTuple):
    """A client was heard for the first time, or connected."""

    client: int
    settings: ClientSettings


class ClientDown(NamedTuple):
    """A client disconnected, or was silent for long; or the relay ended, and nobody knows whether it is still there."""

    client: int
    relay_ended: bool = False


class FromClient(NamedTuple):
    """A frame of an ordinary client. Signatures of clients are not verified."""

    client: int
    frame: bytes


class FromPilot(NamedTuple):
    """A frame of a pilot's ground station, which went to the vehicle, unless it requests or releases control."""

    client: int
    frame: bytes


class FromVehicle(NamedTuple):
    """A frame of the vehicle, which went to the clients, unless it is withheld."""

    frame: bytes


class FlightLine(NamedTuple):
    """A line of the flight's agent socket: `hello`, `waiting`, `vehicle`, `mission`, `decision`, `effect`, `close`."""

    line: Mapping[str, Any]


class FlightEnded(NamedTuple):
    """The flight's process ended. A session that begins later has another `hello`."""


class ProposalChecked(NamedTuple):
    """The worker compiled a proposal. `refusal` is None if it was signed and handed in; its first step is then the step
    with the index `first_step` in the mission of the flight. `for_now`: the same may be accepted later.
    """

    number: int
    refusal: str | None
    first_step: int = 0
    for_now: bool = False


class ProposalAnswered(NamedTuple):
    """The flight answered a document of a proposal: slug `accepted`, or why not."""

    number: int
    slug: str
    text: str = ""


class RequestAnswered(NamedTuple):
    """The flight answered a request frame: slug `accepted`, or why it is not passed on; `refused` without a flight."""

    number: int
    slug: str


class Tick(NamedTuple):
    """Time passed. Expected at least ten times a second."""


Event: TypeAlias = (
    ClientUp | ClientDown | FromClient | FromPilot | FromVehicle | FlightLine | FlightEnded
    | ProposalChecked | ProposalAnswered | RequestAnswered | Tick
)  # fmt: skip

# ---------------------------------------------------------------- actions


class ToClient(NamedTuple):
    """Send a frame to one client."""

    client: int
    frame: bytes


class Withhold(NamedTuple):
    """The vehicle's messages, by number, that a client does not get from now on; an empty set ends it."""

    client: int
    messages: frozenset[int]


class ProposedStep(NamedTuple):
    """A step that a client asks for. `arguments` are texts as in a proposal's JSON: `{"altitude": "10 m"}`; `values`
    their cells in canonical units, in the contract's order.
    """

    skill: str
    arguments: Mapping[str, str]
    values: tuple[int, ...]


class Propose(NamedTuple):
    """Compile these steps as the rest of the mission, sign and hand them in.

    Steps of the mission before the running one are kept, and so is the running one; all others are replaced. The
    answers are `ProposalChecked` and `ProposalAnswered` with this number. With `fly` false the steps are only checked,
    as a mission that a client uploads: the answer is `ProposalChecked` alone, and nothing is signed.
    """

    number: int
    client: int
    role: str
    steps: tuple[ProposedStep, ...]
    fly: bool = True


class Withdraw(NamedTuple):
    """Forget a proposal that was not handed in yet. It has no answer."""

    number: int


class RequestFrame(NamedTuple):
    """Hand a frame for the vehicle to the flight as a request; its gate passes it as housekeeping, or not at all."""

    number: int
    client: int
    frame: bytes


class Cancel(NamedTuple):
    """Cancel the mission of the flight: the policy's contingency flies."""

    client: int
    reason: str


class ClientNote(NamedTuple):
    """What happened to a frame of a client."""

    said: Mapping[str, Any]

    @property
    def text(self) -> str:
        """For the flight's log: compact JSON, at most 200 bytes. Long texts are cut between words, and what does not
        fit is left out. It is made when it is asked for: clients do not wait for it.
        """
        brief: dict[str, Any] = {}
        for key, value in self.said.items():
            more = brief | {key: shorten(value, _LONGEST_TEXT, placeholder="...") if isinstance(value, str) else value}
            brief = more if len(_compact(more)) <= LONGEST_RECORD else brief
        return _compact(brief)


def _compact(said: Mapping[str, Any]) -> str:
    return json.dumps(said, separators=(",", ":"), ensure_ascii=True)


Action: TypeAlias = ToClient | Withhold | Propose | Withdraw | RequestFrame | Cancel | ClientNote
