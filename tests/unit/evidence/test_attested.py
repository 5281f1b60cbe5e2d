"""Compares the boundary's own evidence with the records: the flaws, and their records."""

from base64 import b64decode, b64encode
from hashlib import sha256

import msgspec
import pytest
from msgspec.structs import replace

from reference.attested_flight import attested
from reference.verifiers import ROOT_KEY
from rtshcua.evidence.attested import BoundaryEvidence, entry_of
from rtshcua.evidence.finding import Claim, Finding, Flaw
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import AnyRecord, Close, DecisionRecord, Effect, Genesis, Recover, Seal
from rtshcua.evidence.rooted import rooted
from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now
from rtshcua.wire import boundary_chain, cbor, cose, statement
from rtshcua.wire.attestation import CONTENT_TYPE, PROFILE, SOFTWARE
from rtshcua.wire.boundary_chain import MOST_MARKS, START, BoundaryChain, Tag
from rtshcua.wire.clock import ClockSource
from rtshcua.wire.keys import Duty
from rtshcua.wire.preparation import ParameterWrite
from rtshcua.wire.statement import Statement
from rtshcua.wire.trust import TrustRoot
from virtual import case
from virtual.rows import rows

RECORDS: list[AnyRecord] = [record for record in map(read, attested()) if not isinstance(record, Flaw)]
GENESIS = next(record for record in RECORDS if isinstance(record, Genesis))
DECISION = next(record for record in RECORDS if isinstance(record, DecisionRecord))
EFFECT = next(record for record in RECORDS if isinstance(record, Effect))
SEAL = next(record for record in RECORDS if isinstance(record, Seal))
CLOSE = next(record for record in RECORDS if isinstance(record, Close))
RECOVER = msgspec.convert(
    msgspec.to_builtins(SEAL) | {"type": "recover", "discarded_bytes": 0, "discarded_digest": "00" * 32}, Recover
)
_ROOT = rooted(GENESIS, ROOT_KEY)
assert isinstance(_ROOT, TrustRoot)
ROOT = _ROOT
NEVER = b"\x01" * 32
UEID = b"\1" + sha256(case.BOUNDARY_KEY.public).digest()[:16]


class Log:
    """A log with the boundary's true chain; each added record returns the flaw found at it."""

    def __init__(self, genesis: Genesis = GENESIS, root: TrustRoot = ROOT) -> None:
        self.evidence = BoundaryEvidence(root, genesis)
        self.chain = BoundaryChain()
        flight, bundle = bytes.fromhex(GENESIS.boot), sha256(b64decode(GENESIS.bundle)).digest()
        payload = boundary_chain.begin(1, START, flight, bundle, enforced=True)
        self.chain.add(Tag.BEGIN, payload)
        self.seq = 0

    def take(self, record: AnyRecord) -> tuple[str, int] | None:
        """Slug and record of the flaw, None if there is none."""
        self.seq += 1
        found = self.evidence.check(replace(record, seq=self.seq), 100 * self.seq)
        if found is None:
            return None
        assert isinstance(found, Finding)
        assert found.offset == 100 * found.record
        return found.slug, found.record

    def statement(self, **fields: object) -> Statement:
        chain = self.chain
        said = Statement(
            bytes.fromhex(GENESIS.boot), 1, START, chain.count, chain.digest, chain.marks(), chain.frames, chain.left,
            chain.repeated, chain.declined, chain.stopped, chain.ahead, chain.aside,
            ClockSource.SHARED, EFFECT.at_us, EFFECT.utc_us, EFFECT.utc_error_us, final=False,
        )  # fmt: skip
        return replace(said, **fields)

    def state(self, **fields: object) -> tuple[str, int] | None:
        """The boundary's present statement."""
        return self.take(stated(self.statement(**fields)))

    def refuse(self, slug: str = "permit/late", *, made: bool = True) -> tuple[str, int] | None:
        """A permit that the boundary refused, or that it did not."""
        if made:
            self.chain.add(Tag.REFUSED, boundary_chain.refused(slug, 5))
        return self.take(effect("refused", slug, at_us=5))


def effect(event: str, detail: str = "", **fields: object) -> Effect:
    return replace(EFFECT, event=event, detail=detail, **fields)


def stated(said: Statement) -> Effect:
    return effect("boundary", b64encode(statement.sign(said, case.BOUNDARY_KEY)).decode())


