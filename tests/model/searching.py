"""All reachable states with one bundle in force: the real runtime, boundary and executor, and all events.

Explicit states, breadth first. A state is a whole world (`snapshot`); an event is one call of `Runtime.step`. Time is
an event too: the clock advances by one `UNIT` and the vehicle reports. Events are not limited to plausible ones: the
vehicle may fail, succeed, land, fly or fall silent at any moment.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

from msgspec.structs import replace

from model.small import LIMITS, PROFILES, UNIT, Small
from model.snapshot import BEGIN_US, SERIALS, Snapshots
from model.watching import Ear, Gate, Watch
from reference import documents, world
from reference.flat_case import ISSUED
from reference.seeds import epoch_seeds
from reference.world import SESSION_KEY
from rtshcua.evidence.log_writer import Recorder
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import (
    AirState,
    CommandFailed,
    Crashed,
    Event,
    EvidenceFailed,
    Interrupted,
    LinkBack,
    LinkLost,
    Presented,
    Readings,
    Ready,
    Succeeded,
    TakenOver,
)
from rtshcua.onboard.runtime.runtime import Runtime
from rtshcua.onboard.runtime.view import RunStage
from rtshcua.wire.keys import Duty

START = Now(BEGIN_US, ISSUED + 60 * UNIT, 20_000)
#: no limit in a small world is longer
OLD_US = 2 * UNIT
#: documents presented in one run
MOST_HANDED = 2

EVENTS: dict[str, Callable[["World"], Event]] = {
    "ready": lambda at: Ready(at.now_us),
    "on the ground": lambda at: AirState(at.now_us, False, False),
    "armed": lambda at: AirState(at.now_us, True, False),
    "in the air": lambda at: AirState(at.now_us, True, True),
    "succeeded": lambda at: Succeeded(at.now_us, at.token),
    "failed": lambda at: CommandFailed(at.now_us, at.token, "did-not-stop" if at.holds else "no-progress"),
    "late": lambda at: CommandFailed(at.now_us, at.token, "late"),
    "late success": lambda at: Succeeded(at.now_us, at.before),
    "taken over": lambda at: TakenOver(at.now_us, "POSCTL"),
    "crashed": lambda at: Crashed(at.now_us, "on its side"),
    "link lost": lambda at: LinkLost(at.now_us),
    "link back": lambda at: LinkBack(at.now_us),
    "interrupted": lambda at: Interrupted(at.now_us),
    "evidence failed": lambda at: EvidenceFailed(at.now_us, "disk full"),
}


def _without_the_second(of: Loaded) -> Mission:
    mission = of.bundle.mission
    first, _, *rest = mission.invocations
    steps = (first, *(replace(each, step=number) for number, each in enumerate(rest, 1)))
    return replace(mission, issued_at_us=mission.issued_at_us + UNIT, invocations=steps)


#: correctly signed; an approval is for the second step
DOCUMENTS: dict[str, Callable[[Loaded], bytes]] = {
    "recall": lambda of: documents.recall(of, now=START),
    "granted": lambda of: documents.approval(of, 1, now=START),
    "refused": lambda of: documents.approval(of, 1, now=START, granted=0),
    "replaced": lambda of: documents.replacement(of, 1, _without_the_second(of)),
}


@dataclass
class World:
    """A run with its environment."""

    of: Loaded
    runtime: Runtime
    ear: Ear
    profile: str
    watch: Watch = field(default_factory=Watch)
    now_us: int = BEGIN_US
    token: int = 0  # token of the last sent command,
    before: int = 0  # and of the one before
    left: bool = False  # unattended: the program has ended
    restarted: bool = False  # the program was restarted, at most once
    heard_us: int = BEGIN_US  # the time of the vehicle's last report
    handed: int = 0  # presented documents; refused ones count without a limit

    @property
    def holds(self) -> bool:
        """Whether the running command is a hold."""
        return self.watch.command == MotionKind.HOLD

    def step(self, event: Event | None) -> None:
        """Call the runtime once and check its properties."""
        self.ear.heard.clear()
        self.ear.passed.clear()
        if isinstance(event, Readings):
            self.heard_us = self.now_us
        self.watch.before(event, self.now_us, self.heard_us, known=None not in PROFILES[self.profile].values())
        now = Now(self.now_us, START.utc_us + self.now_us - BEGIN_US, START.utc_error_us)
        actions = self.runtime.step(now, () if event is None else (event,))
        flew = self.watch.flying
        self.watch.after(self.of, self.ear, event, actions, self.now_us)
        if self.watch.flying not in (None, flew):
            self.before, self.token = self.token, self.watch.flying or 0


class Broken(AssertionError):
    """A violated property, with its cause."""


@dataclass
class Found:
    """The result of a search: a graph by state number. An edge has the passed units, and in how many of them the
    vehicle is received.
    """

    states: int = 0
    transitions: int = 0
    edges: list[list[tuple[int, int, int]]] = field(default_factory=list)
    falling: list[bool] = field(default_factory=list)
    next: list[list[int]] = field(default_factory=list)  # by event
    doubles: list[tuple[int, bytes]] = field(default_factory=list)
    whole: bool = True
    endings: set[str] = field(default_factory=set)
    parents: list[tuple[int, str]] = field(default_factory=list)

    def way(self, state: int) -> list[str]:
        """The events from the start to a state."""
        names = []
        while state >= 0:
            state, name = self.parents[state]
            names.append(name)
        return names[::-1]


class Search:
    """One search."""

    def __init__(self, of: Small) -> None:
        self._of = of
        self._snapshots = Snapshots(SESSION_KEY, START.utc_us, OLD_US, (Ear,), late="late" in of.events)
        key = world.LOG_KEY
        self._ear = Ear(Recorder(lambda data: key.sign(data, duty=Duty.LOG), key.public, epoch_seeds()))
        template = world.loaded(of.policy, of.mission)
        self._template = self._snapshots.take(template)
        self._documents = {name: DOCUMENTS[name](template) for name in of.documents}

    def run(self, most: int | None = None, double_of: int | None = None) -> Found:
        """Explore all states from a first run, and from a run resumed after a crash, up to a limit.

        With `double_of`, every nth transition to a known state is checked: its successors must equal those of the
        known state.
        """
        found = Found()
        numbers: dict[bytes, int] = {}
        parents = found.parents
        waiting: deque[tuple[int, bytes]] = deque()

        def number(at: World, parent: int, event: str) -> int:
            ending, digest = _ending(at), self._digest(at)
            known = numbers.get(digest)
            if known is not None:
                if double_of is not None and ending is None and found.transitions % double_of == 0:
                    found.doubles.append((known, self._snapshots.take(at)))
                return known
            new = numbers[digest] = len(parents)
            parents.append((parent, event))
            found.edges.append([])
            found.next.append([])
            found.falling.append(at.runtime._controller.stage is RunStage.FALLING)
            if at.runtime.ending is not None:
                _guarded(found, new, "(over)", _over, at)
            if ending is not None:
                found.endings.add(ending)
            else:
                waiting.append((new, self._snapshots.take(at)))
            return new

        for resumed in (False, True):
            number(self._begin(resumed=resumed), -1, "resumed" if resumed else "begun")
        events = self._events()
        while waiting:
            if most is not None and len(parents) > most:
                found.whole = False
                break
            state, data = waiting.popleft()
            for name, units, happen in events:
                at = self._snapshots.restore(data)
                heard = 0 if at.watch.down else units
                _guarded(found, state, name, happen, at)
                found.transitions += 1
                target = number(at, state, name)
                found.next[state].append(target)
                if name != "restarted":  # that is another run
                    found.edges[state].append((target, units, heard))
        found.states = len(parents)
        for known, data in found.doubles:
            self._compare(found, numbers, known, data)
        return found

    def _compare(self, found: Found, numbers: dict[bytes, int], known: int, data: bytes) -> None:
        """Check that two states that count as equal lead to equal states after every event."""
        for (name, _, happen), target in zip(self._events(), found.next[known], strict=True):
            at = self._snapshots.restore(data)
            happen(at)
            if numbers.get(self._digest(at)) != target:
                raise Broken(f"not alike after {[*found.way(known), name]}")

    def _digest(self, at: World) -> bytes:
        parts: object = _ending(at)  # an ended run has no further state
        if parts is None:
            parts = (at.runtime, at.of, at.watch, at.profile, at.heard_us, at.restarted, at.handed)
        controller = at.runtime._controller
        standing = controller.dispatcher._standing
        return self._snapshots.canonical(parts, at.now_us, controller.stage, None if standing is None else standing[1])

    def _begin(self, *, resumed: bool) -> World:
        of = self._loaded()
        at = World(of, Runtime(of, self._ear, limits=LIMITS, resumed=resumed), self._ear, self._of.profiles[0])
        at.restarted = at.watch.resumed = resumed
        at.step(_readings(at))
        return at

    def _loaded(self) -> Loaded:
        of = self._snapshots.restore(self._template)
        of.boundary._issuer._serial = SERIALS
        return replace(of, executor=Gate(of.executor, SESSION_KEY, self._ear))

    def _restart(self, at: World) -> None:
        """Restart the program: it only knows that a run of this bundle was interrupted."""
        if not at.restarted:
            at.restarted = True
            at.of = self._loaded()
            at.runtime = Runtime(at.of, self._ear, limits=LIMITS, resumed=True)
            at.watch = Watch(resumed=True, airborne=at.watch.airborne, armed=at.watch.armed)
            at.token = at.before = at.handed = 0
            at.step(_readings(at))

    def _events(self) -> list[tuple[str, int, Callable[[World], None]]]:
        """All possible events: name, passed units, and effect."""
        happen: list[tuple[str, int, Callable[[World], None]]] = []
        for name in self._of.events:
            if name == "restarted":
                happen.append((name, 0, self._restart))
            elif name in PASSING:
                happen.append((name, *PASSING[name]))
            else:
                happen.append((name, 0, partial(_happens, make=EVENTS[name])))
        for name, document in self._documents.items():
            happen.append((name, 0, partial(_presented, document=document)))
        return happen + [(name, 0, partial(_turns, profile=name)) for name in self._of.profiles]


def _ending(at: World) -> str | None:
    return "left" if at.left else None if at.runtime.ending is None else at.runtime.ending.value


def _guarded(found: Found, state: int, name: str, happen: Callable[[World], None], at: World) -> None:
    try:
        happen(at)
    except Exception as error:
        raise Broken(f"{error!r} after {[*found.way(state), name]}") from error


def _over(at: World) -> None:
    """Check that an ended run has no further effect."""
    for make in EVENTS.values():
        at.step(make(at))
    _tick(at)


def _happens(at: World, make: Callable[[World], Event]) -> None:
    at.step(make(at))


def _presented(at: World, document: bytes) -> None:
    if at.handed < MOST_HANDED:
        at.handed += 1
        at.step(Presented(at.now_us, document))


def _readings(at: World) -> Readings:
    return Readings(at.now_us, tuple(PROFILES[at.profile].items()))


def _turns(at: World, profile: str) -> None:
    at.profile = profile
    at.step(_readings(at))


def _tick(at: World) -> None:
    at.now_us += UNIT
    at.step(_readings(at))


def _silence(at: World) -> None:
    at.now_us += UNIT
    at.step(None)


def _leave(at: World) -> None:
    """Leave as the program does: one more step, then the end."""
    at.left = True
    at.runtime.leave()
    at.step(None)


#: events other than those of the ports: name, passed units, and effect
PASSING: dict[str, tuple[int, Callable[[World], None]]] = {
    "time": (1, _tick),
    "silence": (1, _silence),
    "left alone": (0, _leave),
}
