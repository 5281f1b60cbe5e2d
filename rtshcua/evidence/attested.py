"""Compares the boundary's own evidence with the records: each decision, document and dispatch in the log must be an
entry of the boundary, in the same order, and no entry may be missing (docs/log-format.md, section 7).

The digests of `wire.boundary_chain` are recomputed from the records. The boundary's statements, signed by a key
that the runtime need not have, contain the number of entries and mark each entry. The first record that the
boundary did not make is therefore found even if the log key is in the wrong hands. Without a boundary key in the
trust root nothing is checked.
"""

import re
from collections.abc import Callable
from hashlib import sha256
from struct import error as struct_error
from typing import Final, NamedTuple

from rtshcua.evidence.finding import Claim, Finding, Flaw
from rtshcua.evidence.gaps import STALLED, seconds
from rtshcua.evidence.log_writer import ATTESTED, BOUNDARY, BOUNDARY_LOST
from rtshcua.evidence.note import octets
from rtshcua.evidence.records import AnyRecord, Close, DecisionRecord, Effect, Genesis, Recover, Seal
from rtshcua.evidence.recovery import RECOVERED
from rtshcua.mavlink.parameters import bits_of
from rtshcua.model.flat.limits import MAX_MONITORS, MAX_SLOTS
from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now, State
from rtshcua.model.outcome import WIRE_REASONS, Outcome
from rtshcua.wire import boundary_chain, receipt, request, statement
from rtshcua.wire.attestation import DebugState, HomeAttestation, open_attestation
from rtshcua.wire.boundary_chain import MARK_BYTES, MOST_MARKS, Tag
from rtshcua.wire.clock import APART_US, DRIFT_US, ClockSource, bears_out
from rtshcua.wire.digest import DIGEST_BYTES
from rtshcua.wire.keys import Duty
from rtshcua.wire.preparation import MOST, ParameterWrite
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, Request
from rtshcua.wire.response import Status
from rtshcua.wire.statement import Statement, counted
from rtshcua.wire.trust import TrustRoot, key_refusal
from rtshcua.wire.untrusted import Untrusted

UNENFORCED: Final = "none"
_REASONS: Final = {reason.value: number for number, reason in enumerate(WIRE_REASONS)}
_OUTCOMES: Final = {outcome.name.lower(): int(outcome) for outcome in Outcome}
_STATUSES: Final = {status.name.lower(): int(status) for status in Status if status}
_DOCUMENTS: Final = {
    "approval": receipt.APPROVAL, "recall": receipt.RECALL, "replacement": receipt.REPLACEMENT,
    "cancellation": receipt.CANCELLATION,
}  # fmt: skip
_UNDECIDED: Final = re.compile(r"([a-z_]+) ([0-9a-f]{64})")
_BINDING: Final = re.compile(rf"[0-9a-f]{{{2 * DIGEST_BYTES}}}")
_WRITES: Final = re.compile(r"(set|restore) ([^,]++(?:, [^,]++){0,99})")
_WRITE: Final = re.compile(r"([A-Z0-9_]{1,16}) from (\S+) to (\S+)", re.ASCII)
_NONE: Final = Claim(
    "boundary",
    "what the boundary itself decided and sent: the trust root has no key of duty `boundary` for this vehicle",
)

_SELF_MEASURED: Final = Claim(
    "home", "that the boundary measured its own code correctly: nothing below it vouches for that"
)

_UNATTESTED: Final = Claim("home", "which code the boundary ran: the log has no attestation of its home")
#: the modes whose boundary is part of the runtime, so that nothing attests itself
_HOMELESS: Final = frozenset({UNENFORCED, "software"})

_MOVED: Final = (
    "the boundary made no such entry here: this record was altered, invented or moved, or an earlier one was removed"
)

_DIFFERS: Final = Flaw("boundary/differs", _MOVED)
_INVENTED: Final = Flaw(
    "boundary/invented", "the boundary signed the number of its entries, and made no later entry for this record"
)
_AFTER: Final = Flaw(
    "boundary/after-loss", "the boundary was lost before this record, and so cannot have made its entry"
)