def at_home(log: Log, claims: dict[int, object]) -> Effect:
    """What the boundary's home attests at this point, but for these claims."""
    said = {
        10: bytes.fromhex(GENESIS.boot), 256: UEID, 263: 0, 265: PROFILE, 267: 4, 270: SOFTWARE,
        273: ((60, cbor.encode({1: -16, 2: bytes([9]) * 32})),), -70001: GENESIS.mode, -70002: log.chain.digest,
        -70003: 0, -70004: (b"", b""),
    } | claims  # fmt: skip
    protected = cbor.encode({1: cose.ED25519, 3: CONTENT_TYPE, 4: case.BOUNDARY_KEY.kid})
    payload = cbor.encode(said)
    signature = case.BOUNDARY_KEY.sign(cbor.encode(("Signature1", protected, b"", payload)), duty=Duty.BOUNDARY)
    token = b"\xd2" + cbor.encode((protected, {}, payload, signature))
    return effect("attested", b64encode(token).decode())


@pytest.fixture
def log() -> Log:
    """A log with its first statement."""
    made = Log()
    assert made.state() is None
    return made


def test_genuine_flight_has_no_flaw() -> None:
    evidence = BoundaryEvidence(ROOT, GENESIS)
    assert [evidence.check(record, 0) for record in RECORDS[1:]] == [None] * (len(RECORDS) - 1)
    (proven,), (clock,) = evidence.claims()
    assert (proven.slug, clock.slug) == ("boundary", "clock")


@pytest.mark.parametrize(("debug", "told"), [(0, "enabled"), (1, "disabled")])
def test_attested_home_is_proven(log: Log, debug: int, told: str) -> None:
    assert log.take(at_home(log, {263: debug})) is None
    assert log.take(at_home(log, {263: debug})) == ("attested/again", 3)
    assert [log.refuse(), log.state(final=True), log.take(CLOSE)] == [None] * 3
    proven, unproven = log.evidence.claims()
    (home,) = [claim.text for claim in proven if claim.slug == "home"]
    assert f"`{GENESIS.mode}`" in home
    assert f"in start 4 with what it keeps, debugging {told}" in home
    assert "measured its own code" in next(claim.text for claim in unproven if claim.slug == "home")


def test_home_that_does_not_fit_the_log_is_a_flaw(log: Log) -> None:
    assert log.take(at_home(log, {10: bytes([1]) * 16})) == ("attested/other-flight", 2)
    assert log.take(at_home(log, {-70001: "optee"})) == ("attested/other-mode", 3)
    assert log.take(at_home(log, {-70002: bytes(32)})) == ("attested/moved", 4)
    assert log.take(effect("attested", "no token")) == ("attested/malformed", 5)
    assert log.take(at_home(log, {-70004: (bytes(16), b"")})) == ("attested/other-log-key", 6)
    assert log.take(at_home(log, {-70004: (bytes.fromhex(GENESIS.log_kid), b"")})) is None


def test_boundary_apart_without_attestation_is_not_proven() -> None:
    log = Log(replace(GENESIS, mode="process"))
    assert [log.state(), log.refuse()] == [None] * 2
    (home,) = [claim.text for claim in log.evidence.claims()[1] if claim.slug == "home"]
    assert "no attestation" in home


def test_root_without_boundary_key_requires_no_evidence() -> None:
    for keys in ((), (case.BOUNDARY_KEY.verification(vehicles=("another",)),)):
        evidence = BoundaryEvidence(replace(ROOT, keys=keys), GENESIS)
        assert not evidence.asked
        assert evidence.check(DECISION, 0) is None
        assert [claim.slug for claim in evidence.claims()[1]] == ["boundary"]


def test_entries_of_a_true_log(log: Log) -> None:
    assert log.take(effect("noted")) is None
    assert [log.refuse(), log.refuse("permit/used"), log.state(), log.take(SEAL), log.state(), log.take(SEAL)] == [
        None
    ] * 6
    assert log.evidence.claims()[1][0].text.endswith("the log ends")
    assert [log.refuse(), log.state(final=True), log.take(CLOSE)] == [None] * 3
    assert [claim.slug for claim in log.evidence.claims()[1]] == ["clock"]


def test_first_statement_after_gap_vouches_for_it(log: Log) -> None:
    assert [log.take(SEAL), log.take(effect("stalled", "9 us")), log.refuse(), log.state(), log.take(SEAL)] == [
        None
    ] * 5
    assert [log.state(), log.take(SEAL)] == [None] * 2
    assert log.evidence.gaps == {3: 5}


