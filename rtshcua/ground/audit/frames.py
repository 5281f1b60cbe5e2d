"""Evidence before effect, held against the raw frames: what we sent had a record first, and was what that permits.

A frame of ours is one that the companion's component sent in a system of which an autopilot was heard; before any was
heard, in every system. For whoever reaches the link can send the heartbeat of another system, nothing follows from one:
frames of a companion like ours in another vehicle's system, heard over the same link, count as ours too. Each that is
not harmless must be part of a command (`frame_meaning`) whose `dispatched` record is earlier and whose end is not.
One that sets a parameter must be listed by a record before it, with its value, and the vehicle stand on the ground.
Frames of others, which came over the same link, are theirs to answer for.

Where the boundary signs its own evidence, the commands among them are just those that passed its gate, in this order
(`wire.boundary_chain`): each statement says how many there were, and their digest.

Frames carry UTC, records UTC too, both of one clock that never goes back: their order is exact, but for frames and
records of the same microsecond, whose order among themselves nobody can tell and which count for either.

What is kept does not grow with the flight: for each system (there are 255) its autopilot, and the height of its home.
"""

from collections.abc import Iterator
from math import isfinite
from typing import Final, NamedTuple

from rtshcua.evidence.finding import Finding, Flaw
from rtshcua.evidence.records import Effect
from rtshcua.ground.audit.dispatches import DISPATCHED, is_withdrawn
from rtshcua.ground.audit.frame_meaning import (
    AuditedFrame,
    FrameNature,
    HomeHeights,
    MotionTarget,
    frame_words,
    is_part_of,
    nature,
    parameter_write,
    read_frame,
    switches_fence_on,
    target_of_link,
    target_of_step,
)
from rtshcua.ground.audit.preparations import Listed
from rtshcua.ground.audit.trust import Basis
from rtshcua.mavlink import enums
from rtshcua.mavlink.framing import unsigned
from rtshcua.mavlink.layouts import EXTENDED_SYS_STATE, GLOBAL_POSITION_INT, HEARTBEAT, LAYOUTS, PARAM_VALUE
from rtshcua.mavlink.modes import is_vehicle
from rtshcua.mavlink.parameters import bits_of
from rtshcua.wire.boundary_chain import START, after_frame
from rtshcua.wire.request import CONTINGENCY_LINK, DEGRADE, STEP

#: who we are
OURS: Final = enums.MAV_COMP_ID_ONBOARD_COMPUTER

_identity: Final = LAYOUTS[HEARTBEAT].getter("type autopilot")
_base_mode: Final = LAYOUTS[HEARTBEAT].getter("base_mode")
_landed: Final = LAYOUTS[EXTENDED_SYS_STATE].getter("landed_state")
_heights: Final = LAYOUTS[GLOBAL_POSITION_INT].getter("alt relative_alt")


class _Entry(NamedTuple):
    number: int
    at_us: int
    octets: bytes


class _Suspect(NamedTuple):
    """The first frame that nothing covers. `record` is the last record before it."""

    frame: AuditedFrame
    number: int
    at_us: int
    record: int
    running: bool


class _Running(NamedTuple):
    targets: tuple[MotionTarget, ...]
    token: int
    since_us: int
    record: int
    before: tuple[MotionTarget, ...]  # what was allowed until that very moment


class _Allowed(NamedTuple):
    """What may be sent besides what is harmless: frames that do any of `targets`, parameters that are `listed`, and
    those of the `fence`.
    """

    targets: tuple[MotionTarget, ...] = ()
    listed: tuple[Listed, ...] = ()
    fence: bool = False

    def or_as(self, other: "_Allowed") -> "_Allowed":
        """What either allows, each once."""
        targets, listed = {*self.targets, *other.targets}, {*self.listed, *other.listed}
        return _Allowed(tuple(targets), tuple(listed), self.fence or other.fence)


class _Stated(NamedTuple):
    """How many frames had passed the gate, their digest, and the record that says so."""

    passed: int
    digest: bytes
    record: int


#: the slug of frames that are not those that passed the boundary's gate
OTHERS: Final = "boundary/frames"


