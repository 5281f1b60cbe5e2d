"""What agents and operators are told of a flight on its sockets, and what they hand in (docs/agents.md)."""

import os
import sys
from base64 import b64encode
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from hashlib import sha256
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import msgspec
from msgspec.structs import replace

from rtshcua.adapters.agent_socket import NO_LINE, AgentSocket, Encoded
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.situation import Now
from rtshcua.model.step_number import number_of
from rtshcua.onboard.calls import call
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Action, Append, Event, Presented, Reply
from rtshcua.wire import names
from rtshcua.wire.document import kind_of
from rtshcua.wire.untrusted import Untrusted

FORMAT: Final = "rtshcua/agent"
VERSION: Final = 1

#: what there is to tell where agents and operators have a socket each, and one user
ALIKE: Final = (
    "who listens at the agent socket runs as the same user as this program, and may open the operator socket too: "
    "nothing tells an agent there from an operator. Let the agent run as another user (`--agent-group`)"
)

#: replacements that wait to be looked at in another thread, at each socket: one takes some ms a step
_MOST_AHEAD: Final = 8
#: how long that thread may keep the flight's from running each time, in seconds
_SWITCH_S: Final = 0.000_1
#: replacements of which it is kept what became of them, so that none is looked at twice
_MOST_KNOWN: Final = 256
#: missions of which it is kept what is told of them
_MOST_MISSIONS: Final = 4
#: what stays so, whatever happens later
_LASTING: Final = frozenset(
    {
        "malformed", "unknown-format", "unknown-version", "unknown-key", "revoked-key", "wrong-duty", "bad-signature",
        "other-flight", "already-released", "other-steps", "id-seen", "no-step", "id-mismatch",
        "binding-mismatch", "wrong-policy", "wrong-vehicle", "wrong-source", "wrong-role", "key-other-policy",
    }
)  # fmt: skip
_TAKEN_IN: Final = ("superseded", "it was taken in before")
_FAILED: Final = ("failed", "it could not be looked at")

_encode = msgspec.json.Encoder().encode


class _Door:
    """A socket, and what came in there and is looked at ahead, by a thread of its own: no operator waits for agents."""

    def __init__(self, socket: AgentSocket) -> None:
        self.socket = socket
        self.ahead: list[tuple[Future[Presented], Presented | Encoded]] = []
        self.worker = ThreadPoolExecutor(1)


