"""Threat: an attacker who controls the runtime, with the log key, every epoch key and all other keys on board except
the boundary's, rewrites the log. The forged log is consistent: numbered, linked, sealed and signed. Each forgery
is reported at the first record that the boundary did not make.
"""

from base64 import b64decode, b64encode
from typing import Any

import pytest
from msgspec.structs import replace

from reference.attested_flight import attested, second
from reference.forgery import LOG_KEY, edit, expect, prove, read, signed, sound
from rtshcua.app.logs import finding_code
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.report import LogVerdict
from rtshcua.wire import artefact, cose, names
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.statement import Statement, open_statement, sign
from virtual import case
from virtual.rows import rows

LINES = attested()
KINDS = [(read(line)["type"], read(line).get("event", "")) for line in LINES]
KEYS = {case.BOUNDARY_KEY.kid: case.BOUNDARY_KEY.verification()}


def where(event: str) -> list[int]:
    """The numbers of the records of an event, or of a type."""
    return [number for number, kind in enumerate(KINDS) if event in kind]


DECISIONS, SENT, STATEMENTS, SEALS = where("decision"), where("dispatched"), where("boundary"), where("seal")
(APPROVAL,) = where("approval")
CLOSE = len(LINES) - 1


def said(number: int) -> Statement:
    """The content of a statement."""
    return open_statement(b64decode(read(LINES[number])["detail"]), KEYS)


def stating(number: int, envelope: bytes) -> bytes:
    """A statement with another content."""
    return edit(LINES[number], detail=b64encode(envelope).decode())


def changed(number: int, line: bytes) -> list[bytes]:
    return [*LINES[:number], line, *LINES[number + 1 :]]


def without(*numbers: int) -> list[bytes]:
    return [line for number, line in enumerate(LINES) if number not in numbers]


def moment(number: int) -> dict[str, Any]:
    """The time of a record."""
    return {name: read(LINES[number])[name] for name in ("at_us", "utc_us", "utc_error_us")}


def entry_after(number: int) -> int:
    """The next record with an entry of the boundary."""
    return next(each for each in range(number + 1, CLOSE) if each in (*DECISIONS, *SENT, APPROVAL))


def test_genuine_log_verifies_with_boundary_claims() -> None:
    report = sound(LINES).report
    (claim,) = [claim for claim in report.proven if claim.slug == "boundary"]
    assert claim.text.startswith("session 1 of the boundary signed for 10 decisions, documents and dispatches")
    assert "1 were refused, 30 answers were repeated and 1 documents were refused" in claim.text
    assert "boundary" not in {claim.slug for claim in report.unproven}
    assert signed(LINES) == list(LINES)  # the attacker's tool writes the true value unchanged


# ---------------------------------------------------------------- altered


@rows("number", DECISIONS)
def test_an_outcome_is_altered(number: int) -> None:
    outcome = "deny" if read(LINES[number])["outcome"] == "allow" else "allow"
    assert expect(signed(changed(number, edit(LINES[number], outcome=outcome)))) == ("boundary/differs", number)


#: false values by the field of a decision
FIELDS: dict[str, Any] = {
    "reason": "state/violated", "rule_step": 7, "target_link": 0, "valid_until_us": 1, "step": 2, "kind": 1, "link": 0,
    "binding": "00" * 32,
}  # fmt: skip


@rows(("field", "value"), list(FIELDS.items()))
def test_a_field_of_a_decision_is_altered(field: str, value: object) -> None:
    number = DECISIONS[1]
    assert expect(signed(changed(number, edit(LINES[number], **{field: value})))) == ("boundary/differs", number)


def test_a_state_that_decides_alike_is_altered() -> None:
    """The decision derives from it unchanged, so that no other check detects it."""
    number = DECISIONS[0]
    state = read(LINES[number])["state"]
    ages = [state["ages"][0] + 1, *state["ages"][1:]]
    lie = edit(LINES[number], state=state | {"ages": ages})
    assert expect(signed(changed(number, lie))) == ("boundary/differs", number)


