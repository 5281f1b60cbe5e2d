"""Checks evidence before effect with the raw frames: each frame that we sent follows a record that permits it.

A frame is ours if the companion component sent it in a system with a known autopilot, or in any system while no
autopilot is known. Anyone on the link can send a heartbeat, so a heartbeat proves nothing: frames of another companion
on the same link, in another vehicle's system, count as ours too. Every frame that is not harmless must be part of a
command (`frame_meaning`) that was dispatched before it and has not ended. A frame that sets a parameter needs an
earlier record that lists the parameter with this value, and the vehicle must be on the ground. Frames of other senders
on the link are not checked.

If the boundary signs its own evidence, the commands must be exactly those that passed its gate, in this order
(`wire.boundary_chain`): each statement has their number and digest.

Frames and records carry UTC from one clock that never goes back, so their order is exact. Frames and records of the
same microsecond have no order: such a frame may belong to either side of the record.

Memory is constant: for each of the 255 systems its autopilot and the height of its home.
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
    begins_payload,
    ends_payload,
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

#: the component id of our frames
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
    """The first frame that no record permits. `record` is the last record before it."""

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
    """The frames that may be sent, in addition to harmless ones: parts of `targets`, `listed` parameters, a `fence`."""

    targets: tuple[MotionTarget, ...] = ()
    listed: tuple[Listed, ...] = ()
    fence: bool = False

    def or_as(self, other: "_Allowed") -> "_Allowed":
        """Return what at least one of both allows."""
        more = tuple(each for each in other.targets if each not in self.targets)
        listed = {*self.listed, *other.listed}
        return _Allowed((*self.targets, *more), tuple(listed), self.fence or other.fence)


class _Stated(NamedTuple):
    """The number of frames that passed the gate and their digest, according to a record."""

    passed: int
    digest: bytes
    record: int


#: the slug of frames that differ from those that passed the boundary's gate
OTHERS: Final = "boundary/frames"


class _Passed:
    """Compares the commands among the frames with the boundary's statements. Memory is bounded by an epoch."""

    def __init__(self) -> None:
        self._count = 0
        self._digests = {0: START}  # by the number of commands, since the last statement
        self._awaited: list[_Stated] = []  # statements with frames that were not read yet
        self._last: _Stated | None = None
        self._final = False

    def frame(self, octets: bytes) -> Finding | None:
        """Add a command."""
        digest = after_frame(self._digests[self._count], octets)
        self._count += 1
        if self._last is not None:
            self._digests[self._count] = digest
            return self._compared()
        self._digests = {self._count: digest}
        return None

    def stated(self, stated: _Stated, *, final: bool) -> Finding | None:
        """Add a statement of the boundary."""
        self._last, self._final = stated, final
        self._awaited.append(stated)
        return self._compared()

    def over(self) -> Finding | None:
        """Return the finding about missing or additional commands after the last frame, or None."""
        if self._awaited:
            text = f"{self._awaited[0].passed - self._count} frames that passed the boundary's gate are missing"
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
                text = "the commands among the frames are not those that passed the boundary's gate"
                found = "" if digest is None else digest.hex()
                return Flaw(OTHERS, text, found, stated.digest.hex()).at(stated.record)
            self._digests = {count: each for count, each in self._digests.items() if count >= stated.passed}
        return None


