"""The meaning of each finding about a log by its slug, for `rtshcua explain` and readers of `verify-log --json`.

A slug is `kind/finding`. Some end in the slug of a refusal by `wire`; those are composed here.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

from rtshcua.app.logs import finding_code
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.render.verdict import HELPS, meaning_of


class LogSlug(NamedTuple):
    """A finding: its slug, what was found, its meaning, the exit code, and what to do, if anything."""

    slug: str
    found: str
    meaning: str
    exit_code: ExitCode
    help: str = ""


_FOUND: Final = {
    "anchor/beyond": "a witness cosigned more records than the log has",
    "anchor/missing": "too few witnesses cosigned the last records, and `--require-anchor` requires them",
    "anchor/root": "a witness cosigned records that differ from those of the log",
    "anchor/signature": "a note of a witness is damaged or forged, so it is ignored",
    "archive/changed": "the file in the archive differs from the one that was added",
    "archive/missing": "the file is missing in the archive",
    "attested/again": "the boundary's home attested itself more than once",
    "attested/moved": "the attestation of the boundary's home belongs to another point of its evidence",
    "attested/other-flight": "the attestation of the boundary's home belongs to another flight",
    "attested/other-log-key": "the attestation of the boundary's home names another key of the log",
    "attested/other-mode": "the attestation of the boundary's home names another mode than the log",
    "boundary/after-loss": "a record after the loss of the boundary contains something that only a boundary makes",
    "boundary/beginning": "the boundary's session began with another flight, bundle or mode",
    "boundary/gap": "the boundary signed before the end of a gap that the log records earlier",
    "boundary/clock": "the boundary's time of day contradicts that of a record",
    "boundary/differs": "a record differs from what the boundary made, or an earlier record is missing",
    "boundary/frames": "the raw frames differ from those that passed the boundary",
    "boundary/invented": "a record reports something that the boundary did not make",
    "boundary/lost": "the boundary was lost in flight, so later records lack its signature",
    "boundary/missing": "a statement of the boundary is missing",
    "boundary/not-ended": "the log was closed, but the boundary did not sign its end",
    "boundary/omitted": "something that the boundary made is not in any record",
    "boundary/other-flight": "a statement of the boundary belongs to another flight",
    "boundary/other-session": "a statement of the boundary belongs to another session",
    "boundary/record": "a record has a form that a boundary does not make",
    "boundary/replayed": "a statement of the boundary is older than one before it",
    "chain/broken": "a record does not contain the hash of the previous one: one of them was changed",
    "chain/sequence": "a record has a wrong number: records were removed, added or moved",
    "clock/backwards": "the monotonic time of a record is before that of the previous record",
    "clock/received": "the bundle was received after the start of the log that contains it",
    "clock/utc-backwards": "the time of day of a record is before that of an earlier one, by more than their errors",
    "clock/utc-jump": "time of day and monotonic time diverge by more than their stated errors",
    "close/junk-after": "data follows the signed end of the log: zeros, a newline, or a record",
    "close/missing": "the log ends without its signed close",
    "image/incomplete": "a step that requires all images succeeded, but its list of them has gaps or is missing",
    "image/malformed": "the record of an image, or of missing images, is malformed",
    "image/missing": "a list of missing images contradicts the recorded images",
    "image/series": "the index of a camera restarted out of turn",
    "image/twice": "an image was recorded twice",
    "decision/approvals": "the decision used approvals that differ from those accepted before it",
    "decision/cancelled": "a step was decided after the mission was cancelled",
    "decision/clause": "recomputed, another clause decides",
    "decision/clause-at": "recomputed, the deciding clause has another position in the sources",
    "decision/consumed": "`consumed` contradicts earlier records",
    "decision/durability": "the record is less durable than its contract requires",
    "decision/inputs": "the inputs of the decision are impossible",
    "decision/invocation": "the decision names another invocation than its bundle",
    "decision/mode": "the decision names another enforcement mode than its log",
    "decision/monitor": "the state of a temporal monitor contradicts the recorded states",
    "decision/not-current": "a step was decided out of turn",
    "decision/outcome": "recomputed, the decision has another outcome",
    "decision/policy-version": "the decision names another version of the policy than its bundle",
    "decision/reason": "recomputed, the decision has another reason",
    "decision/recalled": "a step was decided after the mission was recalled",
    "decision/released": "the release time of the step contradicts earlier records",
    "decision/rule-step": "recomputed, another check decides",
    "decision/target": "recomputed, another fallback is chosen",
    "decision/target-link": "recomputed, another link of the fallback chain is chosen",
    "decision/unknown-step": "the decision is about a step that is not in the bundle",
    "decision/valid-until-us": "recomputed, the decision is valid until another time",
    "decision/vehicle": "the decision is about another vehicle",
    "dispatch/backwards": "a fallback returned to an earlier link of its chain",
    "dispatch/cancelled": "a step was sent after the mission was cancelled",
    "dispatch/lapsed": "a link of a fallback chain was sent when it no longer applied",
    "dispatch/late": "a command was sent after its permit expired",
    "dispatch/mission-over": "a step was sent after a return or a landing began",
    "dispatch/not-permitted": "a command was sent without an earlier record that permits it",
    "dispatch/other-skill": "the sent skill differs from the permitted one",
    "dispatch/out-of-turn": "a step was sent out of turn",
    "dispatch/recalled": "a step was sent after the mission was recalled",
    "dispatch/was-sent": "a step that may have been sent was decided again",
    "document/base64": "a document in the log is not canonical base64",
    "document/other": "the kind of a document contradicts its record",
    "frames/early": "a frame of a command was sent before the record that permits it",
    "frames/other-command": "a frame commands something that was not permitted",
    "frames/parameter-in-flight": "a frame sets a parameter while the vehicle is not on the ground",
    "frames/unlisted-parameter": "a frame sets a parameter that is not in any record",
    "frames/unrecorded": "a frame commands the vehicle without a record that permits it",
    "frames/was-sent": "a frame executes a step that was not sent according to the log",
    "genesis/base64": "the trust root or the bundle in the log is not canonical base64",
    "genesis/format": "the format or version of the log is not supported",
    "genesis/log-key": "the id of the log key does not match the key",
    "genesis/missing": "the first record is missing: the beginning of the log was cut off",
    "genesis/mission": "the log names another mission than its bundle",
    "genesis/other-bundle": "the log belongs to another bundle than the one in its folder",
    "genesis/repeated": "a second log begins inside the log",
    "log/empty": "the file is empty",
    "preparation/in-flight": "parameters were set during a command",
    "preparation/malformed": "the list of parameters is malformed",
    "preparation/other-permit": "the boundary permitted parameters that differ from the list",
    "preparation/other-value": "a parameter was restored to a wrong value",
    "preparation/parameter": "a parameter may not be set",
    "preparation/value": "the value of a parameter is not permitted",
    "record/malformed": "a line is not a record",
    "record/not-canonical": "a line is a record, but not in canonical form",
    "record/too-long": "a line exceeds the length limit of records",
    "seal/after": "a signature does not follow that of the previous signed record",
    "seal/bytes": "the byte count of a signed record does not match its epoch",
    "seal/digest": "the bytes of an epoch differ from the signed ones",
    "seal/epoch": "a signed record ends a wrong epoch: one was removed, added or moved",
    "seal/gap": "a recorded gap contradicts the times of the adjacent records, or is the second in its epoch",
    "seal/key": "a record is signed by a key other than the one named in the previous signed record",
    "seal/missing": "an epoch was not sealed in time, and no recorded gap explains the delay",
    "seal/next-key": "the next key in a signature differs from the one in its record",
    "seal/note": "a signature is malformed or missing",
    "seal/records": "the record count of a signed record does not match its epoch",
    "seal/root": "the records differ from the signed ones, and the hash chain was rewritten",
    "seal/self": "a signed record was changed after it was signed",
    "seal/signature": "a signature is invalid",
    "seal/size": "a signature is for another number of records",
    "tail/torn": "the log ends inside a record",
    "telemetry/changed": "the raw frames file does not match the close of the log",
    "trust/log-key": "the trust root does not permit the key that signed the log",
    "trust/revoked-key": "a key used for the log was revoked before it signed",
    "trust/revoked-log-key": "the key that signed the log was revoked later",
    "trust/revoked-when": "it is unknown whether a key was revoked before it signed",
    "trust/root-revoked-key": "the key that signed the trust root was revoked",
}  # fmt: skip
#: the problem with a signed item, by the slug of the refusal; `{}` is the item
_REFUSED: Final = {
    "already-answered": "{} answers a request that was already answered",
    "already-decided": "{} came after its step was decided",
    "already-released": "{} replaces a step that was already released",
    "bad-signature": "the signature of {} is invalid",
    "before-mission": "{} was issued before its mission",
    "binding-mismatch": "an invocation of {} does not match its binding",
    "cancelled": "{} came after the mission was cancelled",
    "development-key": "{} names a development key in a production root",
    "development-root": "{} is a development root, which was not pinned",
    "expired": "{} had expired",
    "fork": "{} differs from the known root of the same version",
    "id-mismatch": "an id of {} does not match its invocation",
    "id-seen": "{} has an id that was used before",
    "issued-in-future": "{} was issued after it was received",
    "key-expired": "the key that signed {} had expired",
    "key-other-policy": "{} is under a policy that its key does not cover",
    "malformed": "{} is malformed",
    "no-step": "{} is about a step that is not in the mission",
    "not-asked": "{} answers a request that was not made",
    "not-self-signed": "{} is not signed by one of its own root keys",
    "other-flight": "{} belongs to another flight",
    "other-boundary": "{} names another boundary than the one that signed it",
    "other-mission": "{} is about another mission",
    "other-policy": "{} is under another policy",
    "other-steps": "the kept steps of {} differ from the flown ones",
    "recalled": "{} came after the mission was recalled",
    "revoked-key": "the key that signed {} was revoked",
    "rollback": "{} is older than a known root",
    "root-expired": "the trust root of {} had expired",
    "shared-key": "{} uses one key for two duties",
    "superseded": "{} came after a newer one",
    "too-large": "{} is too large",
    "too-long-lived": "the validity of {} exceeds the limit",
    "too-many": "{} exceeds the number of documents of a flight",
    "unknown-document": "{} is an unknown kind of document",
    "unknown-format": "{} is of another format",
    "unknown-invocation": "{} is about an invocation that is not in the mission",
    "unknown-key": "{} is not signed by a trusted key",
    "unknown-version": "the version of {} is not supported",
    "unpinned": "{} is not signed by the pinned key",
    "unreachable-threshold": "the threshold of {} exceeds its number of signers",
    "unsupported-threshold": "{} requires several signers for a duty that has one",
    "unrevoked": "{} trusts a revoked key again",
    "version-gap": "{} skips a version",
    "whose-approval": "an approval key of {} is not bound to one person in one role",
    "wrong-content-type": "{} has a wrong content type",
    "wrong-duty": "{} is signed by a key of another duty",
    "wrong-policy": "{} is under a policy that its key does not cover",
    "wrong-role": "{} is in a role that its key does not cover",
    "wrong-source": "{} is from a source that its key does not cover",
    "wrong-vehicle": "{} is for another vehicle",
}
_SIGNED: Final = {
    "attested": "the attestation of the boundary's home",
    "boundary": "a statement of the boundary",
    "document": "an approval, recall, replacement or cancellation",
    "trust/root": "the trust root",
    "trust/bundle": "the bundle",
}
#: findings that make a log incomplete, not failed
_SHORT: Final = frozenset({
    "anchor/missing", "boundary/lost", "close/missing", "tail/torn", "trust/revoked-log-key", "trust/revoked-when",
})  # fmt: skip


def find(word: str) -> LogSlug | None:
    """Return the finding of a slug, ignoring case; None if unknown."""
    slug = word.lower().replace("_", "-")
    found = _FOUND.get(slug) or _signed(slug)
    if found is None:
        return None
    code = ExitCode.INCOMPLETE if slug in _SHORT else finding_code(slug)
    return LogSlug(slug, found, meaning_of(slug, failed=slug not in _SHORT), code, HELPS.get(slug, ""))


def every() -> Iterator[str]:
    """Yield all slugs: first the single findings, then the refusals of signed items."""
    yield from sorted(_FOUND)
    yield from (f"{kind}{'-' if '/' in kind else '/'}{slug}" for kind in _SIGNED for slug in _REFUSED)


def _signed(slug: str) -> str | None:
    for kind, what in _SIGNED.items():
        prefix = f"{kind}-" if "/" in kind else f"{kind}/"
        if slug.startswith(prefix) and (text := _REFUSED.get(slug.removeprefix(prefix))):
            return text.format(what)
    return None
