"""The records of a log: the contents of each line, byte for byte.

A line is RFC 8785 (JCS) JSON and a newline: sorted keys, and only integers, texts, null, arrays and objects.
msgspec writes the fields of a struct in the order of their definition, so every struct here defines them sorted,
and the bytes are those of RFC 8785. `_prev` sorts first, because every other key begins with a lower-case letter:
its value is at bytes 10 to 73 of each line.

Every record has `_prev` (SHA-256 of 0x00 and the previous line, newline included: chain link and RFC 9162 leaf at
once), `seq` (counts from 0), `type`, and the moment of its writing: `at_us` (monotonic), `utc_us` (since the Unix
epoch) and `utc_error_us` (bound on the error of `utc_us`). Digests, keys and ids are lower-case hexadecimal. The
format is specified in docs/log-format.md.
"""

from typing import Annotated, Final, Literal

import msgspec

from rtshcua.model.decision import Decision as Decided
from rtshcua.model.outcome import Outcome
from rtshcua.wire import names
from rtshcua.wire.request import Ref

FORMAT, VERSION = names.LOG.name, names.LOG.version

#: the largest integer that every JSON reader holds exactly (RFC 8785 section 3.2.2.3, RFC 7493 section 2.2)
LARGEST = (1 << 53) - 1

Integer = Annotated[int, msgspec.Meta(ge=-LARGEST, le=LARGEST)]
Count = Annotated[int, msgspec.Meta(ge=0, le=LARGEST)]
Durability = Annotated[int, msgspec.Meta(ge=0, le=3)]
# A regular expression checks it, and therefore only in the first and the last record; the verifier compares it with
# the expected value in the others.
Hash = Annotated[str, msgspec.Meta(pattern=r"^[0-9a-f]{64}\Z")]
Name = Annotated[str, msgspec.Meta(pattern=r"^[0-9a-f]{32}\Z")]


class Record(msgspec.Struct, frozen=True, forbid_unknown_fields=True, rename={"prev": "_prev"}, gc=False):
    """The base of all records. It has no fields, because those of a subclass would follow them unsorted."""


class Genesis(Record, frozen=True):
    """The first record: the flight, its trust root, and the keys that the log is verified with.

    `bundle` and `root` are base64 of the bundle and of the trust root; `log_key` is the Ed25519 public key, called
    `log_kid` in the root, that signs this record. `boot` is 16 random bytes; `before` the hash of the last line of
    this vehicle's previous log, or null. `received_us` is the monotonic time at which the bundle was received on
    board (paper symbol `t_r`); the steps of a replacement are received at its effect. `mode` is the enforcement
    mode. A record of durability class 2 is on the disk within `sync_us`.
    """

    prev: Hash
    at_us: Count
    before: Hash | None
    boot: Name
    bundle: str
    checkpoint: str | None
    format: str
    log_key: Hash
    log_kid: Name
    mission: str
    mode: str
    next_key: Hash
    received_us: Count
    root: str
    seq: Count
    sync_us: Count
    type: Literal["genesis"]
    utc_error_us: Count
    utc_us: Count
    vehicle: str
    version: Count


class RecordedState(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True, kw_only=True, gc=False
):
    """The state as it was read (paper symbol `S_t`): one value and one age (us) for each slot, null where nothing
    valid was received, and the truth of each temporal monitor of the policy (1 true, 2 false, 4 unknown). Without
    monitors the field is absent, as in older logs.
    """

    ages: tuple[Integer, ...]
    monitors: tuple[Integer, ...] = ()
    values: tuple[Integer | None, ...]


class RecordedContext(msgspec.Struct, frozen=True, forbid_unknown_fields=True, gc=False):
    """The context of `decide` without the binding; an approval is [rule, role, granted, monotonic us]."""

    approvals: tuple[tuple[Integer, Integer, Integer, Integer, Integer], ...]
    consumed: Integer
    phase: Integer
    policy_version: Integer
    released_us: Integer
    remaining_us: Integer
    vehicle: str


#: the fields of a decision record with the result of the decision
DECIDED: Final = (
    "outcome", "reason", "rule_step", "clause", "clause_at", "target", "target_link", "valid_until_us"
)  # fmt: skip
_OUTCOMES: Final = tuple(outcome.name.lower() for outcome in Outcome)  # by number


def in_words(
    decided: Decided,
) -> tuple[str, str, int, str | None, tuple[int, int, int] | None, str | None, int, int]:
    """The decision in the form of a record (`DECIDED`). A link that may fly has no target."""
    clause, target = decided.clause, decided.target if decided.outcome == Outcome.FALLBACK else None
    return (
        _OUTCOMES[decided.outcome],
        decided.reason.value,
        decided.step,
        None if clause is None else clause.text,
        None if clause is None else (clause.source, clause.start, clause.end),
        None if target is None else target.text,
        -1 if decided.link is None else decided.link,
        decided.valid_until_us,
    )


