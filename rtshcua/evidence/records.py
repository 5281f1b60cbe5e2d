"""The records of a log: what each line holds, byte for byte.

A line is RFC 8785 (JCS) JSON and a newline: keys sorted, integers, texts, null, arrays and objects only. msgspec writes
the fields of a struct in the order of their definition, so every struct here defines them sorted; the bytes are then
those of RFC 8785. `_prev` sorts first, for every other key begins with a lower-case letter: its value stands at
bytes 10 to 73 of each line.

Every record has `_prev` (SHA-256 of 0x00 and the line before, newline included: chain link and RFC 9162 leaf at once),
`seq` (counts from 0), `type`, and the moment it was written: `at_us` (monotonic), `utc_us` (since the Unix epoch) and
`utc_error_us` (bound on the error of `utc_us`). Digests, keys and ids are lower-case hexadecimal. The format is
specified in docs/log-format.md.
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
# Looked at by a regular expression, and so only in the first and the last record; the verifier compares the others with
# what they must be.
Hash = Annotated[str, msgspec.Meta(pattern=r"^[0-9a-f]{64}\Z")]
Name = Annotated[str, msgspec.Meta(pattern=r"^[0-9a-f]{32}\Z")]


class Record(msgspec.Struct, frozen=True, forbid_unknown_fields=True, rename={"prev": "_prev"}, gc=False):
    """The base of what a log holds; without fields, for those of a subclass would come after them, unsorted."""


class Genesis(Record, frozen=True):
    """The first record: who flies what, under which trust, and what the log is checked with.

    `bundle` and `root` are base64 of the bundle and of the trust root; `log_key` is the Ed25519 public key, called
    `log_kid` in the root, that signs this record. `boot` is 16 random bytes; `before` the last line's hash of the log
    that this vehicle wrote before, or null. `received_us` is the monotonic time at which the bundle was received on
    board (paper symbol `t_r`); what a replacement brings is received when the effect says so. `mode` is the enforcement
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
    """Paper symbol `S_t` as it was read: one value and one age (us) a slot, null where nothing valid was received; and
    what each temporal monitor of the policy said (1 true, 2 false, 4 unknown). Without monitors there is no such field,
    as in logs that are older than it is.
    """

    ages: tuple[Integer, ...]
    monitors: tuple[Integer, ...] = ()
    values: tuple[Integer | None, ...]


class RecordedContext(msgspec.Struct, frozen=True, forbid_unknown_fields=True, gc=False):
    """`decide`'s context but for the binding; an approval is [rule, role, granted, monotonic us]."""

    approvals: tuple[tuple[Integer, Integer, Integer, Integer, Integer], ...]
    consumed: Integer
    phase: Integer
    policy_version: Integer
    released_us: Integer
    remaining_us: Integer
    vehicle: str


#: the fields of a decision record that say what was decided
DECIDED: Final = (
    "outcome", "reason", "rule_step", "clause", "clause_at", "target", "target_link", "valid_until_us"
)  # fmt: skip
_OUTCOMES: Final = tuple(outcome.name.lower() for outcome in Outcome)  # by number


def in_words(
    decided: Decided,
) -> tuple[str, str, int, str | None, tuple[int, int, int] | None, str | None, int, int]:
    """What was decided, in the words of a record (`DECIDED`). Of a link that may fly it names no target."""
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
    """One answer of `enforce`, with every input that `decide` read, so that it can be derived again.

    `kind`, `step` and `link` are those of the request (`wire.request`). `outcome` and `reason` are slugs.
    `binding` is the one that the request presented. `clause` is the text of the deciding clause, `clause_at` its
    [source, start, end]; `target` the text of the link to fly instead and `target_link` its index (-1: none).
    `rule_step` is the number in section 4.1 of the step that decided, `valid_until_us` monotonic.
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
        """What it decides on."""
        return Ref(self.kind, self.step, self.link)


class Effect(Record, frozen=True):
    """What then happened. `event` is a stable slug; `detail` is text of the world's own making, never to be trusted.

    `kind`, `step` and `link` name what it belongs to as in `DecisionRecord` (-1: nothing), `token` the command, or -1.
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
        """What it belongs to."""
        return Ref(self.kind, self.step, self.link)


class Seal(Record, frozen=True):
    """The end of an epoch. `bytes` and `records` say how long its segment is, `digest` is the SHA-256 of its bytes:
    those from the beginning of the signed record before this one up to this one. `next_key` signs what follows.
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
    """A seal after a crash, signed by the log key: what stood after the last whole record was cut off, so many bytes
    of that digest. Monotonic time begins anew here.
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
    """The last record: a seal after which nothing follows. `tlog` is the SHA-256 of the telemetry log, null where
    there is none.
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
#: Records with a `checkpoint`: a C2SP signed note over the tree of all lines before, and over the record itself.
Signed = Genesis | Seal | Recover | Close
#: those that end an epoch
Sealing = Seal | Recover | Close

_encode = msgspec.json.Encoder().encode_lines  # cheaper than adding the newline
_CHECKPOINT = b',"checkpoint":"'  # no text can hold it, for a quote inside a text stands behind a backslash


def encode(record: Record) -> bytes:
    """The line of a record, newline included."""
    return _encode([record])  # of a tuple msgspec 0.22 never lets go


def is_signed(line: bytes) -> bool:
    """Whether this is the line of a signed record, if it is the line of a record."""
    return _CHECKPOINT in line


def unsigned(record: Signed) -> Signed:
    """A signed record as its checkpoint vouches for it: without that checkpoint."""
    return msgspec.structs.replace(record, checkpoint=None)


def next_key_of(record: Signed) -> bytes | None:
    """The key that signs what follows a signed record, 32 bytes; None behind a close."""
    return None if isinstance(record, Close) else bytes.fromhex(record.next_key)
