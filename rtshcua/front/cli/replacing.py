"""`rtshcua compile --replaces`: sign a mission as a replacement for a flight under way."""

from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.writing import replace
from rtshcua.app.exit_codes import code_of
from rtshcua.app.flight_documents import bundle_in_flight, flight_id
from rtshcua.app.signing_keys import check_trusted, strangers
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import say
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.stdout import out
from rtshcua.front.cli.unlock import unlock_for
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.step_number import number_of, step_words
from rtshcua.wire.bundle import policy_digest, policy_payload
from rtshcua.wire.document import MAX_DOCUMENT, DocumentError
from rtshcua.wire.replacement import sign_replacement
from rtshcua.wire.untrusted import Untrusted

_SAME_POLICY = "a replacement must fly under the policy in force: compile it with the same policy sources"


class Replacing(NamedTuple):
    """The request: the bundle and its replacements so far, the index of the first replaced step, the flight, the keys
    and the file to write.
    """

    replaces: list[Path]
    first: int
    flight: str
    root: Path | None
    mission_key: Path | None
    passphrase_file: Path | None
    issued_at_us: int
    deny_warnings: bool
    target: Path


def warned(warnings: list[str], findings: Findings, *, deny: bool) -> bool:
    """Print warnings about keys that the trust root does not name; return False if `deny` makes them an error."""
    if warnings and deny:
        findings.refuse(ExitCode.UNTRUSTED, "unknown-key", warnings[0], "sign with keys that the root names")
        return False
    for each in warnings:
        say(f"warning: {each}")
    return True


def replace_with(
    policy: Policy, mission: Mission, order: Replacing, store: KeyStore, findings: Findings, *, quiet: bool
) -> ExitCode:
    """Sign a compiled mission as a replacement, if it keeps the policy and the steps before `--from`."""
    try:
        over = bundle_in_flight(order.replaces[0], order.replaces[1:], order.root, order.issued_at_us)
        flown = len(over.mission.invocations)
        if order.first > flown:
            text = f"`--from {number_of(order.first)}` is out of range: the flying mission has {flown} steps"
            return findings.refuse(ExitCode.USAGE, "usage", text, f"accepted: 1 to {number_of(flown)}")
        if policy_digest(policy_payload(policy)) != over.policy_digest:
            text = (
                f"the policy of the sources differs from `{over.policy.name}@{over.policy.version}`, which is in force"
            )
            return findings.refuse(ExitCode.REFUSED, "wrong-policy", text, _SAME_POLICY)
        name = flight_id(order.flight, None)
        assert name is not None
        key = unlock_for(store, mission, path=order.mission_key, passphrase_file=order.passphrase_file)
        check_trusted(store, key, policy, mission)
        warnings = strangers(store, [key], policy.vehicle.identity, order.issued_at_us)
        document = sign_replacement(mission, over=over, flight=name, kept=order.first, key=key)
    except DocumentError as error:
        return findings.refuse(
            ExitCode.REFUSED, error.slug, str(error), "the steps before `--from` must stay unchanged"
        )
    except Untrusted as error:
        help = "run `rtshcua keys init` to create a development root" if error.slug == "no-keys" else None
        return findings.refuse(code_of(error.slug), error.slug, str(error), help)
    if len(document) > MAX_DOCUMENT:
        text = f"the replacement is {len(document)} bytes; the limit is {MAX_DOCUMENT}"
        return findings.refuse(ExitCode.REFUSED, "too-large", text)
    if not warned(warnings, findings, deny=order.deny_warnings):
        return ExitCode.UNTRUSTED
    replace(order.target, document)
    steps = len(mission.invocations)
    if not quiet:
        out(f"{mission.name}: {steps} steps, new from {step_words(order.first)}, signed into {order.target}")
    return findings.finish(
        ExitCode.OK,
        replacement={
            "path": str(order.target),
            "bytes": len(document),
            "mission": mission.name,
            "supersedes": over.mission_digest.hex(),
            "from_step_number": number_of(order.first),
            "steps": steps,
            "mission_key": key.kid.hex(),
        },
        warnings=warnings,
    )