class DecisionRecord(Record, frozen=True):
    """One answer of `enforce`, with every input that `decide` read, so that the decision can be derived again.

    `kind`, `step` and `link` are those of the request (`wire.request`). `outcome` and `reason` are slugs.
    `binding` is the one in the request. `clause` is the text of the deciding clause, `clause_at` its [source,
    start, end]; `target` the text of the link to fly instead and `target_link` its index (-1: none). `rule_step`
    is the number in section 4.1 of the step that decided, `valid_until_us` monotonic.
    """

    prev: str
    at_us: Count
    binding: str
    clause: str | None
    clause_at: tuple[Integer, Integer, Integer] | None
    context: RecordedContext
    durability: Durability
    invocation: str
    kind: Integer
    link: Integer
    mode: str
    outcome: str
    reason: str
    rule_step: Integer
    seq: Count
    state: RecordedState
    step: Integer
    target: str | None
    target_link: Integer
    type: Literal["decision"]
    utc_error_us: Count
    utc_us: Count
    valid_until_us: Integer

    @property
    def ref(self) -> Ref:
        """The subject of the decision."""
        return Ref(self.kind, self.step, self.link)


class Effect(Record, frozen=True):
    """An event. `event` is a stable slug; `detail` is text from outside, which must not be trusted.

    `kind`, `step` and `link` name the subject as in `DecisionRecord` (-1: none), `token` the command, or -1.
    """

    prev: str
    at_us: Count
    detail: str
    durability: Durability
    event: str
    kind: Integer
    link: Integer
    seq: Count
    step: Integer
    token: Integer
    type: Literal["effect"]
    utc_error_us: Count
    utc_us: Count

    @property
    def ref(self) -> Ref:
        """The subject of the event."""
        return Ref(self.kind, self.step, self.link)


class Seal(Record, frozen=True):
    """The end of an epoch. `bytes` and `records` are the length of its segment, `digest` is the SHA-256 of its bytes:
    from the beginning of the previous signed record up to this one. `next_key` signs the next epoch.
    """

    prev: Hash
    at_us: Count
    bytes: Count
    checkpoint: str | None
    digest: Hash
    epoch: Count
    next_key: Hash
    records: Count
    seq: Count
    type: Literal["seal"]
    utc_error_us: Count
    utc_us: Count


class Recover(Record, frozen=True):
    """A seal after a crash, signed by the log key. The octets after the last complete record were discarded: their
    number and digest. Monotonic time restarts here.
    """

    prev: Hash
    at_us: Count
    bytes: Count
    checkpoint: str | None
    digest: Hash
    discarded_bytes: Count
    discarded_digest: Hash
    epoch: Count
    next_key: Hash
    records: Count
    seq: Count
    type: Literal["recover"]
    utc_error_us: Count
    utc_us: Count


class Close(Record, frozen=True):
    """The last record: a seal that nothing follows. `tlog` is the SHA-256 of the telemetry log, null if there is
    none.
    """

    prev: Hash
    at_us: Count
    bytes: Count
    checkpoint: str | None
    digest: Hash
    ending: str
    epoch: Count
    records: Count
    seq: Count
    tlog: Hash | None
    type: Literal["close"]
    utc_error_us: Count
    utc_us: Count


AnyRecord = Genesis | DecisionRecord | Effect | Seal | Recover | Close
#: Records with a `checkpoint`: a C2SP signed note over the tree of all previous lines, and over the record itself.
Signed = Genesis | Seal | Recover | Close
#: records that end an epoch
Sealing = Seal | Recover | Close

_encode = msgspec.json.Encoder().encode_lines  # faster than appending the newline
_CHECKPOINT = b',"checkpoint":"'  # cannot occur in a text, where a quote stands after a backslash


def encode(record: Record) -> bytes:
    """The line of a record, newline included."""
    return _encode([record])  # msgspec 0.22 leaks a tuple that it is given here


def is_signed(line: bytes) -> bool:
    """Whether a line that is a record is a signed record."""
    return _CHECKPOINT in line


def unsigned(record: Signed) -> Signed:
    """A signed record as its checkpoint covers it: without that checkpoint."""
    return msgspec.structs.replace(record, checkpoint=None)


def next_key_of(record: Signed) -> bytes | None:
    """The key that signs the records after a signed record, 32 bytes; None after a close."""
    return None if isinstance(record, Close) else bytes.fromhex(record.next_key)
