"""A whole flight of a signed bundle in virtual time: simulation, driver, loop, runtime and evidence."""

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

#: the default log key; no trust root names it, so an audit of such a log fails
NOBODY: Final = SigningKey.from_seed(bytes(32), duty=Duty.LOG, development=True)
#: the default time from the issue of a bundle to its flight
LATER_US: Final = 60 * SECOND


class ReadableSink(EvidenceSink, Protocol):
    """An evidence sink that can be read afterwards."""

    @property
    def lines(self) -> list[bytes]:
        """The stored lines."""
        ...


class MemorySink:
    """Evidence in a list. While `full`, appending fails like on a full disk; while `slow`, lines wait for `keep`."""

    def __init__(self) -> None:
        self.lines: list[bytes] = []
        self.full = self.slow = False
        self._waiting: list[bytes] = []

    @property
    def kept(self) -> int:
        """The number of stored lines; they are durable at once."""
        return len(self.lines)

    synced = kept

    def append(self, line: bytes, durability: int) -> int:
        """Store a line. Raise OSError while `full`."""
        self._waiting.append(line)
        if self.full:
            raise OSError(ENOSPC, "no space left on device")
        if not self.slow:
            self.keep()
        return len(self.lines) + len(self._waiting)

    def keep(self) -> None:
        """Store the waiting lines."""
        self.lines += self._waiting
        self._waiting.clear()

    def trouble(self) -> str | None:
        """Return None: there is no background writer."""
        return None

    def late(self) -> str | None:
        """Return None: there is no deadline for writing."""
        return None

    def close(self) -> None:
        """Store the waiting lines, unless full."""
        if not self.full:
            self.keep()


@dataclass
class FlownFlight:
    """The result of a flight: its ending, the log's lines and its decoded records."""

    ending: Ending
    lines: list[bytes]
    vehicle: VirtualVehicle
    steps: int
    """How often the runtime was stepped."""
    loaded: Loaded
    root: bytes
    """The `kid` of the key that signed the trust root: an audit of the log pins it."""
    records: list[dict[str, Any]] = field(init=False)

    def __post_init__(self) -> None:
        self.records = [msgspec.json.decode(line) for line in self.lines]

    def audit(self) -> Audit:
        """Return the audit of the log, as `verify-log --audit` makes it."""
        auditor = Auditor(self.root)
        for line in self.lines:
            auditor.take(line)
        return auditor.audit()

    def dispatched(self) -> list[str]:
        """Return the dispatched commands, in order."""
        return [record["detail"] for record in self.effects("dispatched")]

    def effects(self, event: str) -> list[dict[str, Any]]:
        """Return the effect records of this event."""
        return [record for record in self.records if record["type"] == "effect" and record["event"] == event]

    def decisions(self) -> list[tuple[int, str, str]]:
        """Return (step, outcome, reason) of every decision about a step."""
        return [
            (record["step"], record["outcome"], record["reason"])
            for record in self.records
            if record["type"] == "decision" and record["kind"] == 0
        ]