def test_statement_older_than_gap_end_does_not_vouch(log: Log) -> None:
    assert log.take(SEAL) is None
    at_us = EFFECT.at_us + 3_600_000_000
    assert log.take(effect("stalled", "9 us", at_us=at_us, utc_us=EFFECT.utc_us + 3_600_000_000)) is None
    assert log.state() == ("boundary/gap", 4)
    assert log.evidence.gaps == {}


def test_records_may_follow_their_statement(log: Log) -> None:
    log.chain.add(Tag.REFUSED, boundary_chain.refused("permit/late", 5))
    log.chain.add(Tag.REFUSED, boundary_chain.refused("permit/used", 5))
    assert [log.state(), log.take(SEAL)] == [None] * 2
    assert log.refuse(made=False) is None
    assert log.refuse("permit/used", made=False) is None
    assert [log.state(), log.take(SEAL)] == [None] * 2


@rows("slugs", [("permit/used",), ("permit/late", "permit/forged")])
def test_refusals_that_differ_from_the_statement_are_found(slugs: tuple[str, ...]) -> None:
    log = Log()
    log.state()
    log.chain.add(Tag.REFUSED, boundary_chain.refused("permit/late", 5))
    log.chain.add(Tag.REFUSED, boundary_chain.refused("permit/used", 5))
    log.state()
    *before, last = (log.refuse(slug, made=False) for slug in slugs)
    assert before == [None] * len(before)
    assert last == ("boundary/differs", log.seq)


def test_digest_detects_change_without_marks(log: Log) -> None:
    for _ in range(MOST_MARKS + 2):
        log.refuse()
    log.refuse("permit/used", made=False)
    log.chain.add(Tag.REFUSED, boundary_chain.refused("permit/forged", 5))
    assert log.state() == ("boundary/differs", log.seq)
    other = Log()
    other.state()
    for _ in range(MOST_MARKS + 2):
        other.chain.add(Tag.REFUSED, boundary_chain.refused("permit/late", 5))
    assert other.state() is None
    assert [other.refuse(made=False) for _ in range(MOST_MARKS + 1)] == [None] * (MOST_MARKS + 1)
    assert other.refuse("permit/used", made=False) == ("boundary/differs", other.seq)


def test_an_entry_is_altered_moved_or_left_out(log: Log) -> None:
    log.refuse("permit/late")
    log.chain.add(Tag.REFUSED, boundary_chain.refused("permit/used", 5))
    log.refuse("permit/forged")
    assert log.state() == ("boundary/differs", 3)


def test_an_entry_is_invented(log: Log) -> None:
    log.refuse()
    log.refuse("permit/used", made=False)
    assert log.state() == ("boundary/invented", 3)


def test_entries_are_left_out_to_the_next_statement(log: Log) -> None:
    log.chain.add(Tag.REFUSED, boundary_chain.refused("permit/used", 5))
    log.chain.add(Tag.REFUSED, boundary_chain.refused("permit/used", 5))
    assert [log.state(), log.take(SEAL)] == [None] * 2
    assert log.state() == ("boundary/omitted", log.seq)


def test_entries_are_left_out_to_the_close(log: Log) -> None:
    log.chain.add(Tag.REFUSED, boundary_chain.refused("permit/used", 5))
    assert log.state(final=True) is None
    assert log.take(CLOSE) == ("boundary/omitted", log.seq)


def test_a_statement_is_left_out(log: Log) -> None:
    assert Log().take(SEAL) == ("boundary/missing", 1)
    assert Log().refuse() == ("boundary/missing", 1)
    assert log.take(SEAL) is None  # the first serves its epoch
    assert log.take(SEAL) == ("boundary/missing", log.seq)
    other = Log()
    other.state()
    other.refuse()
    assert other.take(SEAL) == ("boundary/missing", other.seq)
    other.chain.marks()
    other.chain.add(Tag.UNPREPARED, b"")
    assert other.state() == ("boundary/missing", other.seq)  # it marks fewer than there are since


def test_the_end_is_not_signed(log: Log) -> None:
    assert log.state() is None
    assert log.take(CLOSE) == ("boundary/not-ended", log.seq)


def test_after_the_end(log: Log) -> None:
    assert log.state(final=True) is None
    assert log.refuse() == ("boundary/invented", log.seq)
    assert log.state() == ("boundary/replayed", log.seq)