#: tag and payload of the boundary's entry for a record
Entry = tuple[Tag, bytes]


class _Pending(NamedTuple):
    """An entry that no statement covers yet: its record, the offset of that record, and the digest."""

    record: int
    offset: int
    digest: bytes


class _Claimed(NamedTuple):
    """A record's claim about the time of day: the difference of UTC and monotonic time, and the error of it."""

    record: int
    offset: int
    at_us: int
    ahead_us: int
    error_us: int

    def at(self, own: Now, since_us: int) -> Now:
        """The claim at a later moment of the boundary's clock. The errors of both clocks grow alike."""
        grown_us = max(0, own.monotonic_us - max(self.at_us, since_us)) * DRIFT_US // 1_000_000
        return Now(own.monotonic_us, own.monotonic_us + self.ahead_us, self.error_us + grown_us)


def _claimed(record: AnyRecord, offset: int) -> _Claimed | None:
    """None where the record states that the time of day is unknown."""
    if record.utc_error_us >= UTC_UNKNOWN_US:
        return None
    return _Claimed(record.seq, offset, record.at_us, record.utc_us - record.at_us, record.utc_error_us)


class BoundaryEvidence:
    """Processes the records of one log after its genesis, in order. The memory is bounded by one epoch."""

    def __init__(self, root: TrustRoot, genesis: Genesis) -> None:
        keys = root.keys_for(Duty.BOUNDARY)
        refusal = {kid: key_refusal(key, vehicle=genesis.vehicle, now_us=genesis.utc_us) for kid, key in keys.items()}
        self._keys = {kid: key for kid, key in keys.items() if refusal[kid] is None}
        #: whether the boundary's evidence is required
        self.asked = bool(self._keys)
        self._flight = bytes.fromhex(genesis.boot)
        self._enforced = genesis.mode != UNENFORCED
        self._mode = genesis.mode
        self._log_kid = genesis.log_kid
        self._home: HomeAttestation | None = None
        self._bundle = sha256(octets(genesis.bundle) or b"").digest()
        #: the boundary's chain, recomputed from the records
        self.digest = boundary_chain.START
        self._count = 0
        self._pending: list[_Pending] = []
        self._ahead: list[bytes] = []  # marks in the last statement of entries whose records are still to come
        #: the last statement
        self.last: Statement | None = None
        self._stated = False  # in this epoch
        #: the first record since the last statement that claims a known time of day
        self._claim: _Claimed | None = _claimed(genesis, 0)
        self._recovered = False
        self._lost: tuple[int, int] | None = None  # the record that says so, and its offset
        #: by the number of a gap's record, the number of the statement that shows that nothing is missing before it
        self.gaps: dict[int, int] = {}
        self._gap: tuple[int, int] | None = None  # the record of the gap, and its end

    def check(self, record: AnyRecord, offset: int) -> Finding | None:
        """The flaw that the boundary's evidence shows in the next record, which begins at this octet of the log, or
        in an earlier one; None if there is none.
        """
        if not self.asked:
            return None
        self._claim = self._claim or _claimed(record, offset)
        if self._lost is not None:
            return _AFTER.at(record.seq, offset) if _is_made(record) else None
        if isinstance(record, Effect) and record.event == BOUNDARY_LOST:
            return self._lose(record, offset)
        if isinstance(record, Effect) and record.event == BOUNDARY:
            before_us = None if self.last is None else self.last.at_us
            found = self._stated_by(record) or self._timed(record, offset, before_us)
            if found is None:
                found = self._vouched_for(record)
            self._gap = None
            return found.at(record.seq, offset) if isinstance(found, Flaw) else found
        if isinstance(record, Effect) and record.event == ATTESTED:
            flaw = self._attested(record)
            return None if flaw is None else flaw.at(record.seq, offset)
        if isinstance(record, DecisionRecord | Effect):
            if isinstance(record, Effect) and record.event == STALLED:
                self._gap = record.seq, record.at_us
            return self._entered(record, offset)
        flaw = None
        if isinstance(record, Seal | Close):
            flaw = self._sealed(record)
        if isinstance(record, Recover):
            self._recovered, self._claim = True, None  # monotonic time restarts
        self._stated, self._gap = False, None
        return None if flaw is None else flaw.at(record.seq, offset)

    def _lose(self, record: Effect, offset: int) -> Finding | None:
        """The runtime reports the loss of the boundary: no later record is made by it."""
        self._lost = record.seq, offset
        last = self.last
        if last is None:
            return _unsigned("before this").at(record.seq, offset)
        flaw = _omitted(last.count - self._count) if self._count < last.count else None
        return None if flaw is None else flaw.at(record.seq, offset)

    # -------------------------------------------------------- the log's claims

    def _entered(self, record: DecisionRecord | Effect, offset: int) -> Finding | None:
        entry = entry_of(record)
        if entry is None:
            return None
        if isinstance(entry, Flaw):
            return entry.at(record.seq, offset)
        last = self.last
        if last is None:
            return _unsigned("before this").at(record.seq, offset)
        if last.final:
            return _INVENTED.at(record.seq, offset)
        self.digest = boundary_chain.following(self.digest, *entry)
        self._count += 1
        if self._count > last.count:
            self._pending.append(_Pending(record.seq, offset, self.digest))
            return None
        mark = self._ahead.pop(0) if self._ahead else self.digest[:MARK_BYTES]
        if self.digest[:MARK_BYTES] == mark and (self._count < last.count or self.digest == last.digest):
            return None
        return _DIFFERS.at(record.seq, offset)

    # -------------------------------------------------------- the boundary's signatures

    def _attested(self, record: Effect) -> Flaw | None:
        """Hold what the boundary's home attests of itself against the flight, the mode and the evidence so far."""
        try:
            home = open_attestation(octets(record.detail) or b"", self._keys)
        except Untrusted as error:
            return Flaw(f"attested/{error.slug}", f"the attestation of the boundary's home is not trusted: {error}")
        if self._home is not None:
            return Flaw("attested/again", "the boundary's home attests itself once per flight")
        if home.flight != self._flight:
            text = "the boundary's home attested this in another flight"
            return Flaw("attested/other-flight", text, home.flight.hex(), self._flight.hex())
        if home.mode != self._mode:
            text = "the boundary's home attested another mode than the log states"
            return Flaw("attested/other-mode", text, home.mode, self._mode)
        if home.evidence != self.digest:
            text = "the boundary's home attested this at another point of its evidence"
            return Flaw("attested/moved", text, home.evidence.hex(), self.digest.hex())
        if home.log_kid and home.log_kid.hex() != self._log_kid:
            text = "the boundary's home attested that it has another log key than the one that signed this log"
            return Flaw("attested/other-log-key", text, home.log_kid.hex(), self._log_kid)
        self._home = home
        return None

    def _stated_by(self, record: Effect) -> Finding | Flaw | None:
        try:
            said = statement.open_statement(octets(record.detail) or b"", self._keys)
        except Untrusted as error:
            return Flaw(f"boundary/{error.slug}", f"the boundary's signed statement is not trusted: {error}")
        return self._out_of_place(said) or self._marked(said)

    def _out_of_place(self, said: Statement) -> Flaw | None:
        if said.flight != self._flight:
            text = "the boundary signed this statement in another flight"
            return Flaw("boundary/other-flight", text, said.flight.hex(), self._flight.hex())
        last = self.last
        if last is None:
            payload = boundary_chain.begin(
                said.session, said.before, self._flight, self._bundle, enforced=self._enforced
            )
            self.digest, self._count = boundary_chain.following(boundary_chain.START, Tag.BEGIN, payload), 1
            if said.marks[:MARK_BYTES] == self.digest[:MARK_BYTES]:
                return None
            return Flaw("boundary/beginning", "the boundary's session did not begin with this flight, bundle and mode")
        if (said.session, said.before) != (last.session, last.before):
            text = "the boundary signed this statement in another session"
            return Flaw("boundary/other-session", text, str(said.session), str(last.session))
        if (
            last.final
            or said.count < last.count
            or any(now < then for now, then in zip(counted(said), counted(last), strict=True))
        ):
            text = "the statement is older than the previous one, or follows the final one"
            return Flaw("boundary/replayed", text, str(said.count), f"at least {last.count}")
        if self._count < last.count:
            return _omitted(last.count - self._count)
        return None

    def _marked(self, said: Statement) -> Finding | Flaw | None:
        """Compare the entries since the last statement with this one."""
        before = 0 if self.last is None else self.last.count
        new = said.count - before
        marks = [said.marks[at : at + MARK_BYTES] for at in range(0, len(said.marks), MARK_BYTES)]
        if len(marks) != min(new, MOST_MARKS):
            text = (
                "the statement does not mark each entry since the previous one: an entry was removed, or "
                "the statement is older"
            )
            return Flaw("boundary/missing", text)
        if self.last is None:
            marks, new = marks[1:], new - 1
        pending, self._pending = self._pending, []
        self.last, self._stated = said, True
        for number, entry in enumerate(pending):
            if number >= new:
                return _INVENTED.at(entry.record, entry.offset)
            if number < len(marks) and entry.digest[:MARK_BYTES] != marks[number]:
                return _DIFFERS.at(entry.record, entry.offset)
        self._ahead = marks[len(pending) :]
        if self._count == said.count and self.digest != said.digest:
            text = "the preceding records do not match what the boundary signed"
            return Flaw("boundary/differs", text, self.digest.hex(), said.digest.hex())
        return None

    def _timed(self, record: Effect, offset: int, before_us: int | None) -> Finding | None:
        """Compare the time of day that the records claim since the last statement, which was made at a monotonic
        time, with the boundary's own clock.
        """
        assert self.last is not None
        own, claims = self.last.now, (self._claim, _claimed(record, offset))
        self._claim = None
        since_us = own.monotonic_us if before_us is None else before_us
        for claim in claims:
            # a boundary that does not know the time of day refuses every request that claims one
            if claim is not None and not bears_out(own, claim.at(own, since_us)):
                text = "the claimed time of day differs from the boundary's own clock"
                known = self.last.source != ClockSource.UNKNOWN
                expected = (
                    f"{own.utc_us} us, error {seconds(own.utc_error_us)}" if known else "none: its clock is not known"
                )
                found = f"{own.monotonic_us + claim.ahead_us} us, error {seconds(claim.error_us)}"
                return Flaw("boundary/clock", text, found, expected).at(claim.record, claim.offset)
        return None

    def _vouched_for(self, record: Effect) -> Flaw | None:
        """Check the order of gaps and statements. A holder of the log's keys could otherwise put a gap before a
        statement that is older than its end, so that the boundary would confirm a gap in which it continued to
        work.
        """
        if self._gap is None:
            return None
        assert self.last is not None
        number, ended_us = self._gap
        if self.last.at_us < ended_us - APART_US:
            text = "the boundary signed this statement before the end of the gap that precedes it"
            return Flaw("boundary/gap", text, f"at {self.last.at_us} us", f"at {ended_us} us or later")
        self.gaps[number] = record.seq
        return None

    def _sealed(self, record: Seal | Close) -> Flaw | None:
        last = self.last
        if isinstance(record, Close) and self._recovered and record.ending == RECOVERED:
            return None
        if last is None or not self._stated or self._pending:
            return _unsigned("at the end of this epoch")
        if isinstance(record, Seal):
            return None
        if not last.final:
            return Flaw("boundary/not-ended", "the boundary did not sign an end here: later records were removed")
        return _omitted(last.count - self._count) if self._count < last.count else None

    # -------------------------------------------------------- what that proves

    def shortfall(self) -> Finding | None:
        """Why the boundary's evidence is incomplete, in a log without a flaw."""
        if self._lost is None:
            return None
        text = (
            "the runtime reports that the boundary was lost in flight; only the runtime vouches for the "
            "following records"
        )
        return Flaw("boundary/lost", text).at(*self._lost)

    def claims(self) -> tuple[tuple[Claim, ...], tuple[Claim, ...]]:
        """What is proven of a log without a flaw, and what is not."""
        last = self.last
        if not self.asked:
            return (), (_NONE,)
        if last is None:
            return (), (
                Claim("boundary", "what the boundary itself decided and sent: the log ends before its statement"),
            )
        text = (
            f"session {last.session} of the boundary signed for {last.count - 1} decisions, documents "
            f"and dispatches, which are the recorded ones in this order; also {last.frames} frames "
            f"passed it and {last.stopped} were refused, {last.repeated} answers were repeated and "
            f"{last.declined} documents were refused"
        )
        proven, unproven = _of_clock(ClockSource(last.source))
        proven = (Claim("boundary", text), *proven)
        if self._home is not None:
            proven, unproven = (*proven, _of_home(self._home)), (_SELF_MEASURED, *unproven)
        elif self._mode not in _HOMELESS:
            unproven = (_UNATTESTED, *unproven)
        ahead = (*_ahead(last.ahead), *unproven)
        if last.final and self._lost is None:
            return proven, ahead
        if self._lost is not None:
            text = (
                f"what the boundary did after its last statement, and its loss at record {self._lost[0]}: "
                "only the runtime vouches that later links flew as the boundary had signed them ahead"
            )
            return proven, (Claim("boundary", text), *ahead)
        return proven, (Claim("boundary", "what the boundary did after its last statement: the log ends"), *ahead)


