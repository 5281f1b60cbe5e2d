"""What agents and operators are told of a flight on its socket, and what they hand in (docs/agents.md)."""

import sys
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import msgspec

from rtshcua.adapters.agent_socket import AgentSocket
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Action, Append, Event, Presented, Reply

FORMAT: Final = "rtshcua/agent"
VERSION: Final = 1

#: what is larger is looked at ahead in another thread, in bytes: a mission takes some ms a step to verify and prepare
_LARGE: Final = 1 << 11
_MOST_AHEAD: Final = 8
#: how long that thread may keep the flight's from running, in seconds
_SWITCH_S: Final = 0.000_5

_encode = msgspec.json.Encoder().encode


class Agents:
    """The socket of one flight. It never waits, and nothing of the flight depends on it."""

    def __init__(self, path: Path, loaded: Loaded) -> None:
        self._loaded = loaded
        self._told = loaded.bundle.mission_digest
        self._ahead: list[tuple[Future[None], Presented]] = []
        self._worker = ThreadPoolExecutor(1)
        self._switch_s = sys.getswitchinterval()
        self._socket = AgentSocket(path, self._greeting)

    def events(self, now: Now) -> Sequence[Event]:
        """The documents that came in, large ones after they were looked at ahead."""
        found: list[Event] = []
        event = self._socket.poll(now.monotonic_us)
        if event is not None:
            if len(event.document) <= _LARGE:
                found.append(event)
            elif len(self._ahead) == _MOST_AHEAD:
                self._socket.answer(event.sender, "busy", "other documents are being looked at")
            else:
                sys.setswitchinterval(_SWITCH_S)
                consider = self._loaded.boundary.consider
                self._ahead.append((self._worker.submit(consider, event.document, now), event))
        while self._ahead and self._ahead[0][0].done():
            found.append(self._ahead.pop(0)[1])
        return found

    def watch(self, actions: Sequence[Action]) -> None:
        """Tell of what was done: every record as its line, and the answers to whoever handed something in."""
        for action in actions:
            if isinstance(action, Append):
                self._socket.tell(action.line)
            elif isinstance(action, Reply):
                self._socket.answer(action.sender, action.slug, action.text)
        if self._told != self._loaded.bundle.mission_digest:
            self._told = self._loaded.bundle.mission_digest
            self._socket.tell(self._mission())

    def tell(self, line: bytes) -> None:
        """Tell a record that the runtime did not make: the close."""
        self._socket.tell(line)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._worker.shutdown(cancel_futures=True)
        sys.setswitchinterval(self._switch_s)
        self._socket.close()

    def _greeting(self) -> bytes:
        loaded = self._loaded
        hello = {
            "type": "hello",
            "format": FORMAT,
            "version": VERSION,
            "vehicle": loaded.vehicle,
            "flight": loaded.in_force.flight.hex(),
            "mode": loaded.mode.value,
        }
        return _encode(hello) + b"\n" + self._mission()

    def _mission(self) -> bytes:
        """The mission that is in force: sent first, and again after each replacement."""
        bundle = self._loaded.bundle
        mission = bundle.mission
        steps = [
            {
                "step": each.step,
                "phase": mission.phases[each.phase],
                "skill": each.contract.name,
                "text": each.text,
                "id": each.invocation_id.hex(),
                "binding": each.binding.hex(),
            }
            for each in mission.invocations
        ]
        told = {
            "type": "mission",
            "mission": mission.name,
            "digest": bundle.mission_digest.hex(),
            "policy": f"{mission.policy}@{mission.policy_version}",
            "policy_digest": bundle.policy_digest.hex(),
            "steps": steps,
        }
        return _encode(told) + b"\n"