class _Passed:
    """The commands among the frames, held against what the boundary stated. What is kept is bounded by an epoch."""

    def __init__(self) -> None:
        self._count = 0
        self._digests = {0: START}  # by how many there were, since the last statement
        self._awaited: list[_Stated] = []  # of which not all frames came by
        self._last: _Stated | None = None
        self._final = False

    def frame(self, octets: bytes) -> Finding | None:
        """One command more."""
        digest = after_frame(self._digests[self._count], octets)
        self._count += 1
        if self._last is not None:
            self._digests[self._count] = digest
            return self._compared()
        self._digests = {self._count: digest}
        return None

    def stated(self, stated: _Stated, *, final: bool) -> Finding | None:
        """What the boundary signed next."""
        self._last, self._final = stated, final
        self._awaited.append(stated)
        return self._compared()

    def over(self) -> Finding | None:
        """There are no more frames."""
        if self._awaited:
            text = (
                f"{self._awaited[0].passed - self._count} frames that passed the boundary's gate by then are not there"
            )
            return Flaw(OTHERS, text).at(self._awaited[0].record)
        if self._last is not None and self._final and self._count > self._last.passed:
            text = f"{self._count - self._last.passed} commands were sent that did not pass the boundary's gate"
            return Flaw(OTHERS, text).at(self._last.record)
        return None

    def _compared(self) -> Finding | None:
        while self._awaited and self._awaited[0].passed <= self._count:
            stated = self._awaited.pop(0)
            digest = self._digests.get(stated.passed)
            if digest != stated.digest:
                text = "the commands among the frames are not those that passed the boundary's gate up to then"
                found = "" if digest is None else digest.hex()
                return Flaw(OTHERS, text, found, stated.digest.hex()).at(stated.record)
            self._digests = {count: each for count, each in self._digests.items() if count >= stated.passed}
        return None