def _of_home(home: HomeAttestation) -> Claim:
    debugging = "enabled" if home.debug is DebugState.ENABLED else "disabled"
    text = (
        f"the boundary attested that it ran as `{home.mode}`, from the code image {home.code.hex()}, "
        f"in start {home.boots} with what it keeps, debugging {debugging}"
    )
    return Claim("home", text)


def _of_clock(source: ClockSource) -> tuple[tuple[Claim, ...], tuple[Claim, ...]]:
    """What is proven of the time of day, and what is not."""
    if source is ClockSource.SHARED:
        text = "the time of day by the boundary's own clock: the boundary used the clock of the run"
        return (), (Claim("clock", text),)
    if source is ClockSource.UNKNOWN:
        return (
            Claim("clock", "the boundary's own clock did not know the time of day, and the records claim none"),
        ), ()
    text = f"the time of day in the records agrees with the boundary's own clock, set by the {source.name.lower()}"
    return (Claim("clock", text),), ()


def _ahead(count: int) -> tuple[Claim, ...]:
    """The claim that is not proven if frames were signed ahead."""
    text = f"whether any of the {count} frames that the boundary signed ahead were sent: it cannot observe that"
    return (Claim("boundary", text),) if count else ()


def _is_made(record: AnyRecord) -> bool:
    """Whether a record is about something that only a boundary makes. Other records may exist without it: links fly
    without it, and a missing answer counts as a refusal.
    """
    if isinstance(record, DecisionRecord):
        return True
    if not isinstance(record, Effect) or record.event in ("refused", "not-permitted"):
        return False
    of_link = record.event == "dispatched" and record.kind in (FALLBACK_LINK, CONTINGENCY_LINK)
    return record.event == BOUNDARY or (record.event in _EFFECTS and not of_link)


