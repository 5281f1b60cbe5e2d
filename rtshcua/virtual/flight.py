"""A whole flight of a signed bundle, turn by turn: simulation, driver, loop, runtime, evidence."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from errno import ENOSPC
from functools import lru_cache, partial
from types import MappingProxyType
from typing import Any, Final, Protocol, Self

import msgspec

from rtshcua.adapters.loop import RunLoop, append_all
from rtshcua.adapters.packs import manoeuvres, packs_of
from rtshcua.adapters.preparation import Preparations
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.log_writer import Recorder
from rtshcua.ground.audit.audit import Audit, Auditor
from rtshcua.model.durability import SYNCED_FIRST
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.isolated import Caller
from rtshcua.onboard.enforcement.load import SESSION_KEY_BYTES, EnforcementMode, Loaded, load
from rtshcua.onboard.enforcement.preparation import Owed
from rtshcua.onboard.ports import Action, BoundaryKey, Ending, Event, EvidenceSink, Interrupted
from rtshcua.onboard.runtime.runtime import Runtime
from rtshcua.simulation.config import SimulationConfig
from rtshcua.virtual.boundary_in_process import Served
from rtshcua.virtual.fitting import fitting
from rtshcua.virtual.vehicle import SECOND, START, TICK_US, VirtualClock, VirtualVehicle
from rtshcua.wire import bundle as bundles
from rtshcua.wire import cose, names
from rtshcua.wire.boundary_chain import START as FIRST
from rtshcua.wire.document import FLIGHT_BYTES
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import MAX_ROOT, open_root

#: signs the log where no other key is given; no trust root names it, so whoever audits such a log refuses it
NOBODY: Final = SigningKey.from_seed(bytes(32), duty=Duty.LOG, development=True)
#: after it was issued, a bundle flies
LATER_US: Final = 60 * SECOND


class ReadableSink(EvidenceSink, Protocol):
    """An evidence sink that can be read afterwards."""

    @property
    def lines(self) -> list[bytes]:
        """What was kept."""
        ...


class MemorySink:
    """Evidence in a list; `full` makes it refuse, keeping the lines as the file does; `slow`, wait for `keep`."""

    def __init__(self) -> None:
        self.lines: list[bytes] = []
        self.full = self.slow = False
        self._waiting: list[bytes] = []

    @property
    def kept(self) -> int:
        """How many lines were kept; each is as durable as it ever gets."""
        return len(self.lines)

    synced = kept

    def append(self, line: bytes, durability: int) -> int:
        """Keep a line; `OSError` while `full`."""
        self._waiting.append(line)
        if self.full:
            raise OSError(ENOSPC, "no space left on device")
        if not self.slow:
            self.keep()
        return len(self.lines) + len(self._waiting)

    def keep(self) -> None:
        """What waits is kept."""
        self.lines += self._waiting
        self._waiting.clear()

    def trouble(self) -> str | None:
        """None: nothing is written behind one's back."""
        return None

    def late(self) -> str | None:
        """None: nothing is promised."""
        return None

    def close(self) -> None:
        """Waits until all is kept that can be."""
        if not self.full:
            self.keep()


@dataclass
class FlownFlight:
    """What came of a flight: how it ended, the log's lines, and its records as they read."""

    ending: Ending
    lines: list[bytes]
    vehicle: VirtualVehicle
    steps: int
    """How often the runtime was stepped."""
    loaded: Loaded
    root: bytes
    """The name of the key that signed the trust root (its `kid`): what an audit of the log is pinned to."""
    records: list[dict[str, Any]] = field(init=False)

    def __post_init__(self) -> None:
        self.records = [msgspec.json.decode(line) for line in self.lines]

    def audit(self) -> Audit:
        """What `verify-log --audit` makes of the log."""
        auditor = Auditor(self.root)
        for line in self.lines:
            auditor.take(line)
        return auditor.audit()

    def dispatched(self) -> list[str]:
        """What was sent to the vehicle, command by command."""
        return [record["detail"] for record in self.effects("dispatched")]

    def effects(self, event: str) -> list[dict[str, Any]]:
        """The records of this event."""
        return [record for record in self.records if record["type"] == "effect" and record["event"] == event]

    def decisions(self) -> list[tuple[int, str, str]]:
        """(step, outcome, reason) of every decision about a step."""
        return [
            (record["step"], record["outcome"], record["reason"])
            for record in self.records
            if record["type"] == "decision" and record["kind"] == 0
        ]