@rows("field", ["released_us", "phase", "remaining_us", "consumed"])
def test_a_context_is_altered(field: str) -> None:
    number = DECISIONS[0]
    context = read(LINES[number])["context"]
    lie = edit(LINES[number], context=context | {field: context[field] + 1})
    assert expect(signed(changed(number, lie))) == ("boundary/differs", number)


def test_a_dispatch_is_altered() -> None:
    number = SENT[0]
    for field in ("token", "step", "link", "kind"):
        lie = edit(LINES[number], **{field: read(LINES[number])[field] + 1})
        assert expect(signed(changed(number, lie))) == ("boundary/differs", number)


def test_decision_that_no_boundary_makes_is_rejected() -> None:
    number = DECISIONS[0]
    for lie in ({"binding": "00"}, {"reason": "of/mine"}, {"kind": -1}, {"valid_until_us": (1 << 53) - 1, "kind": 300}):
        assert expect(signed(changed(number, edit(LINES[number], **lie)))) == ("boundary/record", number)


# ---------------------------------------------------------------- left out, moved, invented


@rows("number", [*DECISIONS, *SENT[:-1], APPROVAL])
def test_a_record_is_left_out(number: int) -> None:
    after = entry_after(number)
    assert expect(signed(without(number))) == ("boundary/differs", after - 1)


def test_the_last_dispatch_is_left_out() -> None:
    statement = next(each for each in STATEMENTS if each > SENT[-1])
    slug, record = expect(signed(without(SENT[-1])))
    assert (slug, record) == ("boundary/omitted", next(each for each in STATEMENTS if each > statement) - 1)


def test_all_of_a_leg_is_left_out_with_its_effects() -> None:
    assert expect(signed(without(*range(APPROVAL, SENT[2] + 1)))) == (
        "boundary/differs", DECISIONS[-1] - (SENT[2] + 1 - APPROVAL),
    )  # fmt: skip


def test_two_records_are_exchanged() -> None:
    first, other = DECISIONS[1], DECISIONS[2]
    lines = list(LINES)
    lines[first], lines[other] = lines[other], lines[first]
    assert expect(signed(lines)) == ("boundary/differs", first)


@rows("number", [DECISIONS[0], SENT[0], APPROVAL, SENT[-1]])
def test_a_record_is_there_twice(number: int) -> None:
    twice = [*LINES[: number + 1], LINES[number], *LINES[number + 1 :]]
    slug, record = expect(signed(twice))
    assert (slug, record) in (("boundary/differs", number + 1), ("boundary/invented", number + 1))


@rows("after", [0, 1])
def test_a_decision_is_invented_at_the_end_of_an_epoch(after: int) -> None:
    place = STATEMENTS[-2] + after
    made_up = edit(LINES[DECISIONS[-1]], **moment(place))
    lines = [*LINES[:place], made_up, *LINES[place:]]
    assert expect(signed(lines)) == (("boundary/missing", place + 1) if after else ("boundary/invented", place))


def test_a_refused_permit_is_invented() -> None:
    made_up = edit(LINES[SENT[0]], event="refused", token=-1, detail="permit/late")
    lines = [*LINES[: SENT[0]], made_up, *LINES[SENT[0] :]]
    assert expect(signed(lines)) == ("boundary/differs", SENT[0])


# ---------------------------------------------------------------- statements