def _unsigned(when: str) -> Flaw:
    return Flaw("boundary/missing", f"the boundary did not sign its own evidence {when}: its statement was removed")


def _omitted(count: int) -> Flaw:
    entries = "entry" if count == 1 else "entries"
    text = f"the boundary made {count} {entries} before this that no record contains: the records were removed"
    return Flaw("boundary/omitted", text)


def entry_of(record: DecisionRecord | Effect) -> Entry | Flaw | None:
    """The boundary's entry for a record; None where it had no part in it."""
    if isinstance(record, DecisionRecord):
        text = "no boundary makes such a decision: a field has an unknown value"
        return _decided(record) or Flaw("boundary/record", text)
    make = _EFFECTS.get(record.event)
    if make is None:
        return None
    text = f"a record `{record.event}` does not contain the boundary's entry"
    return make(record) or Flaw("boundary/record", text, record.detail)


def _decided(record: DecisionRecord) -> Entry | None:
    outcome, reason = _OUTCOMES.get(record.outcome), _REASONS.get(record.reason)
    state, given = record.state, record.context
    if outcome is None or reason is None or _BINDING.fullmatch(record.binding) is None:
        return None
    if len(state.values) > MAX_SLOTS or len(state.monitors) > MAX_MONITORS or len(state.ages) != len(state.values):
        return None
    now = Now(record.at_us, record.utc_us, record.utc_error_us)
    read = State(state.values, state.ages, state.monitors)
    asked = Request(
        record.kind, record.step, record.link, bytes.fromhex(record.binding), now, read, given.released_us, given.phase,
        given.remaining_us,
    )  # fmt: skip
    return _packed(
        Tag.DECIDED,
        lambda: boundary_chain.decided(
            request.encode(asked),
            outcome,
            reason,
            record.rule_step,
            record.target_link,
            record.valid_until_us,
            given.consumed,
        ),
    )