class VirtualFlight:
    """One flight of `bundle` under the signed trust root `root`, turn by turn.

    The same arguments give the same flight, byte by byte. `simulated` is the simulated vehicle, or what makes one for
    the bundle's policy. `utc_us` is the time of day at the start, a minute after the bundle was issued if it is not
    given. `log_key` signs the log; it must be one of the root's if that is to be audited. `sink` makes another place
    for the evidence than memory, and `vehicle` is one that was made already, with the clock that it lives by. What the
    vehicle says is heard every `tick_us`: a longer tick makes a flight cheaper, and what happens on it as much later.
    `before` is the hash of the last line of the vehicle's log before this one. `settings` are parameters that are set
    before the flight, `owed` what earlier ones left to be put back, kept up to date as a file would be. With `boundary`
    the boundary signs its own evidence, as its first session where only the key is given; it must where the root names
    a key for that.
    Raises ValueError for a bundle that is refused, and what `open_root` raises.
    """

    #: what it leaves behind
    flown: type[FlownFlight] = FlownFlight

    def __init__(
        self, bundle: bytes, simulated: SimulationConfig | Callable[[Policy], SimulationConfig] = fitting,
        *, root: bytes, log_key: SigningKey = NOBODY, mode: EnforcementMode = EnforcementMode.SOFTWARE,
        utc_us: int | None = None,
        wait_us: int = 100_000, resumed: bool = False, vehicle: VirtualVehicle | None = None, fence: bool = True,
        sink: Callable[[VirtualClock], ReadableSink] | None = None, tick_us: int = TICK_US, before: str | None = None,
        settings: Mapping[str, int] = MappingProxyType({}), owed: dict[str, Owed] | None = None,
        boundary: BoundaryKey | SigningKey | None = None,
    ) -> None:  # fmt: skip
        policy, mission = claimed(bundle)
        utc_us = mission.issued_at_us + LATER_US if utc_us is None else utc_us
        self.clock = vehicle.clock if vehicle else VirtualClock(Now(START.monotonic_us, utc_us, START.utc_error_us))
        now = self.clock.now()
        self._root_key = cose.unverified(root, limit=MAX_ROOT).kid
        trusted = open_root(root, pinned=self._root_key, now_us=now.utc_us)
        first = BoundaryKey(boundary, 1, FIRST) if isinstance(boundary, SigningKey) else boundary
        #: the boundary elsewhere that it flies by, in mode `process`
        self.served = Served(trusted, policy.vehicle.identity, first and first.key, settings, owed or {})
        loaded = load(
            bundle, root=trusted, vehicle=policy.vehicle.identity, now=now, mode=mode,
            session_key=bytes(SESSION_KEY_BYTES), flight=bytes(FLIGHT_BYTES), peer_is_own_simulator=True,
            settings=settings, owed=owed or {}, caller=Caller(self.served) if mode is EnforcementMode.PROCESS else None,
        )  # fmt: skip
        if isinstance(loaded, Refusal):
            raise ValueError(f"{loaded.slug}: {loaded.text}")
        self.loaded = loaded
        if vehicle is None:
            config = simulated if isinstance(simulated, SimulationConfig) else simulated(policy)
            ways = manoeuvres(packs_of(policy.sources))
            vehicle = VirtualVehicle(
                policy, config, self.clock, loaded.executor.frames, fence=fence, manoeuvres=ways, tick_us=tick_us,
                steps=mission.invocations,
            )  # fmt: skip
        self.vehicle = vehicle
        loaded.executor.frames = vehicle.frames
        self.recorder = Recorder(lambda text: log_key.sign(text, duty=Duty.LOG), log_key.public, _Seeds())
        self.runtime = Runtime(loaded, self.recorder, resumed=resumed)
        self.vehicle.driver.resumes = resumed
        self.sink: ReadableSink = MemorySink() if sink is None else sink(self.clock)
        self.sink.append(
            self.recorder.genesis(
                now,
                bundle=bundle,
                root=root,
                boot=loaded.in_force.flight,
                vehicle=loaded.vehicle,
                mission=mission.name,
                mode=mode,
                before=before,
                received_us=now.monotonic_us,
            ),
            SYNCED_FIRST,
        )
        loaded.attestation.begin(first)
        self.recorder.attest = loaded.attestation.statement
        append_all(self.sink, self.recorder.attested(now), SYNCED_FIRST)
        self.events: list[Event] = []
        self.steps = 0
        self._wait_us = wait_us
        self._early: list[Event] = []
        kept = {} if owed is None else owed

        def keep_owed(now_owed: Mapping[str, Owed]) -> None:
            kept.clear()
            kept.update(now_owed)

        self.preparations = Preparations(
            loaded, self.vehicle.driver, self.clock, kept, self._record, self._record, keep_owed
        )
        self.loop = RunLoop(self.runtime, self.vehicle, self.sink, self.clock, self._watch, wait_us, prepares=False)

    def fly(self, each: Callable[[Self], Sequence[Event]] = lambda _: (), most_s: int = 3_600) -> FlownFlight:
        """Fly until the end; `each` is called before every turn, and may inject faults or give events.

        Raises TimeoutError for a flight that has not ended after `most_s` seconds of its time.
        """
        ending = self.prepare(each)
        while ending is None:
            if self.clock.elapsed_us >= most_s * SECOND:
                raise TimeoutError(f"after {most_s} s it flies still: {self.runtime.view(self.clock.now())}")
            ending = self.turn(each(self))
        if ending is not Ending.CRASHED:
            self.preparations.end(partial(self._pass, each))
        return self.close(ending)

    def prepare(self, each: Callable[[Self], Sequence[Event]] = lambda _: ()) -> Ending | None:
        """Set what is configured, before the first turn; an ending where that keeps the mission from flying."""
        return Ending.REFUSED if self.preparations.begin(partial(self._pass, each)) is not None else None

    def turn(self, also: Sequence[Event] = ()) -> Ending | None:
        """One turn of the loop; its ending, once there is one."""
        early, self._early = self._early, []
        return self.loop.turn([*early, *also])

    def _pass(self, each: Callable[[Self], Sequence[Event]]) -> bool:
        """Let time pass outside of the loop, which is told afterwards what happened; False if it is to stop."""
        given = each(self)
        self._early += given
        self._early += self.vehicle.poll(self.clock.now().monotonic_us, self._wait_us)
        now = self.clock.now()
        if self.recorder.due(now):
            append_all(self.sink, self.recorder.sealing(now), SYNCED_FIRST)
        return not any(isinstance(event, Interrupted) for event in given)

    def close(self, ending: Ending) -> FlownFlight:
        """Sign and close the log of a flight that ended so; what came of it."""
        with suppress(OSError):
            append_all(self.sink, self.recorder.closing(self.clock.now(), ending=ending, tlog=None), SYNCED_FIRST)
            self.sink.close()
        return self.flown(ending, self.sink.lines, self.vehicle, self.steps, self.loaded, self._root_key)

    def _record(self, event: str, detail: str) -> None:
        now = self.clock.now()
        append_all(self.sink, self.recorder.caught_up(now), SYNCED_FIRST)
        self.sink.append(self.recorder.effect(now, event, detail=detail, durability=SYNCED_FIRST), SYNCED_FIRST)

    def _watch(self, now: Now, events: Sequence[Event], actions: Sequence[Action]) -> None:
        self.events += events
        self.steps += 1


class _Seeds:
    """Secrets of epoch keys, the same in each flight: whoever flies virtually has nothing to hide."""

    def __init__(self) -> None:
        self._drawn = 0

    def __call__(self) -> bytes:
        self._drawn += 1
        return self._drawn.to_bytes(32)


@lru_cache(maxsize=8)
def claimed(bundle: bytes) -> tuple[Policy, Mission]:
    """What is in a bundle, whoever signed it: `load` verifies it, once it is known when it flies, and on what.

    The flights of a campaign, which are all of one bundle, read it once.
    """
    policy, mission = (cose.unverified(envelope).payload for envelope in bundles.envelopes(bundle))
    return bundles.parse(names.POLICY, policy, Policy), bundles.parse(names.MISSION, mission, Mission)