def test_a_refused_frame_is_denied() -> None:
    """Counters are only in the statement, so another number needs another signature."""
    number = STATEMENTS[-1]
    lie = replace(said(number), stopped=0)
    payload = artefact.pack(names.STATEMENT, lie)
    true = cose.unverified(b64decode(read(LINES[number])["detail"]))
    forged = sign(lie, SigningKey.from_seed(b"f" * 32, duty=Duty.BOUNDARY, development=True))
    assert expect(signed(changed(number, stating(number, forged)))) == ("boundary/unknown-key", number)
    kept = cose.sign1(payload, key=case.BOUNDARY_KEY, duty=Duty.BOUNDARY, content_type=names.STATEMENT.content_type)
    kept = kept[:-64] + true.signature
    assert expect(signed(changed(number, stating(number, kept)))) == ("boundary/bad-signature", number)


def test_the_log_key_signs_for_the_boundary() -> None:
    number = STATEMENTS[2]
    payload = artefact.pack(names.STATEMENT, said(number))
    forged = cose.sign1(payload, key=LOG_KEY, duty=Duty.LOG, content_type=names.STATEMENT.content_type)
    assert expect(signed(changed(number, stating(number, forged)))) == ("boundary/unknown-key", number)
    assert expect(signed(changed(number, edit(LINES[number], detail="no base64")))) == ("boundary/malformed", number)


@rows("number", STATEMENTS[1:-1])
def test_a_statement_is_left_out(number: int) -> None:
    seal = next(each for each in SEALS if each > number)
    assert expect(signed(without(number))) == ("boundary/missing", seal - 1)


def test_all_statements_are_left_out() -> None:
    assert expect(signed(without(*STATEMENTS))) == ("boundary/missing", DECISIONS[0] - 1)
    assert expect(signed(without(STATEMENTS[0]))) == ("boundary/missing", DECISIONS[0] - 1)


def test_an_older_statement_is_replayed() -> None:
    newer, older = STATEMENTS[2], STATEMENTS[1]
    replayed = edit(LINES[newer], detail=read(LINES[older])["detail"])
    assert expect(signed(changed(newer, replayed)))[0] == "boundary/missing"  # its marks are of entries before
    first = edit(LINES[newer], detail=read(LINES[STATEMENTS[0]])["detail"])
    assert expect(signed(changed(newer, first))) == ("boundary/replayed", newer)
    empty = STATEMENTS[-2]  # nothing happened in its epoch, and so it marks nothing
    idle = edit(LINES[STATEMENTS[-1]], detail=read(LINES[empty])["detail"])
    assert expect(signed(changed(STATEMENTS[-1], idle))) == ("boundary/not-ended", CLOSE)


def test_truncated_and_closed_log_is_detected() -> None:
    for seal in SEALS:
        close = edit(LINES[CLOSE], **moment(seal))
        assert expect(signed([*LINES[:seal], close])) == ("boundary/not-ended", seal)


def test_log_with_missing_middle_is_detected() -> None:
    cut = SEALS[1]
    end = [edit(line, **moment(cut)) for line in LINES[STATEMENTS[-1] :]]
    assert expect(signed([*LINES[:cut], *end])) == ("boundary/missing", cut)  # it marks none of what was cut off


def test_a_session_goes_on_after_its_end() -> None:
    twice = [*LINES[:-1], edit(LINES[-2], detail=read(LINES[-2])["detail"]), LINES[-1]]
    assert expect(signed(twice)) == ("boundary/replayed", CLOSE)
    more = [*LINES[:-1], edit(LINES[SENT[0]], **moment(CLOSE)), LINES[-1]]
    assert expect(signed(more)) == ("boundary/invented", CLOSE)


# ---------------------------------------------------------------- two flights


def test_the_records_of_another_session() -> None:
    other = second()
    assert "session 2 of the boundary" in str(sound(other).report.proven)
    seal = SEALS[0]
    assert read(other[seal])["type"] == "seal"
    assert expect(signed([*LINES[: seal + 1], *other[seal + 1 :]])) == ("boundary/other-session", STATEMENTS[2])
    statement = STATEMENTS[1]
    spliced = changed(statement, edit(LINES[statement], detail=read(other[statement])["detail"]))
    assert expect(signed(spliced)) == ("boundary/other-session", statement)


