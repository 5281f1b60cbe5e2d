"""What each finding about a log means, by its slug: for `rtshcua explain`, and for whoever reads `verify-log --json`.

A slug is a kind, a stroke, and what it is. Some end in the slug of what `wire` refuses: those are put together here.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

from rtshcua.app.logs import finding_code
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.render.verdict import HELPS, meaning_of


class LogSlug(NamedTuple):
    """A finding: its slug, what was found, what that means, the exit code, and what to do about it, if anything."""

    slug: str
    found: str
    meaning: str
    exit_code: ExitCode
    help: str = ""


_FOUND: Final = {
    "anchor/beyond": "a witness cosigned more records than the log has",
    "anchor/missing": "the log has records that too few witnesses cosigned, and `--require-anchor` asks for them",
    "anchor/root": "a witness cosigned other records than those of the log",
    "anchor/signature": "a note of a witness is damaged or forged, and says nothing",
    "archive/changed": "the file in the archive is not the one that was taken in",
    "archive/missing": "the archive does not have the file any more",
    "boundary/after-loss": "after the boundary was lost, a record tells of something that only a boundary makes",
    "boundary/beginning": "the boundary's session began with another flight, bundle or mode",
    "boundary/gap": "the boundary signed before a gap ended that stands before what it signed",
    "boundary/clock": "the boundary's own time of day contradicts that of a record",
    "boundary/differs": "a record is not what the boundary made, or one before it was left out",
    "boundary/frames": "the raw frames are not those that passed the boundary",
    "boundary/invented": "a record tells of more than the boundary made",
    "boundary/lost": "the boundary was lost in flight; it signed nothing of what follows",
    "boundary/missing": "a statement of the boundary is not there",
    "boundary/not-ended": "the log was closed, and the boundary did not sign that it ends there",
    "boundary/omitted": "the boundary made something that no record tells of",
    "boundary/other-flight": "a statement of the boundary is of another flight",
    "boundary/other-session": "a statement of the boundary is of another session",
    "boundary/record": "a record is of a form that no boundary makes",
    "boundary/replayed": "a statement of the boundary is older than one before it",
    "chain/broken": "a record does not name the hash of the one before it: one of the two was changed",
    "chain/sequence": "a record has another number than its place: records were taken out, added or moved",
    "clock/backwards": "the monotonic time of a record lies before that of the record before it",
    "clock/received": "the bundle was received after the log that holds it began",
    "clock/utc-backwards": "the time of day of a record lies before that of an earlier one, beyond their errors",
    "clock/utc-jump": "time of day and monotonic time went on differently, beyond the errors stated for both",
    "close/junk-after": "the signed log is over, and something stands behind it: zeros, a newline, or a record",
    "close/missing": "the log ends without its signed close",
    "decision/approvals": "the decision read other approvals than those that were accepted before it",
    "decision/cancelled": "a step was decided after the mission was cancelled",
    "decision/clause": "derived again, another clause decides",
    "decision/clause-at": "derived again, the clause that decides stands elsewhere in the sources",
    "decision/consumed": "the decision says otherwise than the records before it whether its step's id was used",
    "decision/durability": "the record is less durable than its contract asks for",
    "decision/inputs": "the inputs of the decision are none that can be",
    "decision/invocation": "the decision names another invocation than its bundle",
    "decision/mode": "the decision names another enforcement mode than its log",
    "decision/monitor": "no states that were recorded allow what a temporal monitor said",
    "decision/not-current": "a step was decided that was not the mission's turn",
    "decision/outcome": "derived again, the decision has another outcome",
    "decision/policy-version": "the decision names another version of the policy than its bundle",
    "decision/reason": "derived again, the decision has another reason",
    "decision/recalled": "a step was decided after the mission was recalled",
    "decision/released": "the step was released at another time than the records before it show",
    "decision/rule-step": "derived again, another check decides",
    "decision/target": "derived again, another fallback is chosen",
    "decision/target-link": "derived again, another link of the fallback is chosen",
    "decision/unknown-step": "the decision is about a step that the bundle does not have",
    "decision/valid-until-us": "derived again, the decision is valid until another time",
    "decision/vehicle": "the decision is about another vehicle",
    "dispatch/backwards": "a fallback went back to a link before the one that flew",
    "dispatch/cancelled": "a step was sent after the mission was cancelled",
    "dispatch/lapsed": "a link was sent that stood for nothing any more",
    "dispatch/late": "a command was sent after its permit was over",
    "dispatch/mission-over": "a step was sent after a return or a landing began",
    "dispatch/not-permitted": "a command was sent that no record before it permits",
    "dispatch/other-skill": "another skill was sent than the one that was permitted",
    "dispatch/out-of-turn": "a step was sent that was not the mission's turn",
    "dispatch/recalled": "a step was sent after the mission was recalled",
    "dispatch/was-sent": "a step came again of which something may have been sent",
    "document/base64": "a document in the log is not base64 as it is written here",
    "document/other": "a document is of another kind than its record says",
    "frames/early": "a frame that carries out a command left before the record that permits it",
    "frames/other-command": "a frame carries out something else than was permitted",
    "frames/parameter-in-flight": "a frame sets a parameter of a vehicle that does not stand on the ground",
    "frames/unlisted-parameter": "a frame sets a parameter that no record lists",
    "frames/unrecorded": "a frame commands the vehicle, and no record permits it",
    "frames/was-sent": "a frame carries out a step of which the log says that nothing was sent",
    "genesis/base64": "the trust root or the bundle in the log is not base64 as it is written here",
    "genesis/format": "the log is of another format, or of a version that this program does not read",
    "genesis/log-key": "the name of the log key is not that of the key",
    "genesis/missing": "the log does not begin with its first record: its beginning was cut off",
    "genesis/mission": "the log names another mission than its bundle",
    "genesis/other-bundle": "the log is of another bundle than the one beside it",
    "genesis/repeated": "a second log begins inside the log",
    "log/empty": "the file is empty",
    "preparation/in-flight": "parameters were to be set while a command was under way",
    "preparation/malformed": "the list of parameters to be set makes no sense",
    "preparation/other-permit": "the boundary permitted other parameters than were listed",
    "preparation/other-value": "a parameter was put back to another value than it had",
    "preparation/parameter": "a parameter is none that may be set",
    "preparation/value": "a parameter was to be set to a value that it may not have",
    "record/malformed": "a line is not a record",
    "record/not-canonical": "a line says the same as a record in other octets",
    "record/too-long": "a line is longer than any record",
    "seal/after": "a signature does not follow that of the signed record before it",
    "seal/bytes": "a signed record counts other octets than its epoch has",
    "seal/digest": "the octets of an epoch are not those that were signed",
    "seal/epoch": "a signed record ends another epoch: one was taken out, put in or moved",
    "seal/gap": "a recorded gap is not the time between the records beside it, or the second one of its epoch",
    "seal/key": "a record is signed by another key than the signed record before it names",
    "seal/missing": "records stand where their epoch should have been sealed before, and no recorded gap explains it",
    "seal/next-key": "a signature names another key for what follows than its record",
    "seal/note": "a signature is not of the form of one, or is missing",
    "seal/records": "a signed record counts other records than its epoch has",
    "seal/root": "the records are not those that were signed, and the chain was written anew",
    "seal/self": "a signed record was changed after it was signed",
    "seal/signature": "a signature does not hold",
    "seal/size": "a signature is for another number of records",
    "tail/torn": "the log ends inside a record",
    "telemetry/changed": "the raw frames beside the log are not those of its close",
    "trust/log-key": "the trust root does not entitle the key that signed the log",
    "trust/revoked-key": "a key that the log rests on was revoked before it signed",
    "trust/revoked-log-key": "the key that signed the log was revoked since",
    "trust/revoked-when": "it is not known whether a key was revoked before it signed",
    "trust/root-revoked-key": "the key that signed the trust root was revoked",
}  # fmt: skip
#: what is wrong with something signed, by the slug of the refusal; `{}` is what was signed
_REFUSED: Final = {
    "already-answered": "{} answers what was answered already",
    "already-decided": "{} came after its step was decided",
    "already-released": "{} replaces a step that was released already",
    "bad-signature": "the signature of {} does not hold",
    "before-mission": "{} was issued before its mission",
    "binding-mismatch": "an invocation of {} is not what its binding covers",
    "cancelled": "{} came after the mission was cancelled",
    "development-key": "{} names a development key in a root that is none",
    "development-root": "{} is a development root, which was not pinned",
    "expired": "{} had expired",
    "fork": "{} is another root of the same version",
    "id-mismatch": "an id of {} is not the one of its invocation",
    "id-seen": "{} has an id that was used before",
    "issued-in-future": "{} was issued later than it was taken in",
    "key-expired": "the key that signed {} had expired",
    "key-other-policy": "{} is under a policy that its key may not sign for",
    "malformed": "{} is not of its form",
    "no-step": "{} is about a step that the mission does not have",
    "not-asked": "{} answers what nobody asked",
    "not-self-signed": "{} is not signed by a root key of its own",
    "other-flight": "{} is of another flight",
    "other-mission": "{} is about another mission",
    "other-policy": "{} is under another policy",
    "other-steps": "{} keeps other steps than those that were flown",
    "recalled": "{} came after the mission was recalled",
    "revoked-key": "the key that signed {} was revoked",
    "rollback": "{} is older than a root that was known",
    "root-expired": "the trust root of {} had expired",
    "shared-key": "{} names one key for two duties",
    "superseded": "{} came after a newer one",
    "too-large": "{} is too large",
    "too-long-lived": "{} is valid for longer than it may be",
    "too-many": "{} is one more than a flight takes",
    "unknown-document": "{} is no kind of document that there is",
    "unknown-format": "{} is of another format",
    "unknown-invocation": "{} is about an invocation that the mission does not have",
    "unknown-key": "no key that is trusted for it signed {}",
    "unknown-version": "{} is of a version that this program does not read",
    "unpinned": "another key than the pinned one signed {}",
    "unreachable-threshold": "{} asks for more signers than it names",
    "unsupported-threshold": "{} asks for more than one signer of a duty that has one",
    "unrevoked": "{} trusts a key again that was revoked",
    "version-gap": "{} skips a version",
    "whose-approval": "an approval key of {} is of no one person in one role",
    "wrong-content-type": "{} says that it is something else",
    "wrong-duty": "{} is signed by a key of another duty",
    "wrong-policy": "{} is under another policy than its key may sign for",
    "wrong-role": "{} is in a role that its key may not speak for",
    "wrong-source": "{} is from a source that its key may not speak for",
    "wrong-vehicle": "{} is for another vehicle",
}
_SIGNED: Final = {
    "boundary": "a statement of the boundary",
    "document": "an approval, recall, replacement or cancellation",
    "trust/root": "the trust root",
    "trust/bundle": "the bundle",
}
#: what makes a log incomplete, and not fail
_SHORT: Final = frozenset({
    "anchor/missing", "boundary/lost", "close/missing", "tail/torn", "trust/revoked-log-key", "trust/revoked-when",
})  # fmt: skip


def find(word: str) -> LogSlug | None:
    """The finding of a slug, however it is written: `Seal/Missing` too."""
    slug = word.lower().replace("_", "-")
    found = _FOUND.get(slug) or _signed(slug)
    if found is None:
        return None
    code = ExitCode.INCOMPLETE if slug in _SHORT else finding_code(slug)
    return LogSlug(slug, found, meaning_of(slug, failed=slug not in _SHORT), code, HELPS.get(slug, ""))


def every() -> Iterator[str]:
    """All slugs: those of one thing each by name, and behind them those of what was signed and is refused."""
    yield from sorted(_FOUND)
    yield from (f"{kind}{'-' if '/' in kind else '/'}{slug}" for kind in _SIGNED for slug in _REFUSED)


def _signed(slug: str) -> str | None:
    for kind, what in _SIGNED.items():
        prefix = f"{kind}-" if "/" in kind else f"{kind}/"
        if slug.startswith(prefix) and (text := _REFUSED.get(slug.removeprefix(prefix))):
            return text.format(what)
    return None
