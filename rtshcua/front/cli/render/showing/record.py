"""One record of a log in words: what it is, what was asked, what decided, from what, and how firmly it stands."""

from base64 import b64decode
from contextlib import suppress

import msgspec

from rtshcua.app.documents import claimed
from rtshcua.app.fly.simulated_flight import SIMULATED
from rtshcua.app.telling import prose
from rtshcua.app.telling.people import NOBODY, People
from rtshcua.app.telling.record_prose import Names, detail_of
from rtshcua.app.wording import true_to, utc
from rtshcua.evidence.records import AnyRecord, Close, DecisionRecord, Effect, Genesis, Recover, Sealing, Signed
from rtshcua.evidence.report import LogReport, LogVerdict
from rtshcua.front.cli.render.showing.page import TextPage
from rtshcua.model.durability import SYNCED
from rtshcua.model.durability import WORDS as DURABILITIES
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import ENUMERATION, POSITION, Signal
from rtshcua.model.step_number import number_of
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP, Ref
from rtshcua.wire.untrusted import Untrusted

_ASKED = {STEP: "to begin a step", FALLBACK_LINK: "to fall back", CONTINGENCY_LINK: "to fly the contingency"}
_MEANS = (
    "lost if the process dies", "survives the end of the process", "on the disk within {} ms",
    "on the disk before the permitted command was sent",
)  # fmt: skip


class Told:
    """Receives the records of a log in order, and keeps the few that explain record `number`."""

    def __init__(self, number: int) -> None:
        self.record: AnyRecord | None = None
        self.genesis: Genesis | None = None
        self.signed_by: Signed | None = None  # the signed record that names the key of the next
        self.sealed_by: Sealing | None = None  # the first that signs for the record
        self.permit: DecisionRecord | None = None  # what permitted a command
        self.sent: Effect | None = None  # the command that a decision permitted
        self.what = ""
        self.simulated = ""  # what the log says of a vehicle that was
        self._number = number
        self._names = Names(None)
        self.people = NOBODY
        self._allowed: dict[Ref, DecisionRecord] = {}

    def take(self, record: AnyRecord) -> None:
        """Takes the next record."""
        if isinstance(record, Genesis):
            self.genesis, self._names = record, Names.of(record)
            self.people = self._names.people
        self._names.follow(record)
        if record.seq == self._number:
            self.record, self.what = record, self._names.tell(record)
            if isinstance(record, Effect):
                self.permit = self._allowed.get(record.ref)
        if isinstance(record, DecisionRecord) and record.outcome == "allow" and record.seq < self._number:
            self._allowed[record.ref] = record
        if isinstance(record, Effect):
            self._follow(record)
        elif not isinstance(record, DecisionRecord):
            self._signed(record)

    def _follow(self, record: Effect) -> None:
        asked = self.record
        if record.event == SIMULATED:
            self.simulated = record.detail
        if self.sent is not None or not isinstance(asked, DecisionRecord) or record.event != "dispatched":
            return
        if asked.ref == record.ref:
            self.sent = record

    def _signed(self, record: Genesis | Sealing) -> None:
        if record.seq < self._number or isinstance(record, Genesis):
            self.signed_by = record
        elif self.sealed_by is None:
            self.sealed_by = record


def show_record(page: TextPage, told: Told, report: LogReport) -> dict[str, object]:
    """Add the record to the page, and return it as JSON."""
    record, genesis = told.record, told.genesis
    assert record is not None
    assert genesis is not None
    page.head(f"Record {record.seq}: {told.what.strip(' ·')}")
    page.row("type", record.type)
    ago = f"{(record.at_us - genesis.at_us) / 1_000_000:.3f} s after the log began"
    page.row("when", f"{utc(record.utc_us)}, {true_to(record.utc_error_us)}; {ago}")
    if told.simulated:
        page.row("times", f"those of {told.simulated}")
    if isinstance(record, DecisionRecord):
        _decision(page, record, told, genesis)
    elif isinstance(record, Effect):
        _effect(page, record, told)
    elif isinstance(record, Recover):
        page.row("discarded", f"{record.discarded_bytes} bytes of SHA-256 {record.discarded_digest}")
    elif isinstance(record, Close):
        page.row("ending", record.ending)
    page.head("How firmly it stands")
    firm = _firmness(told, report)
    for name, text in firm.items():
        page.row(name, text)
    fields: dict[str, object] = msgspec.to_builtins(record)
    return {
        "record": {name: value for name, value in fields.items() if name not in ("bundle", "root")},
        "what": told.what.strip(" ·"),
        "step_number": number_of(record.step)
        if isinstance(record, DecisionRecord | Effect) and record.step >= 0
        else None,
        "permitted_by": None if told.permit is None else told.permit.seq,
        "sent_by": None if told.sent is None else told.sent.seq,
        "sealed_by": None if told.sealed_by is None else told.sealed_by.seq,
        "anchored": record.seq < report.anchored,
        **{name: text for name, text in firm.items() if name == "durability"},
    }


