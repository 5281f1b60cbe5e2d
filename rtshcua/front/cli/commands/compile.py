"""`rtshcua compile`: check a mission and sign it into a bundle."""

import time
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.writing import replace_inside
from rtshcua.app.compile import (
    CompileRequest,
    CompileResult,
    SignedBundle,
    claimed_pins,
    compile_mission,
    draw,
    sign_bundle,
)
from rtshcua.app.exit_codes import exit_code
from rtshcua.app.pictures import STANDARD_OUTPUT
from rtshcua.app.signing_keys import another_key
from rtshcua.app.wording import moment
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.render.bounds import bounds_dict, bounds_told
from rtshcua.front.cli.render.drawn import tell_drawn
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.replacing import Replacing, replace_with, warned
from rtshcua.front.cli.stdout import out
from rtshcua.front.cli.unlock import unlock, unlock_for
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.step_number import index_of
from rtshcua.wire.bundle import policy_digest, policy_payload
from rtshcua.wire.digest import BUNDLE, digest
from rtshcua.wire.keys import Duty
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)

MissionSource = Annotated[
    Path, typer.Argument(help="a source with a mission (.rts), or a mission specification (.json)")
]
Output = Annotated[Path | None, typer.Option("-o", "--output", help="the bundle to write [default: SOURCE.bundle]")]
MissionName = Annotated[str | None, typer.Option(help="the mission to use if the source has several")]
Parameters = Annotated[
    list[str] | None, typer.Option("--set", help='set a parameter of the mission, as in height="20 m" (repeatable)')
]
IssuedAt = Annotated[str | None, typer.Option(help="time of issue, such as 2026-01-31T08:00:00Z [default: now]")]
PolicyKey = Annotated[Path | None, typer.Option(help="the policy key [default: the key store's]")]
MissionKey = Annotated[Path | None, typer.Option(help="the mission key [default: the key store's]")]
PassphraseFile = Annotated[Path | None, typer.Option(help="file with the passphrase of the keys")]
FurtherSources = Annotated[
    list[Path] | None, typer.Option("--with", help="additional sources, such as a specification's policy (repeatable)")
]
Proposer = Annotated[
    str | None,
    typer.Option("--source", metavar="agent|operator", help="the proposer [default: its own claim; .json: agent]"),
]
Role = Annotated[str | None, typer.Option(help="the role it is proposed for [default: its own claim]")]
PolicyPin = Annotated[
    str | None,
    typer.Option(metavar="NAME[@VERSION]", help="the policy it flies under [default: its own claim; .json: --with]"),
]
Replaces = Annotated[
    list[Path] | None,
    typer.Option(help="make a replacement for this flying bundle; name earlier replacements too (repeatable)"),
]
FirstStep = Annotated[
    int | None,
    typer.Option("--from", min=1, help="with --replaces: the number of the first replaced step"),
]
Flight = Annotated[
    str | None, typer.Option(metavar="ID", help="with --replaces: the flight, as its id or one of its sockets")
]
Root = Annotated[Path | None, typer.Option(help="with --replaces: the signed trust root (default: the key store's)")]
Picture = Annotated[
    Path | None,
    typer.Option(metavar="FILE.svg", help="draw the mission from above and from the side (-: standard output)"),
]
DenyWarnings = Annotated[bool, typer.Option("--deny-warnings", help="treat warnings as errors")]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")]