def test_another_flight() -> None:
    """The flight's id is in the genesis, which the attacker signs too, but not the boundary's statements."""
    genesis = edit(LINES[0], boot="11" * 16)
    assert expect(signed([genesis, *LINES[1:]])) == ("boundary/other-flight", STATEMENTS[0])


def test_another_mode() -> None:
    lines = [edit(line, mode="none") if "mode" in read(line) else line for line in LINES]
    assert expect(signed(lines)) == ("boundary/beginning", STATEMENTS[0])


# ---------------------------------------------------------------- undetectable in a single log


@pytest.mark.parametrize("seal", SEALS[1:2])
def test_a_log_cut_off_and_called_a_crash_says_what_is_not_shown(seal: int) -> None:
    """The holder of the log key ends it like a recovery. The next session names the last state of this one."""
    close = edit(LINES[CLOSE], **moment(seal), ending="recovered")
    head = edit(LINES[seal], type="recover", discarded_bytes=0, discarded_digest="00" * 32)
    report = prove(signed([*LINES[:seal], head, close])).report
    assert report.failure is None, report.failure
    assert ("boundary", "what the boundary did after its last statement: the log ends") in report.unproven


# ---------------------------------------------------------------- a claimed loss


def lost_at(number: int, *more: int) -> list[bytes]:
    """A log that claims the boundary's loss before a record, and omits its later output except `more`."""
    claim = edit(LINES[SENT[0]], event="boundary-lost", kind=-1, step=-1, link=-1, token=-1, detail="it is gone")
    claim = edit(claim, **moment(number))
    gone = {each for each in (*DECISIONS, *STATEMENTS, APPROVAL, *SENT) if each >= number} - set(more)
    rest = [line for each, line in enumerate(LINES) if each >= number and each not in gone]
    return [*LINES[:number], claim, *rest]


@rows("number", [*DECISIONS[2:], *SENT[1:], CLOSE])
def test_a_loss_is_claimed_to_leave_out_what_follows(number: int) -> None:
    """Nothing contradicts the claim, but the log is incomplete: the report names the first record."""
    assert expect(signed(lost_at(number))) == ("boundary/lost", number)
    report = prove(signed(lost_at(number))).report
    assert report.failure is None
    assert report.verdict is LogVerdict.INCOMPLETE
    assert any("only the runtime vouches" in text for slug, text in report.unproven if slug == "boundary")


def test_recorded_loss_does_not_hide_signed_entries() -> None:
    """The last statement covers entries that no earlier record contains."""
    statement = next(each for each in STATEMENTS if each > SENT[0])
    lines = [line for number, line in enumerate(LINES) if number != SENT[0]]
    claimed = edit(LINES[SENT[0]], event="boundary-lost", kind=-1, step=-1, link=-1, token=-1, detail="gone")
    lines.insert(statement, edit(claimed, **moment(statement)))
    slug, _ = expect(signed(lines))
    assert slug in ("boundary/omitted", "boundary/differs")


@rows("kind", [DECISIONS, STATEMENTS, [APPROVAL], [each for each in SENT if read(LINES[each])["kind"] == 0]])
def test_boundary_output_after_its_loss_is_refused(kind: list[int]) -> None:
    """A decision, a statement, a document or a step: only links may fly then."""
    at = SENT[0] + 1
    made = next(each for each in kind if each > at)
    lines = lost_at(at, made)
    number = next(n for n, line in enumerate(lines) if n > at and line == LINES[made])
    assert expect(signed(lines)) == ("boundary/after-loss", number)


def test_loss_before_first_entry_is_rejected() -> None:
    assert expect(signed(lost_at(STATEMENTS[0]))) == ("boundary/missing", STATEMENTS[0])


def test_boundary_flaw_has_its_own_exit_code() -> None:
    assert finding_code("boundary/missing") is ExitCode.BOUNDARY == 15
