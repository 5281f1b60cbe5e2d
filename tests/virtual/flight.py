"""A whole flight in one process and in virtual time: simulation, driver, loop, runtime, evidence."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import msgspec

from reference.seeds import epoch_seeds
from reference.verifiers import agree
from rtshcua.adapters.loop import Loop
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.chain import Recorder
from rtshcua.evidence.durability import SYNCED_FIRST
from rtshcua.ground.auditor.audit import Audit, Auditor
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.load import Loaded, Mode, load
from rtshcua.onboard.ports import Action, Ending, Event
from rtshcua.onboard.runtime.runtime import Runtime
from rtshcua.simulation.config import SimulationConfig
from rtshcua.wire.keys import Duty
from rtshcua.wire.trust import TrustRoot
from virtual import case
from virtual.vehicle import VirtualClock, VirtualVehicle

MONOTONIC_US = 7_000_000


class MemorySink:
    """Evidence in a list; `full` makes it refuse, keeping the lines as the file does."""

    def __init__(self) -> None:
        self.lines: list[bytes] = []
        self.full = False
        self._waiting: list[bytes] = []

    @property
    def kept(self) -> int:
        return len(self.lines)

    synced = kept

    def append(self, line: bytes, durability: int) -> int:
        self._waiting.append(line)
        if self.full:
            raise OSError(28, "no space left on device")
        self.lines += self._waiting
        self._waiting.clear()
        return len(self.lines)

    def trouble(self) -> str | None:
        return None

    def late(self) -> str | None:
        return None

    def close(self) -> None:
        pass


@dataclass
class Flown:
    """What came of a flight."""

    ending: Ending
    lines: list[bytes]
    vehicle: VirtualVehicle
    steps: int
    loaded: Loaded
    records: list[dict[str, Any]] = field(init=False)

    def __post_init__(self) -> None:
        self.records = [msgspec.json.decode(line) for line in self.lines]

    def audit(self) -> Audit:
        """What `verify-log` makes of the log; the independent verifier must agree."""
        auditor = Auditor(case.KEYS[Duty.ROOT].kid)
        for line in self.lines:
            auditor.take(line)
        found = auditor.audit()
        agree(b"".join(self.lines), found)
        return found

    def dispatched(self) -> list[str]:
        return [record["detail"] for record in self.effects("dispatched")]

    def effects(self, event: str) -> list[dict[str, Any]]:
        return [record for record in self.records if record["type"] == "effect" and record["event"] == event]

    def decisions(self) -> list[tuple[int, str, str]]:
        """(step, outcome, reason) of every decision about a step."""
        return [
            (record["step"], record["outcome"], record["reason"])
            for record in self.records
            if record["type"] == "decision" and record["kind"] == 0
        ]


class Flight:
    """One flight, turn by turn. `each` is called before every turn, and may inject faults or give events."""

    def __init__(
        self, bundle: bytes, config: SimulationConfig, *, trust: tuple[TrustRoot, bytes] | None = None,
        mode: Mode = Mode.SOFTWARE, utc_us: int = case.flat.ISSUED + 60 * case.S, wait_us: int = 100_000,
        resumed: bool = False, vehicle: VirtualVehicle | None = None, fence: bool = True, sink: Any = None,
    ) -> None:  # fmt: skip
        root, signed_root = trust or case.root()
        self.clock = vehicle.clock if vehicle else VirtualClock(Now(MONOTONIC_US, utc_us, 1_000))
        now = self.clock.now()
        loaded = load(
            bundle, root=root, vehicle="quad-07", now=now, mode=mode, session_key=bytes(32), peer_is_own_simulator=True
        )
        assert not isinstance(loaded, Refusal), loaded
        self.loaded = loaded
        frames = loaded.executor.frames
        self.vehicle = vehicle or VirtualVehicle(loaded.bundle.policy, config, self.clock, frames, fence=fence)
        loaded.executor.frames = self.vehicle.frames
        log_key = case.KEYS[Duty.LOG]
        self.recorder = Recorder(lambda text: log_key.sign(text, duty=Duty.LOG), log_key.public, epoch_seeds())
        self.runtime = Runtime(loaded, self.recorder, resumed=resumed)
        self.sink = MemorySink() if sink is None else sink(self.clock)
        mission = loaded.bundle.mission.name
        self.sink.append(
            self.recorder.genesis(
                now, bundle=bundle, root=signed_root, boot=bytes(16), vehicle="quad-07", mission=mission, mode=mode
            ),
            SYNCED_FIRST,
        )
        self.events: list[Event] = []
        self.steps = 0
        self.loop = Loop(self.runtime, self.vehicle, self.sink, self.clock, self._watch, wait_us)

    def fly(self, each: Callable[["Flight"], Sequence[Event]] = lambda _: (), most_s: int = 3_600) -> Flown:
        """Fly until the end."""
        ending = None
        while ending is None:
            assert self.clock.elapsed_us < most_s * case.S, self.runtime.view(self.clock.now())
            ending = self.loop.turn(each(self))
        with suppress(OSError):
            self.sink.append(self.recorder.close(self.clock.now(), ending=ending, tlog=None), SYNCED_FIRST)
            self.sink.close()
        return Flown(ending, self.sink.lines, self.vehicle, self.steps, self.loaded)

    def _watch(self, now: Now, events: Sequence[Event], actions: Sequence[Action]) -> None:
        self.events += events
        self.steps += 1