@app.command()
def compile(
    source: MissionSource,
    output: Output = None,
    mission: MissionName = None,
    set_: Parameters = None,
    at: IssuedAt = None,
    policy_key: PolicyKey = None,
    mission_key: MissionKey = None,
    passphrase_file: PassphraseFile = None,
    with_: FurtherSources = None,
    proposer: Proposer = None,
    role: Role = None,
    policy: PolicyPin = None,
    replaces: Replaces = None,
    first: FirstStep = None,
    flight: Flight = None,
    root: Root = None,
    picture: Picture = None,
    deny_warnings: DenyWarnings = False,
    as_json: AsJson = False,
) -> ExitCode:
    """Check a mission and sign it into a bundle that can fly. If there are errors, nothing is written except --picture.

    With --picture, the mission is drawn before it is signed, also if it has errors: zones, the route with its margins,
    ways home, heights and errors.

    With --replaces, the mission is signed as a replacement for a flight under way, under the same policy. The steps
    before --from stay unchanged. `rtshcua replace` sends it to the flight.

    The source, role and policy in a mission are claims and give no authority: a claim that exceeds --source, --role or
    --policy is an error. The source of a specification (.json) is an agent unless --source says otherwise; its policy
    is named with --policy or passed with --with.
    """
    findings = Findings(json=as_json, deny_warnings=deny_warnings)
    issued_at = time.time_ns() // 1_000 if at is None else moment(at)
    if issued_at is None:
        return findings.refuse(ExitCode.USAGE, "usage", f"`{at}` is not a UTC time", "accepted: 2026-01-31T08:00:00Z")
    pins = claimed_pins(proposer, role, policy)
    if isinstance(pins, Refusal):
        return findings.end(pins)
    if len({first is None, flight is None, not replaces}) > 1:
        return findings.refuse(ExitCode.USAGE, "usage", "`--replaces`, `--from` and `--flight` require each other")
    suffix = ".replacement" if replaces else ".bundle"
    values = tuple(set_ or ())
    request = CompileRequest(source, with_ or (), output, suffix, pins, issued_at, mission, values, picture, as_json)
    quiet = as_json or picture == STANDARD_OUTPUT
    made = _compiled(request, findings, quiet=quiet)
    if isinstance(made, ExitCode):
        return made
    store = KeyStore(data_folder())
    if replaces and first is not None and flight is not None:
        order = Replacing(
            replaces, index_of(first), flight, root, mission_key, passphrase_file, issued_at, deny_warnings, made.target
        )  # fmt: skip
        return replace_with(*made.to_sign, order, store, findings, quiet=quiet)
    keys = (policy_key, mission_key, passphrase_file)
    return _sign(made, store, keys, findings, issued_at, deny_warnings=deny_warnings, quiet=quiet)


def _compiled(request: CompileRequest, findings: Findings, *, quiet: bool) -> CompileResult | ExitCode:
    """Compile a mission, report the findings, and draw it if requested; the exit code if the command ends here."""
    made = compile_mission(request)
    if isinstance(made, Refusal):
        return findings.end(made)
    refused = findings.report(made.diagnostics, made.sources)
    drawn = None if request.picture is None else draw(made, request.picture)
    if isinstance(drawn, Refusal):
        return findings.end(drawn)
    if drawn is not None:
        tell_drawn([drawn], request.picture, findings, quiet=quiet)
    if refused or made.compiled.policy is None or made.compiled.mission is None:
        return findings.finish(exit_code(made.compiled.diagnostics))
    return made


def _sign(
    made: CompileResult, store: KeyStore, keys: tuple[Path | None, Path | None, Path | None], findings: Findings,
    issued_at: int, *, deny_warnings: bool, quiet: bool,
) -> ExitCode:  # fmt: skip
    """Sign a compiled mission into a bundle, and say so."""
    target, (policy_key, mission_key, passphrase_file) = made.target, keys
    policy, mission = made.to_sign
    try:
        signers = (
            unlock(store, Duty.POLICY, path=policy_key, passphrase_file=passphrase_file),
            unlock_for(store, mission, path=mission_key, passphrase_file=passphrase_file, policy=policy),
        )
        signed = sign_bundle(policy, mission, signers, store, issued_at)
    except Untrusted as error:
        return findings.end(another_key(error, policy, mission))
    if not warned(signed.warnings, findings, deny=deny_warnings):
        return ExitCode.UNTRUSTED
    replace_inside(target, signed.data)
    if not quiet:
        out(_told(policy, mission, target))
        if made.compiled.bounds is not None:
            out(bounds_told(made.compiled.bounds))
    return findings.finish(
        ExitCode.OK,
        bundle=_described(policy, mission, target, signed),
        warnings=signed.warnings,
        bounds=None if made.compiled.bounds is None else bounds_dict(made.compiled.bounds),
    )


def _told(policy: Policy, mission: Mission, target: Path) -> str:
    steps = len(mission.invocations)
    head = f"{mission.name}: {steps} step{'s' * (steps > 1)} under {policy.name}@{policy.version}"
    return f"{head} for {policy.vehicle.identity}, signed into {target}"


def _described(policy: Policy, mission: Mission, target: Path, signed: SignedBundle) -> dict[str, str | int]:
    return {
        "path": str(target),
        "bytes": len(signed.data),
        "digest": digest(BUNDLE, signed.data).hex(),
        "mission": mission.name,
        "policy": f"{policy.name}@{policy.version}",
        "policy_digest": policy_digest(policy_payload(policy)).hex(),
        "vehicle": policy.vehicle.identity,
        "steps": len(mission.invocations),
        "policy_key": signed.signers[0].kid.hex(),
        "mission_key": signed.signers[1].kid.hex(),
    }