class FrameAudit:
    """Follows a log and the frames that lie beside it, in step. `entries` are (UTC us, frame) as they were kept.

    `count` is how many frames of ours were commands, `begun` whether the log has any that was sent.
    `DamagedTlog` or the like passes through from `entries`.
    """

    def __init__(self, entries: Iterator[tuple[int, bytes]]) -> None:
        self.count = 0
        self._entries = enumerate(entries)
        self._next: _Entry | None = None
        self._over = False
        self._basis: Basis | None = None
        self._autopilots: dict[int, int] = {}  # of each system that has one
        self._kinds: dict[int, tuple[int, int]] = {}  # and its MAV_TYPE with that
        self._homes: dict[int, HomeHeights] = {}
        self._flying: dict[int, bool] = {}  # armed, as its last heartbeat said,
        self._aloft: dict[int, bool] = {}  # or not on the ground
        self._types: dict[int, float] = {}  # FENCE_TYPE
        self._listed: tuple[Listed, ...] = ()  # the parameters that may be written
        self._running: _Running | None = None
        self._latest: _Running | None = None  # what was dispatched last, whether it runs or not,
        self._left: _Suspect | None = None  # and the first frame that carries it out
        self.begun = False
        self._changed_us = -1  # when the last record was made,
        self._before = _Allowed()  # and what was allowed until that moment, or since then until a later record of it
        self._record = 0
        self._suspect: _Suspect | None = None
        self._finding: Finding | None = None
        self._passed = _Passed()

    def begin(self, basis: Basis) -> None:
        """The log was found to rest on this."""
        self._basis = basis

    def happened(self, record: Effect, listed: tuple[Listed, ...] = ()) -> None:
        """Takes note of an effect, in the order of the log, once it is known to be sound. `listed` are the parameters
        that may be written from it on.
        """
        if self._finding is not None:
            return
        self._until(record.utc_us)
        before = self._allowed()
        self._before = before.or_as(self._before) if record.utc_us == self._changed_us else before
        self._changed_us = record.utc_us
        self._listed = listed
        running = self._running
        if is_withdrawn(record):
            self._withdrawn(record)
        elif record.event == DISPATCHED:
            self._dispatched(record)
        elif running is not None and record.token == running.token:
            self._running = None
        self._record = record.seq

    def stated(self, count: int, digest: bytes, record: Effect, *, final: bool) -> None:
        """Takes note of what the boundary signed: so many commands passed its gate, of this digest."""
        if self._finding is None:
            self._finding = self._passed.stated(_Stated(count, digest, record.seq), final=final)

    def over(self) -> Finding | None:
        """The first frame that should not be, once the log is over."""
        if self._finding is None:
            self._until(None)
            if self._suspect is not None:
                self._finding = _unrecorded(self._suspect)
        if self._finding is None:
            self._finding = self._passed.over()
        return self._finding

    def _allowed(self, at_us: int | None = None) -> _Allowed:
        """What may be sent now; with the moment of a frame, also what might be until that very moment."""
        now = _Allowed(() if self._running is None else self._running.targets, self._listed, not self.begun)
        return now.or_as(self._before) if at_us == self._changed_us else now

    def _withdrawn(self, record: Effect) -> None:
        """Nothing was sent of it, says the record; what would be, from this moment on, is not allowed."""
        self._before = _Allowed()
        if self._left is not None:
            text = "a frame carries out a step of which the log says that nothing was sent"
            self._finding = Flaw("frames/was-sent", text, _found(self._left)).at(record.seq)

    def _dispatched(self, record: Effect) -> None:
        targets = self._targets(record)
        suspect = self._suspect
        if suspect is not None:
            early = self._any(suspect.frame, targets)
            self._finding = _early(suspect, record.utc_us, record.seq) if early else _unrecorded(suspect)
        self._running = _Running(targets, record.token, record.utc_us, record.seq, self._before.targets)
        self._latest, self._left = self._running, None
        self.begun = True

    def _targets(self, record: Effect) -> tuple[MotionTarget, ...]:
        """What the dispatch may have the vehicle do; several only for degrade rules, of which the record names none."""
        assert self._basis is not None
        policy, invocations = self._basis.policy.policy, self._basis.invocations
        links = policy.contingency
        if record.kind != CONTINGENCY_LINK:
            if not 0 <= record.step < len(invocations):
                return ()
            invocation = invocations[record.step].invocation
            if record.kind == STEP:
                return (target_of_step(invocation, policy),) if invocation.contract.name == record.detail else ()
            links = invocation.contract.fallback
        if record.link == DEGRADE:
            chosen = [rule.target for rule in policy.rules if rule.target is not None]
        else:
            chosen = list(links[record.link : record.link + 1]) if record.link >= 0 else []
        return tuple(
            target_of_link(link, policy) for link in chosen if policy.contracts[link.skill].name == record.detail
        )

    def _until(self, utc_us: int | None) -> None:
        """Judges the frames before a moment; all that are left, if there is none."""
        while True:
            entry = self._next or self._take()
            if entry is None:
                return
            if utc_us is not None and entry.at_us >= utc_us:
                self._next = entry
                return
            self._next = None
            self._judge(entry)

    def _take(self) -> _Entry | None:
        found = None if self._over else next(self._entries, None)
        self._over = found is None
        return None if found is None else _Entry(found[0], *found[1])

    def _judge(self, entry: _Entry) -> None:
        frame = read_frame(entry.octets)
        if frame is None:
            return  # nothing that an autopilot would take for a frame
        if frame.component == enums.MAV_COMP_ID_AUTOPILOT1:
            self._heard(frame)
        if frame.component != OURS or (self._autopilots and frame.system not in self._autopilots):
            return
        what = nature(frame)
        if what is FrameNature.HARMLESS:
            return
        allowed = self._allowed(entry.at_us)
        if what is FrameNature.FENCE and allowed.fence:
            return
        if what is FrameNature.SETTING:
            self._set(frame, entry, allowed)
            return
        self.count += 1
        self._finding = self._finding or self._passed.frame(unsigned(entry.octets))
        if self._suspect is not None or self._finding is not None:
            return
        running = self._running
        suspect = _Suspect(frame, entry.number, entry.at_us, self._record, running is not None)
        if not self._any(frame, allowed.targets):
            self._suspect = suspect
        elif running is not None and entry.at_us < running.since_us:  # frames do not stand in the order of their times
            self._finding = _early(suspect, running.since_us, running.record)
        elif self._left is None and self._carries_out_the_latest(frame, entry.at_us):
            self._left = suspect

    def _carries_out_the_latest(self, frame: AuditedFrame, at_us: int) -> bool:
        """Whether a frame is part of what was dispatched last, and of nothing that was allowed until that moment."""
        latest = self._latest
        if latest is None or not self._any(frame, latest.targets):
            return False
        return at_us > latest.since_us or (at_us == latest.since_us and not self._any(frame, latest.before))

    def _set(self, frame: AuditedFrame, entry: _Entry, allowed: _Allowed) -> None:
        """Judges a write of a parameter: it is listed, and the vehicle stands; or it switches a fence on, before."""
        parameter, value = parameter_write(frame, self._autopilots.get(frame.system, 0))
        is_listed = any((each.name, bits_of(each.value)) == (parameter, bits_of(value)) for each in allowed.listed)
        if not is_listed and allowed.fence and switches_fence_on(parameter, value, self._types.get(frame.system)):
            return
        self.count += 1
        if self._suspect is not None or self._finding is not None:
            return
        found = f"{parameter} {value:g} at {entry.at_us} us, frame {entry.number}"
        if not is_listed:
            text = "a parameter was set that no record lists, or not with this value"
            self._finding = Flaw("frames/unlisted-parameter", text, found).at(self._record)
        elif self._flying.get(frame.system) or self._aloft.get(frame.system):
            text = "a parameter was set of a vehicle that was armed, or not on the ground"
            self._finding = Flaw("frames/parameter-in-flight", text, found).at(self._record)

    def _heard(self, frame: AuditedFrame) -> None:
        """The first heartbeat in a system settles what its autopilot is; its positions tell how high home lies, other
        messages whether it flies, and what its fence is.
        """
        fields, system = frame.fields, frame.system
        if frame.message == HEARTBEAT and fields:
            kind, autopilot = _identity(fields)
            if is_vehicle(kind, autopilot):
                self._kinds.setdefault(system, (kind, autopilot))
                self._autopilots.setdefault(system, autopilot)
            if self._kinds.get(system) == (kind, autopilot):
                self._flying[system] = bool(_base_mode(fields) & enums.MAV_MODE_FLAG_SAFETY_ARMED)
        elif frame.message == EXTENDED_SYS_STATE and fields:
            self._aloft[system] = _landed(fields) != enums.MAV_LANDED_STATE_ON_GROUND
        elif frame.message == PARAM_VALUE and fields:
            name, value = parameter_write(frame, self._autopilots.get(system, 0))
            if name == "FENCE_TYPE":
                self._types[system] = value if isfinite(value) else 0.0
        elif frame.message == GLOBAL_POSITION_INT and system in self._autopilots and fields:
            above_sea, above_home = _heights(fields)
            height = above_sea - above_home  # mm
            home = self._homes.get(system, HomeHeights(height, height))
            self._homes[system] = HomeHeights(min(home.low, height), max(home.high, height))

    def _any(self, frame: AuditedFrame, targets: tuple[MotionTarget, ...]) -> bool:
        autopilot, home = self._autopilots.get(frame.system, 0), self._homes.get(frame.system)
        return any(is_part_of(frame, target, autopilot, home) for target in targets)


def _early(suspect: _Suspect, utc_us: int, record: int) -> Finding:
    text = "a command was sent before the record that permits it"
    return Flaw("frames/early", text, _found(suspect), f"after {utc_us} us").at(record)


def _unrecorded(suspect: _Suspect) -> Finding:
    if suspect.running:
        text = "a command was sent that is no part of what the record before it permits"
        return Flaw("frames/other-command", text, _found(suspect)).at(suspect.record)
    text = "a command was sent while no record permits any"
    return Flaw("frames/unrecorded", text, _found(suspect)).at(suspect.record)


def _found(suspect: _Suspect) -> str:
    return f"{frame_words(suspect.frame)} at {suspect.at_us} us, frame {suspect.number}"