def _packed(tag: Tag, payload: Callable[[], bytes]) -> Entry | None:
    """The entry of a payload; None where a number is out of range."""
    try:
        return tag, payload()
    except struct_error:
        return None


def _undecided(record: Effect) -> Entry | None:
    said = _UNDECIDED.fullmatch(record.detail)
    status = None if said is None else _STATUSES.get(said[1])
    if said is None or status is None:
        return None
    return Tag.UNDECIDED, boundary_chain.undecided(status, bytes.fromhex(said[2]))


def _document(record: Effect) -> Entry | None:
    data = octets(record.detail)
    if data is None:
        return None
    kind, now = _DOCUMENTS[record.event], Now(record.at_us, record.utc_us, record.utc_error_us)
    return _packed(Tag.DOCUMENT, lambda: boundary_chain.document(kind, record.step, now, sha256(data).digest()))


def _sent(record: Effect) -> Entry | None:
    kind, step, link = record.ref
    return _packed(Tag.SENT, lambda: boundary_chain.sent(kind, step, link, record.token, record.at_us))


def _refused(record: Effect) -> Entry | None:
    return Tag.REFUSED, boundary_chain.refused(record.detail, record.at_us)


def _permitted(record: Effect) -> Entry | None:
    listed = _WRITES.fullmatch(record.detail)
    writes = [] if listed is None else [_write(text) for text in listed[2].split(", ")]
    found = [each for each in writes if each is not None]
    if listed is None or len(found) != len(writes) or len(found) > MOST:
        return None
    return Tag.PREPARED, boundary_chain.prepared(found, restoring=listed[1] == "restore")


def _write(text: str) -> ParameterWrite | None:
    said = _WRITE.fullmatch(text)
    if said is None:
        return None
    try:
        before, value = bits_of(float(said[2])), bits_of(float(said[3]))
    except ValueError:
        return None
    return None if before is None or value is None else ParameterWrite(said[1], before, value)


def _not_permitted(record: Effect) -> Entry | None:
    return Tag.UNPREPARED, boundary_chain.unprepared(record.detail)


_EFFECTS: Final[dict[str, Callable[[Effect], Entry | None]]] = {
    **dict.fromkeys(_DOCUMENTS, _document),
    "undecided": _undecided,
    "dispatched": _sent,
    "refused": _refused,
    "permitted": _permitted,
    "not-permitted": _not_permitted,
}
