"""The sockets of a flight for agents and operators (docs/agents.md): they receive its records and hand in documents."""

import os
import sys
from base64 import b64encode
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from hashlib import sha256
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import msgspec
from msgspec.structs import replace

from rtshcua.adapters.agent_socket import NO_LINE, AgentSocket, ClientLine, Encoded, FrameRequest
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.situation import Now
from rtshcua.model.step_number import number_of
from rtshcua.onboard.calls import call
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Action, Append, ClientRecord, Event, Presented, Reply
from rtshcua.wire import names
from rtshcua.wire.document import kind_of
from rtshcua.wire.untrusted import Untrusted

FORMAT: Final = "rtshcua/agent"
VERSION: Final = 1

#: the note if agents and operators connect as the same user
SAME_USER: Final = (
    "a process at the agent socket runs as the same user as this program, so it can open the operator socket too: "
    "an agent cannot be told from an operator there. Run the agent as another user (`--agent-group`)"
)

#: the most documents of one socket that wait for the worker thread; a replacement takes some ms per step
_MOST_AHEAD: Final = 8
#: the interpreter's switch interval while a worker thread runs, in seconds
_SWITCH_S: Final = 0.000_1
#: the most replacements whose results are kept, so that none is examined twice
_MOST_KNOWN: Final = 256
#: the most missions whose description is kept
_MOST_MISSIONS: Final = 4
#: slugs of refusals that never change
_LASTING: Final = frozenset(
    {
        "malformed", "unknown-format", "unknown-version", "unknown-key", "revoked-key", "wrong-duty", "bad-signature",
        "other-flight", "already-released", "other-steps", "id-seen", "no-step", "id-mismatch",
        "binding-mismatch", "wrong-policy", "wrong-vehicle", "wrong-source", "wrong-role", "key-other-policy",
    }
)  # fmt: skip
_TAKEN_IN: Final = ("superseded", "the replacement was accepted before")
_FAILED: Final = ("failed", "the document could not be examined")
_RECORDED: Final = ("accepted", "it is recorded")
_NO_LOG: Final = ("not-flying", "no log is open: hand it in again once the flight began")
_PASSED_ON: Final = ("accepted", "it was sent to the vehicle")
_OVER: Final = ("falling-back", "the mission is over")

_encode = msgspec.json.Encoder().encode


class _SocketQueue:
    """A socket, and the documents from it that its worker thread examines. Operators never wait for agents."""

    def __init__(self, socket: AgentSocket) -> None:
        self.socket = socket
        self.ahead: list[tuple[Future[Presented], Presented | Encoded]] = []
        self.worker = ThreadPoolExecutor(1)