def test_a_log_that_was_recovered(log: Log) -> None:
    log.refuse()
    assert log.take(RECOVER) is None
    assert log.take(replace(CLOSE, ending="recovered")) is None
    assert log.evidence.claims()[1][0].text.endswith("the log ends")
    other = Log()
    assert other.take(RECOVER) is None
    assert other.take(CLOSE) == ("boundary/missing", 2)  # only recovery ends one so
    assert [claim.slug for claim in other.evidence.claims()[1]] == ["boundary"]


@rows(
    ("fields", "slug"),
    [
        ({"flight": NEVER[:16]}, "other-flight"),
        ({"session": 2}, "other-session"),
        ({"before": NEVER}, "other-session"),
        ({"count": 0, "marks": b""}, "replayed"),
        ({"frames": 0}, "replayed"),
        ({"repeated": 0}, "replayed"),
        ({"declined": 0}, "replayed"),
        ({"stopped": 0}, "replayed"),
        ({"ahead": 0}, "replayed"),
        ({"digest": NEVER}, "differs"),
        ({"marks": b"m" * 8}, "missing"),
        ({"session": -1}, "malformed"),
    ],
)
def test_a_statement_that_does_not_follow(fields: dict[str, object], slug: str) -> None:
    log = Log()
    log.chain.leave(b"")
    log.chain.repeat(b"")
    log.chain.decline(b"")
    log.chain.stop(b"")
    log.chain.sign_ahead(b"")
    assert log.state() is None
    assert log.state(**fields) == (f"boundary/{slug}", 2)


def test_claims_mention_frames_signed_ahead_not_sent() -> None:
    log = Log()
    for _ in range(3):
        log.chain.sign_ahead(b"a frame")
    assert log.state(final=True) is None
    proven, unproven = log.evidence.claims()
    assert "0 frames passed it" in proven[0].text
    text = "whether any of the 3 frames that the boundary signed ahead were sent: it cannot observe that"
    assert unproven[0] == Claim("boundary", text)


def test_another_beginning() -> None:
    assert Log().state(session=2) == ("boundary/beginning", 1)
    assert Log(replace(GENESIS, mode="none")).state() == ("boundary/beginning", 1)
    assert Log().state(marks=b"") == ("boundary/beginning", 1)


def test_no_statement() -> None:
    assert Log().take(effect("boundary", "no base64")) == ("boundary/malformed", 1)


NOW = Now(EFFECT.at_us, EFFECT.utc_us, EFFECT.utc_error_us)
DIGEST = sha256(b"xyz").digest()
SET = "set FENCE_ENABLE from 0 to 1, RTL_ALT from 1500.5 to -2"
WRITES = (ParameterWrite("FENCE_ENABLE", 0, 0x3F800000), ParameterWrite("RTL_ALT", 0x44BB9000, 0xC0000000))


@rows(
    ("record", "tag", "payload"),
    [
        (effect("undecided", f"not_current {DIGEST.hex()}"), Tag.UNDECIDED, boundary_chain.undecided(3, DIGEST)),
        (effect("approval", "eHl6", step=2), Tag.DOCUMENT, boundary_chain.document(1, 2, NOW, DIGEST)),
        (effect("recall", "eHl6"), Tag.DOCUMENT, boundary_chain.document(2, -1, NOW, DIGEST)),
        (effect("replacement", "eHl6", step=1), Tag.DOCUMENT, boundary_chain.document(3, 1, NOW, DIGEST)),
        (effect("cancellation", "eHl6"), Tag.DOCUMENT, boundary_chain.document(4, -1, NOW, DIGEST)),
        (
            effect("dispatched", kind=1, step=2, link=-1, token=7),
            Tag.SENT,
            boundary_chain.sent(1, 2, -9, 7, EFFECT.at_us),
        ),
        (effect("permitted", SET), Tag.PREPARED, boundary_chain.prepared(WRITES, restoring=False)),
        (
            effect("permitted", SET.replace("set", "restore")),
            Tag.PREPARED,
            boundary_chain.prepared(WRITES, restoring=True),
        ),
        (effect("not-permitted", "permit/late"), Tag.UNPREPARED, b"permit/late"),
    ],
)
def test_entries_of_records(record: Effect, tag: Tag, payload: bytes) -> None:
    assert entry_of(record) == (tag, payload)


def test_other_records_have_no_entry() -> None:
    assert entry_of(effect("noted")) is None


