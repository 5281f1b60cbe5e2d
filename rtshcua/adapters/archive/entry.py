"""What an archive knows about one log: its row of the catalogue, and the data that explains its records."""

import msgspec

#: the depth of a verification: chain, seals and anchors of typed records; or each decision derived again too
RECORDS, AUDIT = "records", "audit"

#: `verified`: complete up to its signed close. `incomplete`: valid but without an end. `failed`: not valid
VERIFIED, INCOMPLETE, FAILED = "verified", "incomplete", "failed"


class ArchiveEntry(msgspec.Struct, frozen=True):
    """A log. Times are UTC in us. Values from the log itself are null if the log cannot be trusted.

    `part` names the files with the rows of its records; empty without any. `finding` is the slug of the fault, at
    record `finding_record`. `indexed` counts the records with rows: those under a signature. `anchored` counts the
    records that as many witnesses hold as the trust root demands. `before` and `last_leaf` link the logs of a vehicle;
    `root` is the RFC 9162 root over `records`.
    """

    log: str
    bytes: int
    name: str
    added_us: int
    checked_us: int
    checked: str
    pinned: str
    status: str
    finding: str | None = None
    finding_record: int | None = None
    finding_text: str | None = None
    part: str = ""
    vehicle: str | None = None
    boot: str | None = None
    mission: str | None = None
    mode: str | None = None
    policy: str | None = None
    policy_version: int | None = None
    policy_digest: str | None = None
    bundle_digest: str | None = None
    log_key: str | None = None
    begun_us: int | None = None
    lasted_us: int | None = None
    ending: str | None = None
    records: int = 0
    indexed: int = 0
    anchored: int = 0
    recoveries: int = 0
    before: str | None = None
    last_leaf: str | None = None
    root: str | None = None


class StepRecords(msgspec.Struct, frozen=True):
    """The skill of a step, or of a link of a chain, in the records from `first` to before `until` of a log."""

    log: str
    first: int
    until: int
    kind: int
    step: int
    link: int
    skill: str
    what: str


class VerifiedLog(msgspec.Struct, frozen=True):
    """The result of the verification of one log."""

    entry: ArchiveEntry
    steps: tuple[StepRecords, ...] = ()