def _decision(page: TextPage, record: DecisionRecord, told: Told, genesis: Genesis) -> None:
    of = f", for invocation {record.invocation}" if record.invocation else ""
    page.row("asked", f"{_ASKED.get(record.kind, 'something')}{of}")
    page.row("decided", f"{record.outcome}: {record.reason}, at step {record.rule_step} of the rules")
    if record.clause is not None:
        page.row("by", f"`{' '.join(record.clause.split())}`")
    if record.target is not None:
        page.row("instead", record.target)
    if record.outcome == "allow":
        page.row("good for", f"{(record.valid_until_us - record.at_us) / 1_000:g} ms")
        page.row("sent", "never" if told.sent is None else f"by record {told.sent.seq}")
    given = record.context
    page.head("What it read")
    page.rows("state", _state(record, genesis))
    used = "used before" if given.consumed else "not used before"
    page.row("context", f"policy version {given.policy_version}, phase {given.phase}, id {used}, mode {record.mode}")
    left = f"at most {given.remaining_us / 1_000:g} ms until it is sent"
    page.row("timing", f"released {max(record.at_us - given.released_us, 0) / 1_000:g} ms before, {left}")
    if given.approvals:
        page.row(
            "approvals", ", ".join(_given(granted, person, told.people) for _, _, granted, _, person in given.approvals)
        )


def _given(granted: int, person: int, people: People) -> str:
    by = people.by_number.get(person)
    return f"{'granted' if granted else 'refused'}{f' by {by}' if by else ''}"


def _state(record: DecisionRecord, genesis: Genesis) -> list[str]:
    state = record.state
    slots = list(zip(state.values, state.ages, strict=False))
    with suppress(Untrusted, ValueError):
        policy = claimed(b64decode(genesis.bundle)).policy
        if policy.slots == len(slots):
            return [_signal(policy, signal, record) for signal in policy.signals]
    return [f"slot {number} = {_number(value)}, {_age(age_us)}" for number, (value, age_us) in enumerate(slots)]


def _signal(policy: Policy, signal: Signal, record: DecisionRecord) -> str:
    value, other = record.state.values[signal.slot], record.state.values[signal.slot + (signal.kind == POSITION)]
    if value is None or other is None:
        known = "unknown"
    elif signal.kind == POSITION:
        known = prose.place(policy, value, other)
    elif signal.kind == ENUMERATION:
        known = dict(signal.labels).get(value, str(value))
    else:
        known = prose.quantity(value, signal.dimension)
    return f"{signal.name} = {known}, {_age(record.state.ages[signal.slot])}"


def _number(value: int | None) -> str:
    return "unknown" if value is None else str(value)


def _age(age_us: int) -> str:
    return f"{age_us / 1_000:g} ms old"


def _effect(page: TextPage, record: Effect, told: Told) -> None:
    page.row("event", record.event)
    if record.detail:
        page.row("says", detail_of(record.event, record.detail, told.people))
    if record.event == "dispatched":
        page.row("permitted", "by a standing permit" if told.permit is None else f"by record {told.permit.seq}")


def _firmness(told: Told, report: LogReport) -> dict[str, str]:
    record, sealed, genesis = told.record, told.sealed_by, told.genesis
    assert record is not None
    assert genesis is not None
    found = {"verified": _verified(report)}
    if isinstance(record, DecisionRecord | Effect):
        word = DURABILITIES[record.durability].replace("_", " ")
        meaning = _MEANS[record.durability]
        text = meaning.format(f"{genesis.sync_us / 1_000:g}") if record.durability == SYNCED else meaning
        found["durability"] = f"{record.durability} ({word}): {text}"
    else:
        found["durability"] = "signed records are on the disk before the run continues"
    if isinstance(record, Genesis):
        found["signed by"] = f"log key {record.log_kid}"
    elif sealed is None:
        found["signed by"] = "nobody: the log ends before its epoch was sealed, and anyone could have written it"
    else:
        by = "itself" if sealed is record else f"record {sealed.seq}, which seals epoch {sealed.epoch}"
        found["signed by"] = f"{by}, with {_key(told, genesis, sealed)}"
    found["anchored"] = _outside(record.seq, report)
    return found


def _outside(number: int, report: LogReport) -> str:
    if number < report.anchored:
        return "yes: witnesses outside saw it"
    outside = report.outside
    saw = 0 if outside is None else sum(seen.size >= number for seen in outside.witnessed)
    if outside is None or not saw:
        return "no: no witness cosigned it"
    return f"no: cosigned by {saw} of {outside.threshold} required witnesses"


def _key(told: Told, genesis: Genesis, sealed: Sealing) -> str:
    before = told.signed_by
    if isinstance(sealed, Recover) or before is None or isinstance(before, Close):
        return f"log key {genesis.log_kid}"
    return f"epoch key {before.next_key}, which record {before.seq} names"


def _verified(report: LogReport) -> str:
    finding = report.failure or report.shortfall
    if finding is None:
        return "yes: the log is complete and signed to its end"
    if report.verdict is LogVerdict.INCOMPLETE:
        return f"as far as it goes: the log is incomplete, {finding.text}"
    return f"NO, the log fails at record {finding.record}, {finding.slug}: {finding.text}"