class Agents:
    """The sockets of one flight: `path` for agents, `operators` for operators, or both. They never block the flight.
    `group`: the id of a group whose users may connect as agents. `waits`: no mission is in force yet, and `loaded` only
    gives the policy.
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
        self._announced = loaded.bundle.mission_digest
        self._greeting_kept: tuple[bytes, bytes] | None = None
        self._switch_s = sys.getswitchinterval()
        self._notes: list[str] = []
        self._left: Sequence[Event] = ()
        self._requests: list[FrameRequest] = []
        self._sockets: list[_SocketQueue] = []
        numbers = count(1)
        try:
            if operators is not None:  # first, so that operators come before agents
                own = AgentSocket(operators, self._greeting, own=True, numbers=numbers, encoded=True)
                self._sockets.append(_SocketQueue(own))
            if path is not None:
                agents = AgentSocket(path, self._greeting, group=group, numbers=numbers, encoded=True)
                self._sockets.append(_SocketQueue(agents))
        except OSError:
            self._close()
            raise
        self._watches = path is not None and operators is not None
        self._over = False  # the mission is over: documents are no longer examined
        #: the digests of examined replacements without an answer, by sender
        self._pending: dict[int, bytes] = {}
        #: the lasting result of each answered replacement, by digest
        self._known: dict[bytes, tuple[str, str]] = {}
        #: descriptions of missions, by digest: the one in force, and those that may follow
        self._missions: dict[bytes, bytes] = {}
        if not waits:
            self._mission()

    def events(self, now: Now) -> Sequence[Event]:
        """The documents received. Long ones and replacements come after a worker thread has examined them. A document
        that was refused there carries its refusal.
        """
        found: list[Event] = [*self._left]
        self._left = ()
        for queue in self._sockets:
            event = queue.socket.poll(now.monotonic_us)
            if isinstance(event, FrameRequest):
                self._requests.append(event)
            elif isinstance(event, ClientLine):
                found += self._of_client(queue, event)
            elif event is not None:
                found += self._dispatch(queue, event, now)
            while queue.ahead and queue.ahead[0][0].done():
                future, came = queue.ahead.pop(0)
                if future.exception() is not None:
                    found.append(Presented(came.at_us, b"", came.sender, _FAILED))
                elif future.result().refused == NO_LINE:
                    queue.socket.answer(came.sender, *NO_LINE)
                else:
                    found.append(future.result())
                if not any(each.ahead for each in self._sockets):
                    sys.setswitchinterval(self._switch_s)
        if self._watches and not self._sockets[-1].socket.users.isdisjoint((0, os.geteuid())):
            self._watches = False
            self._notes.append(SAME_USER)
        return found

    def _of_client(self, queue: _SocketQueue, line: ClientLine) -> Sequence[Event]:
        """What a gateway says of a client, for the log; before the log is open, and once its last epoch may be sealed,
        it is refused.
        """
        answer = _NO_LOG if self._waits else _OVER if self._over else _RECORDED
        queue.socket.answer(line.sender, *answer)
        return (ClientRecord(line.at_us, line.text),) if answer is _RECORDED else ()

    def pass_on(self, send: Callable[[bytes], Refusal | None]) -> None:
        """Hand the received requests to `send`, which refuses those that must not leave, and answer them."""
        requests, self._requests = self._requests, []
        for each in requests:
            refused = send(each.frame)
            self.answer(each.sender, *(_PASSED_ON if refused is None else (refused.slug, refused.text)))

    def _dispatch(self, queue: _SocketQueue, event: Presented | Encoded, now: Now) -> Sequence[Event]:
        """Return a document at once, or pass it to the worker thread."""
        if self._over:
            return (Presented(event.at_us, b"", event.sender),)
        if isinstance(event, Encoded):
            if not self._waits:
                return self._enqueue(queue, event, now)
            event = event.decoded()  # nothing flies yet
            if event.refused is not None:
                queue.socket.answer(event.sender, *event.refused)
                return ()
        if self._waits:
            return (event,)
        try:
            kind = kind_of(event.document)
        except Untrusted:
            return (event,)
        return (event,) if kind is not names.REPLACEMENT else self._enqueue(queue, event, now)

    def _enqueue(self, queue: _SocketQueue, event: Presented | Encoded, now: Now) -> Sequence[Event]:
        """Pass a document to the worker thread."""
        if len(queue.ahead) == _MOST_AHEAD:
            queue.socket.answer(event.sender, "busy", "other documents are being examined")
            return ()
        sys.setswitchinterval(_SWITCH_S)
        queue.ahead.append((queue.worker.submit(self._examine, event, now), event))
        return ()

    def _examine(self, event: Presented | Encoded, now: Now) -> Presented:
        """Decode, hash and verify a document, and prepare its mission, in the worker thread."""
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
        self._pending[came.sender] = digest
        refused = self._loaded.boundary.consider(document, now)
        if refused is not None:
            return replace(came, refused=(refused.slug, str(refused)))
        after = self._loaded.in_force.considered(document)
        if after is not None:
            self._missions[after.mission_digest] = self._describe(after.mission, after.mission_digest)
            for old in [*self._missions][:-_MOST_MISSIONS]:
                self._missions.pop(old, None)
        return replace(came, envelope=b64encode(document).decode())

    def _learn(self, reply: Reply) -> None:
        """Keep the result of a replacement, if it is lasting."""
        digest = self._pending.pop(reply.sender, None)
        if digest is not None and (reply.slug == "accepted" or reply.slug in _LASTING):
            self._known[digest] = _TAKEN_IN if reply.slug == "accepted" else (reply.slug, reply.text)
            while len(self._known) > _MOST_KNOWN:
                del self._known[next(iter(self._known))]

    def fly(self, loaded: Loaded, left: Sequence[Event] = ()) -> None:
        """End the wait with a bundle: announce its mission, and pass documents to its flight from now on. `left` are
        the events that were received together with the bundle.
        """
        self._loaded, self._waits, self._greeting_kept, self._left = loaded, False, None, left
        self._announced = loaded.bundle.mission_digest
        self.tell(self._mission())

    def answer(self, sender: int, slug: str, text: str) -> None:
        """Send the answer to a document to its sender."""
        for queue in self._sockets:
            queue.socket.answer(sender, slug, text)

    def turn_away(self, now: Now) -> None:
        """Refuse all documents from now on, because the mission is over."""
        self._over = True
        for event in self.events(now):
            if isinstance(event, Presented):
                self.watch([Reply(event.sender, *_OVER)])
        self.pass_on(lambda _: Refusal(*_OVER))

    def notes(self) -> Sequence[str]:
        """Notes for the user about the connected users, each once."""
        notes, self._notes = self._notes, []
        return notes

    def watch(self, actions: Sequence[Action]) -> None:
        """Send every new record and every answer to the sockets."""
        for action in actions:
            if isinstance(action, Append):
                self.tell(action.line)
            elif isinstance(action, Reply):
                self._learn(action)
                self.answer(action.sender, action.slug, action.text)
        if self._announced != self._loaded.bundle.mission_digest:
            self._announced = self._loaded.bundle.mission_digest
            self.tell(self._mission())

    def tell(self, line: bytes) -> None:
        """Send a record that did not come from the runtime, such as the close."""
        for queue in self._sockets:
            queue.socket.tell(line)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    def _close(self) -> None:
        for queue in self._sockets:
            queue.worker.shutdown(cancel_futures=True)
        sys.setswitchinterval(self._switch_s)
        for queue in self._sockets:
            queue.socket.close()

    def _greeting(self) -> bytes:
        digest = self._loaded.bundle.mission_digest
        if self._greeting_kept is None or self._greeting_kept[0] != digest:  # an attacker may connect hundreds of times
            self._greeting_kept = digest, self._hello()
        return self._greeting_kept[1]

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
        """The message that no mission is in force yet, with the policy."""
        policy = self._loaded.bundle.policy
        message = {
            "type": "waiting",
            "policy": f"{policy.name}@{policy.version}",
            "policy_digest": self._loaded.bundle.policy_digest.hex(),
        }
        return _encode(message) + b"\n"

    def _mission(self) -> bytes:
        """The description of the mission in force, sent first and after each replacement."""
        bundle = self._loaded.bundle
        line = self._missions.pop(bundle.mission_digest, None)
        line = self._describe(bundle.mission, bundle.mission_digest) if line is None else line
        self._missions[bundle.mission_digest] = line  # moved to the end, so that it is dropped last
        return line

    def _describe(self, mission: Mission, digest: bytes) -> bytes:
        """The JSON line that describes a mission."""
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
        message = {
            "type": "mission",
            "mission": mission.name,
            "digest": digest.hex(),
            "policy": f"{mission.policy}@{mission.policy_version}",
            "policy_digest": bundle.policy_digest.hex(),
            "steps": steps,
        }
        return _encode(message) + b"\n"
