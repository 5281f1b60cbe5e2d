"""What an archive knows of one log: a row of its catalogue, and what its records are explained with."""

import msgspec

#: how deep a log was verified: the chain, seals and anchors of typed records; or each decision derived again too
RECORDS, AUDIT = "records", "audit"

#: `verified`: whole up to its signed close. `incomplete`: sound as far as it goes. `failed`: not to be believed
VERIFIED, INCOMPLETE, FAILED = "verified", "incomplete", "failed"


class ArchiveEntry(msgspec.Struct, frozen=True):
    """A log. Times are UTC in us. What comes from the log itself is null where the log is not to be trusted.

    `part` names the files with the rows of its records; empty where none are indexed. `finding` is the slug of what is
    wrong or missing, at record `finding_record`. `indexed` records have rows: those that a signature covers. `anchored`
    of the records are held by as many witnesses as the trust root demands. `before` and `last_leaf` link the logs of a
    vehicle; `root` is the RFC 9162 root over `records`.
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
    """Which skill a step, or a link of a chain, stands for, in the records from `first` to before `until` of a log."""

    log: str
    first: int
    until: int
    kind: int
    step: int
    link: int
    skill: str
    what: str


class VerifiedLog(msgspec.Struct, frozen=True):
    """What came of the verification of one log."""

    entry: ArchiveEntry
    steps: tuple[StepRecords, ...] = ()