class FrameAudit:
    """Checks the frames beside a log, in parallel with its records. `entries` are pairs of UTC in us and frame.

    `count` is the number of our frames that were commands, `begun` whether the log has a dispatch. Exceptions of
    `entries`, such as `DamagedTlog`, pass through.
    """

    def __init__(self, entries: Iterator[tuple[int, bytes]]) -> None:
        self.count = 0
        self._entries = enumerate(entries)
        self._next: _Entry | None = None
        self._over = False
        self._basis: Basis | None = None
        # by system
        self._autopilots: dict[int, int] = {}
        self._kinds: dict[int, tuple[int, int]] = {}  # MAV_TYPE and autopilot
        self._homes: dict[int, HomeHeights] = {}
        self._flying: dict[int, bool] = {}  # armed, according to its last heartbeat
        self._aloft: dict[int, bool] = {}  # not on the ground
        self._types: dict[int, float] = {}  # FENCE_TYPE
        self._listed: tuple[Listed, ...] = ()  # the parameters that may be written
        self._running: _Running | None = None
        self._latest: _Running | None = None  # the last dispatch, running or not
        self._left: _Suspect | None = None  # the first frame that is part of it
        self._owed: set[tuple[int, int]] = set()  # what ends what was begun: command and component
        self.begun = False
        self._changed_us = -1  # the time of the last record
        self._before = _Allowed()  # what was allowed before the records of that time
        self._record = 0
        self._suspect: _Suspect | None = None
        self._finding: Finding | None = None
        self._passed = _Passed()

    def begin(self, basis: Basis) -> None:
        """Set the basis of the log, once it is known."""
        self._basis = basis

    def happened(self, record: Effect, listed: tuple[Listed, ...] = ()) -> None:
        """Add an effect, in the order of the log, after it was checked. `listed` are the parameters that may be written
        from then on.
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
        """Add a statement of the boundary: the number of commands that passed its gate, and their digest."""
        if self._finding is None:
            self._finding = self._passed.stated(_Stated(count, digest, record.seq), final=final)

    def over(self) -> Finding | None:
        """Return the finding about the first frame that is not permitted, or None. Call it after the last record."""
        if self._finding is None:
            self._until(None)
            if self._suspect is not None:
                self._finding = _unrecorded(self._suspect)
        if self._finding is None:
            self._finding = self._passed.over()
        return self._finding

    def _allowed(self, at_us: int | None = None) -> _Allowed:
        """Return what may be sent now; for a frame in the microsecond of the last record, also what might be before."""
        now = _Allowed(() if self._running is None else self._running.targets, self._listed, not self.begun)
        return now.or_as(self._before) if at_us == self._changed_us else now

    def _withdrawn(self, record: Effect) -> None:
        """A step was withdrawn: no frame of it may come before or after this record."""
        self._before = _Allowed()
        if self._left is not None:
            text = "a frame belongs to a step that the log records as not sent"
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
        """The motions that a dispatch allows; several for a degrade rule, because the record does not name the rule."""
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
        """Check the frames before a time, or all remaining ones."""
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
            return  # an autopilot ignores it
        if frame.component == enums.MAV_COMP_ID_AUTOPILOT1:
            self._heard(frame)
        if frame.component != OURS or (self._autopilots and frame.system not in self._autopilots):
            return
        kind = nature(frame)
        if kind is FrameNature.HARMLESS:
            return
        allowed = self._allowed(entry.at_us)
        if kind is FrameNature.SETTING:
            self._judge_setting(frame, entry, allowed)
        elif kind is FrameNature.COMMAND or not allowed.fence:
            self._judge_command(frame, entry, allowed)

    def _judge_command(self, frame: AuditedFrame, entry: _Entry, allowed: _Allowed) -> None:
        """Check a command: it is part of what is allowed, and does not precede its record."""
        self.count += 1
        self._finding = self._finding or self._passed.frame(unsigned(entry.octets))
        if self._suspect is not None or self._finding is not None:
            return
        running = self._running
        suspect = _Suspect(frame, entry.number, entry.at_us, self._record, running is not None)
        ends = ends_payload(frame)
        if not self._any(frame, allowed.targets) and (ends is None or ends not in self._owed):
            self._suspect = suspect
        elif running is not None and entry.at_us < running.since_us:  # frames are not sorted by time
            self._finding = _early(suspect, running.since_us, running.record)
        elif self._left is None and self._is_part_of_latest(frame, entry.at_us):
            self._left = suspect
        begins = begins_payload(frame)
        if begins is not None:
            self._owed.add(begins)

    def _is_part_of_latest(self, frame: AuditedFrame, at_us: int) -> bool:
        """Whether a frame is part of the last dispatch, and not of what was allowed before it."""
        latest = self._latest
        if latest is None or not self._any(frame, latest.targets):
            return False
        return at_us > latest.since_us or (at_us == latest.since_us and not self._any(frame, latest.before))

    def _judge_setting(self, frame: AuditedFrame, entry: _Entry, allowed: _Allowed) -> None:
        """Check a parameter write: it is listed and the vehicle is on the ground, or it switches the fence on."""
        parameter, value = parameter_write(frame, self._autopilots.get(frame.system, 0))
        is_listed = any((each.name, bits_of(each.value)) == (parameter, bits_of(value)) for each in allowed.listed)
        if not is_listed and allowed.fence and switches_fence_on(parameter, value, self._types.get(frame.system)):
            return
        self.count += 1
        if self._suspect is not None or self._finding is not None:
            return
        found = f"{parameter} {value:g} at {entry.at_us} us, frame {entry.number}"
        if not is_listed:
            text = "a parameter was set, but no record lists it with this value"
            self._finding = Flaw("frames/unlisted-parameter", text, found).at(self._record)
        elif self._flying.get(frame.system) or self._aloft.get(frame.system):
            text = "a parameter was set while the vehicle was armed or not on the ground"
            self._finding = Flaw("frames/parameter-in-flight", text, found).at(self._record)

    def _heard(self, frame: AuditedFrame) -> None:
        """Read a message of an autopilot: its kind (from its first heartbeat), state, fence and height of home."""
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
        text = "a command was sent that is not part of what the preceding record permits"
        return Flaw("frames/other-command", text, _found(suspect)).at(suspect.record)
    text = "a command was sent while no record permitted any"
    return Flaw("frames/unrecorded", text, _found(suspect)).at(suspect.record)


def _found(suspect: _Suspect) -> str:
    return f"{frame_words(suspect.frame)} at {suspect.at_us} us, frame {suspect.number}"