class VirtualFlight:
    """One flight of `bundle` under the signed trust root `root`, turn by turn.

    The same arguments give the same flight, byte for byte.

    - `simulated`: the configuration of the simulated vehicle, or a function that makes one for the bundle's policy.
    - `utc_us`: UTC at the start; by default one minute after the bundle was issued.
    - `log_key`: signs the log; the root must name it for an audit to pass.
    - `sink`: makes the evidence sink; by default evidence is kept in memory.
    - `vehicle`: an existing vehicle, with its clock.
    - `tick_us`: how often the vehicle's frames are read. A longer tick makes a flight cheaper and reactions later.
    - `before`: the hash of the last line of the vehicle's previous log.
    - `settings`: parameters to set before the flight; `owed`: parameters to restore, updated in place.
    - `idle_us`: the mission is live, and waits so long in the air for its next step.
    - `boundary`: the key of the boundary's own evidence, with its session; required if the root names such a key.

    Raise ValueError for a refused bundle, and whatever `open_root` raises.
    """

    #: the type of the result
    flown: type[FlownFlight] = FlownFlight

    def __init__(
        self, bundle: bytes, simulated: SimulationConfig | Callable[[Policy], SimulationConfig] = fitting,
        *, root: bytes, log_key: SigningKey = NOBODY, mode: EnforcementMode = EnforcementMode.SOFTWARE,
        utc_us: int | None = None,
        wait_us: int = 100_000, resumed: bool = False, vehicle: VirtualVehicle | None = None, fence: bool = True,
        sink: Callable[[VirtualClock], ReadableSink] | None = None, tick_us: int = TICK_US, before: str | None = None,
        settings: Mapping[str, int] = MappingProxyType({}), owed: dict[str, Owed] | None = None,
        boundary: BoundaryKey | SigningKey | None = None, idle_us: int | None = None,
    ) -> None:  # fmt: skip
        policy, mission = claimed(bundle)
        utc_us = mission.issued_at_us + LATER_US if utc_us is None else utc_us
        self.clock = vehicle.clock if vehicle else VirtualClock(Now(START.monotonic_us, utc_us, START.utc_error_us))
        now = self.clock.now()
        self._root_key = cose.unverified(root, limit=MAX_ROOT).kid
        trusted = open_root(root, pinned=self._root_key, now_us=now.utc_us)
        first = BoundaryKey(boundary, 1, FIRST) if isinstance(boundary, SigningKey) else boundary
        #: the boundary in mode `process`
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
        self.runtime = Runtime(loaded, self.recorder, resumed=resumed, idle_us=idle_us)
        self.vehicle.driver.resumes = resumed
        self.sink: ReadableSink = MemorySink() if sink is None else sink(self.clock)
        genesis = self.recorder.genesis(
            now, bundle=bundle, root=root, boot=loaded.in_force.flight, vehicle=loaded.vehicle, mission=mission.name,
            mode=mode, before=before, received_us=now.monotonic_us,
        )  # fmt: skip
        self.sink.append(genesis, SYNCED_FIRST)
        loaded.attestation.begin(first)
        self.recorder.attest = loaded.attestation.statement
        append_all(self.sink, self.recorder.attested(now), SYNCED_FIRST)
        self.events: list[Event] = []
        self.steps = 0
        self._wait_us = wait_us
        self._early: list[Event] = []
        self._owed = {} if owed is None else owed
        self.preparations = Preparations(
            loaded, self.vehicle.driver, self.clock, self._owed, self._record, self._record, self._keep_owed
        )
        self.loop = RunLoop(self.runtime, self.vehicle, self.sink, self.clock, self._watch, wait_us, prepares=False)

    def fly(self, each: Callable[[Self], Sequence[Event]] = lambda _: (), most_s: int = 3_600) -> FlownFlight:
        """Fly until the end. `each` is called before every turn; it may inject faults and return events.

        Raise TimeoutError if the flight has not ended after `most_s` simulated seconds.
        """
        ending = self.prepare(each)
        while ending is None:
            if self.clock.elapsed_us >= most_s * SECOND:
                raise TimeoutError(f"the flight has not ended after {most_s} s: {self.runtime.view(self.clock.now())}")
            ending = self.turn(each(self))
        if ending is not Ending.CRASHED:
            self.preparations.end(partial(self._pass, each))
        return self.close(ending)

    def prepare(self, each: Callable[[Self], Sequence[Event]] = lambda _: ()) -> Ending | None:
        """Set the configured parameters before the first turn; return an ending if that fails."""
        return Ending.REFUSED if self.preparations.begin(partial(self._pass, each)) is not None else None

    def turn(self, also: Sequence[Event] = ()) -> Ending | None:
        """Run one turn of the loop; return the ending, if any."""
        early, self._early = self._early, []
        return self.loop.turn([*early, *also])

    def _pass(self, each: Callable[[Self], Sequence[Event]]) -> bool:
        """Advance outside the loop, keeping events for its next turn; return False to stop."""
        given = each(self)
        self._early += given
        self._early += self.vehicle.poll(self.clock.now().monotonic_us, self._wait_us)
        now = self.clock.now()
        if self.recorder.due(now):
            append_all(self.sink, self.recorder.sealing(now), SYNCED_FIRST)
        return not any(isinstance(event, Interrupted) for event in given)

    def close(self, ending: Ending) -> FlownFlight:
        """Sign and close the log with this ending; return the result."""
        with suppress(OSError):
            append_all(self.sink, self.recorder.closing(self.clock.now(), ending=ending, tlog=None), SYNCED_FIRST)
            self.sink.close()
        return self.flown(ending, self.sink.lines, self.vehicle, self.steps, self.loaded, self._root_key)

    def _keep_owed(self, owed: Mapping[str, Owed]) -> None:
        self._owed.clear()
        self._owed.update(owed)

    def _record(self, event: str, detail: str) -> None:
        now = self.clock.now()
        append_all(self.sink, self.recorder.caught_up(now), SYNCED_FIRST)
        self.sink.append(self.recorder.effect(now, event, detail=detail, durability=SYNCED_FIRST), SYNCED_FIRST)

    def _watch(self, now: Now, events: Sequence[Event], actions: Sequence[Action]) -> None:
        self.events += events
        self.steps += 1


class _Seeds:
    """Fixed secrets of epoch keys: virtual flights need no secrecy."""

    def __init__(self) -> None:
        self._drawn = 0

    def __call__(self) -> bytes:
        self._drawn += 1
        return self._drawn.to_bytes(32)


@lru_cache(maxsize=8)
def claimed(bundle: bytes) -> tuple[Policy, Mission]:
    """Return the policy and mission of a bundle without verifying it; `load` verifies it later.

    Cached: all flights of a campaign use one bundle.
    """
    policy, mission = (cose.unverified(envelope).payload for envelope in bundles.envelopes(bundle))
    return bundles.parse(names.POLICY, policy, Policy), bundles.parse(names.MISSION, mission, Mission)