class Agents:
    """The sockets of one flight: `path` of agents, `operators` of operators, either or both. They never wait, and
    nothing of the flight depends on them. `group`: the id of a group whose users are agents too. `waits`: nothing flies
    yet, and `loaded` says under which policy something would.
    """

    def __init__(
        self,
        path: Path | None,
        loaded: Loaded,
        *,
        operators: Path | None = None,
        group: int | None = None,
        waits: bool = False,
    ) -> None:
        self._loaded = loaded
        self._waits = waits
        self._told = loaded.bundle.mission_digest
        self._greeted: tuple[bytes, bytes] | None = None
        self._switch_s = sys.getswitchinterval()
        self._notes: list[str] = []
        self._left: Sequence[Event] = ()
        self._sockets: list[_Door] = []
        numbers = count(1)
        try:
            if operators is not None:  # first: what operators hand in comes before what agents do
                own = AgentSocket(operators, self._greeting, own=True, numbers=numbers, encoded=True)
                self._sockets.append(_Door(own))
            if path is not None:
                agents = AgentSocket(path, self._greeting, group=group, numbers=numbers, encoded=True)
                self._sockets.append(_Door(agents))
        except OSError:
            self._close()
            raise
        self._watches = path is not None and operators is not None
        self._over = False  # the mission is, and nothing more is looked at
        #: the digests of the replacements that were looked at and not answered yet, by sender
        self._asked: dict[int, bytes] = {}
        #: why the ones that were would be refused again
        self._known: dict[bytes, tuple[str, str]] = {}
        #: what is told of missions, by digest: of the one in force, and of those that may come into force
        self._missions: dict[bytes, bytes] = {}
        if not waits:
            self._mission()

    def events(self, now: Now) -> Sequence[Event]:
        """The documents that came in. What is long, and each replacement, was looked at in another thread; what was
        refused there, or is refused by its outline, says so.
        """
        found: list[Event] = [*self._left]
        self._left = ()
        for door in self._sockets:
            event = door.socket.poll(now.monotonic_us)
            if event is not None:
                found += self._sorted(door, event, now)
            while door.ahead and door.ahead[0][0].done():
                future, came = door.ahead.pop(0)
                if future.exception() is not None:
                    found.append(Presented(came.at_us, b"", came.sender, _FAILED))
                elif future.result().refused == NO_LINE:
                    door.socket.answer(came.sender, *NO_LINE)
                else:
                    found.append(future.result())
                if not any(each.ahead for each in self._sockets):
                    sys.setswitchinterval(self._switch_s)
        if self._watches and not self._sockets[-1].socket.users.isdisjoint((0, os.geteuid())):
            self._watches = False
            self._notes.append(ALIKE)
        return found

    def _sorted(self, door: _Door, event: Presented | Encoded, now: Now) -> Sequence[Event]:
        """What comes of a document at once."""
        if self._over:
            return (Presented(event.at_us, b"", event.sender),)
        if isinstance(event, Encoded):
            if not self._waits:
                return self._later(door, event, now)
            event = event.decoded()  # nothing flies yet
            if event.refused is not None:
                door.socket.answer(event.sender, *event.refused)
                return ()
        if self._waits:
            return (event,)
        try:
            kind = kind_of(event.document)
        except Untrusted:
            return (event,)
        return (event,) if kind is not names.REPLACEMENT else self._later(door, event, now)

    def _later(self, door: _Door, event: Presented | Encoded, now: Now) -> Sequence[Event]:
        """Have it looked at in the other thread."""
        if len(door.ahead) == _MOST_AHEAD:
            door.socket.answer(event.sender, "busy", "other documents are being looked at")
            return ()
        sys.setswitchinterval(_SWITCH_S)
        door.ahead.append((door.worker.submit(self._looked_at, event, now), event))
        return ()

    def _looked_at(self, event: Presented | Encoded, now: Now) -> Presented:
        """A document as it is handed over, after all that takes long: decoded, hashed, verified, and what comes into
        force with it made. In the other thread.
        """
        came = event.decoded() if isinstance(event, Encoded) else event
        document = came.document
        if came.refused is not None:
            return came
        try:
            kind = kind_of(document)
        except Untrusted as error:
            return replace(came, refused=(error.slug, str(error)))
        if kind is not names.REPLACEMENT:
            return came
        digest = sha256(document).digest()
        known = self._known.get(digest)
        if known is not None:
            return replace(came, refused=known)
        self._asked[came.sender] = digest
        refused = self._loaded.boundary.consider(document, now)
        if refused is not None:
            return replace(came, refused=(refused.slug, str(refused)))
        after = self._loaded.in_force.considered(document)
        if after is not None:
            self._missions[after.mission_digest] = self._words(after.mission, after.mission_digest)
            for old in [*self._missions][:-_MOST_MISSIONS]:
                self._missions.pop(old, None)
        return replace(came, envelope=b64encode(document).decode())

    def _learn(self, reply: Reply) -> None:
        """Keep what became of a replacement, if it stays so."""
        digest = self._asked.pop(reply.sender, None)
        if digest is not None and (reply.slug == "accepted" or reply.slug in _LASTING):
            self._known[digest] = _TAKEN_IN if reply.slug == "accepted" else (reply.slug, reply.text)
            while len(self._known) > _MOST_KNOWN:
                del self._known[next(iter(self._known))]

    def fly(self, loaded: Loaded, left: Sequence[Event] = ()) -> None:
        """What waited has a bundle that flies: its mission is told, and what comes in is for that flight, first of all
        what was `left` of what had come in with the bundle.
        """
        self._loaded, self._waits, self._greeted, self._left = loaded, False, None, left
        self._told = loaded.bundle.mission_digest
        self.tell(self._mission())

    def answer(self, sender: int, slug: str, text: str) -> None:
        """Tell whoever handed something in what became of it."""
        for door in self._sockets:
            door.socket.answer(sender, slug, text)

    def turn_away(self, now: Now) -> None:
        """Answer what came in that it is too late: the mission is over, and nobody decides about it any more."""
        self._over = True
        for event in self.events(now):
            if isinstance(event, Presented):
                self.watch([Reply(event.sender, "falling-back", "the mission is over")])

    def notes(self) -> Sequence[str]:
        """What there is to tell of who listens, each once."""
        told, self._notes = self._notes, []
        return told

    def watch(self, actions: Sequence[Action]) -> None:
        """Tell of what was done: every record as its line, and the answers to whoever handed something in."""
        for action in actions:
            if isinstance(action, Append):
                self.tell(action.line)
            elif isinstance(action, Reply):
                self._learn(action)
                self.answer(action.sender, action.slug, action.text)
        if self._told != self._loaded.bundle.mission_digest:
            self._told = self._loaded.bundle.mission_digest
            self.tell(self._mission())

    def tell(self, line: bytes) -> None:
        """Tell a record that the runtime did not make: the close."""
        for door in self._sockets:
            door.socket.tell(line)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    def _close(self) -> None:
        for door in self._sockets:
            door.worker.shutdown(cancel_futures=True)
        sys.setswitchinterval(self._switch_s)
        for door in self._sockets:
            door.socket.close()

    def _greeting(self) -> bytes:
        digest = self._loaded.bundle.mission_digest
        if self._greeted is None or self._greeted[0] != digest:  # they come by the hundred, where somebody means ill
            self._greeted = digest, self._hello()
        return self._greeted[1]

    def _hello(self) -> bytes:
        loaded = self._loaded
        hello = {
            "type": "hello",
            "format": FORMAT,
            "version": VERSION,
            "vehicle": loaded.vehicle,
            "flight": loaded.in_force.flight.hex(),
            "mode": loaded.mode.value,
        }
        return _encode(hello) + b"\n" + (self._waiting() if self._waits else self._mission())

    def _waiting(self) -> bytes:
        """That no mission is in force yet, and under which policy one would fly."""
        policy = self._loaded.bundle.policy
        told = {
            "type": "waiting",
            "policy": f"{policy.name}@{policy.version}",
            "policy_digest": self._loaded.bundle.policy_digest.hex(),
        }
        return _encode(told) + b"\n"

    def _mission(self) -> bytes:
        """The mission that is in force: sent first, and again after each replacement."""
        bundle = self._loaded.bundle
        told = self._missions.pop(bundle.mission_digest, None)
        told = self._words(bundle.mission, bundle.mission_digest) if told is None else told
        self._missions[bundle.mission_digest] = told  # the last one, so that it stays longest
        return told

    def _words(self, mission: Mission, digest: bytes) -> bytes:
        """What is told of a mission."""
        bundle = self._loaded.bundle
        steps = [
            {
                "step": each.step,
                "step_number": number_of(each.step),
                "phase": mission.phases[each.phase],
                "skill": each.contract.name,
                "text": call(bundle.policy, each),
                "id": each.invocation_id.hex(),
                "binding": each.binding.hex(),
            }
            for each in mission.invocations
        ]
        told = {
            "type": "mission",
            "mission": mission.name,
            "digest": digest.hex(),
            "policy": f"{mission.policy}@{mission.policy_version}",
            "policy_digest": bundle.policy_digest.hex(),
            "steps": steps,
        }
        return _encode(told) + b"\n"