def changed(**fields: object) -> DecisionRecord:
    return replace(DECISION, **fields)


@rows(
    "record",
    [
        effect("undecided", "not_current"),
        effect("undecided", f"decided {DIGEST.hex()}"),
        effect("approval", "no base64"),
        effect("approval", "eHl6", step=1 << 40),
        effect("dispatched", token=-1),
        effect("permitted", "set"),
        effect("permitted", "set X from 0"),
        effect("permitted", "set X from 0 to much"),
        effect("permitted", "set X from inf to 0"),
        effect("permitted", "set " + ", ".join(["X from 0 to 1"] * 33)),
        changed(outcome="perhaps"),
        changed(reason="of/mine"),
        changed(binding="00"),
        changed(binding="x" * 64),
        changed(binding="0"),
        changed(kind=-1),
        changed(rule_step=256),
        changed(state=replace(DECISION.state, ages=())),
        changed(state=replace(DECISION.state, values=(0,) * 73, ages=(0,) * 73)),
        changed(state=replace(DECISION.state, monitors=(1,) * 33)),
    ],
)
def test_records_without_possible_entry_are_rejected(record: DecisionRecord | Effect) -> None:
    found = entry_of(record)
    assert isinstance(found, Flaw)
    assert found.slug == "boundary/record"
    log = Log()
    log.state()
    assert log.take(record) == ("boundary/record", 2)


# ---------------------------------------------------------------- the time of day

AT_US, UTC_US, S = EFFECT.at_us, EFFECT.utc_us, 1_000_000


def told(log: Log, of: ClockSource = ClockSource.KERNEL, **own: int) -> tuple[str, int] | None:
    """A statement, by another clock than that of the record."""
    return log.state(**({"source": of, "utc_error_us": 1_000} | own))


def test_a_record_may_be_two_seconds_and_both_errors_off() -> None:
    error_us = EFFECT.utc_error_us
    assert told(Log(), utc_us=UTC_US + 2 * S + error_us - 1_000) is None
    for own in ({"utc_us": UTC_US + 2 * S + error_us}, {"utc_us": UTC_US - 2 * S - error_us}):
        # the genesis claims it first
        assert told(Log(), **own) == ("boundary/clock", 0)


def test_stall_before_statement_is_not_a_flaw() -> None:
    """By how far the two are apart, which a stall does not change; and what errors grew in it counts for both."""
    log = Log()
    assert told(log) is None
    assert told(log, at_us=AT_US + 7_200 * S, utc_us=UTC_US + 7_200 * S, utc_error_us=1_000 + 3_600_000) is None
    assert told(Log(), at_us=AT_US + 60 * S, utc_us=UTC_US + 60 * S) is None


def test_the_first_record_that_claims_another_time_is_named(log: Log) -> None:
    unknown = {"utc_error_us": UTC_UNKNOWN_US}
    assert log.take(effect("noted", **unknown)) is None
    assert log.take(effect("noted", utc_us=UTC_US + 5 * S)) is None
    assert log.take(effect("noted", **unknown)) is None
    assert told(log) == ("boundary/clock", 3)


def test_time_claim_is_refused_if_boundary_has_no_time() -> None:
    said = Log().statement(source=ClockSource.UNKNOWN, utc_error_us=UTC_UNKNOWN_US)
    assert Log().take(stated(said)) == ("boundary/clock", 0)
    quiet = Log(replace(GENESIS, utc_error_us=UTC_UNKNOWN_US))
    assert quiet.take(replace(stated(said), utc_error_us=UTC_UNKNOWN_US)) is None
    (_, clock), _ = quiet.evidence.claims()
    assert "did not know the time of day" in clock.text


def test_claims_mention_boundary_clock(log: Log) -> None:
    assert told(log) is None
    (_, clock), unproven = log.evidence.claims()
    assert clock == Claim(
        "clock", "the time of day in the records agrees with the boundary's own clock, set by the kernel"
    )
    assert [claim.slug for claim in unproven] == ["boundary"]


def test_after_a_recovery_claims_begin_anew(log: Log) -> None:
    assert log.take(effect("noted", utc_us=UTC_US + 5 * S)) is None
    assert log.state() is not None
    other = Log()
    assert other.state() is None
    assert other.take(effect("noted", utc_us=UTC_US + 5 * S)) is None
    assert other.take(RECOVER) is None
    assert told(other) is None
