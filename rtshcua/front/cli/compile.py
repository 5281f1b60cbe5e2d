"""`rtshcua compile`: check a mission and sign it into a bundle."""

import time
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import PROPOSERS, KeyStore
from rtshcua.adapters.store.writing import replace_inside
from rtshcua.app.exit_codes import exit_code
from rtshcua.app.programs import compile_sources, meant, no_source
from rtshcua.app.wording import moment
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.bounds import bounds_dict, bounds_told
from rtshcua.front.cli.findings import Findings
from rtshcua.front.cli.replacing import Replacing, replace_with, warned
from rtshcua.front.cli.stdout import out
from rtshcua.front.cli.unlock import another_key, check_trusted, strangers, unlock, unlock_for
from rtshcua.ground.pipeline.pins import Pins, undeclared
from rtshcua.ground.pipeline.sign import sign
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.step_number import index_of
from rtshcua.wire.bundle import policy_digest, policy_payload
from rtshcua.wire.digest import BUNDLE, digest
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)


@app.command()
def compile(
    source: Annotated[Path, typer.Argument(help="a source with a mission (.rts), or a mission specification (.json)")],
    output: Annotated[Path | None, typer.Option("-o", "--output", help="the bundle [default: SOURCE.bundle]")] = None,
    mission: Annotated[str | None, typer.Option(help="which mission, where the source has several")] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", help='a parameter of the mission, as in height="20 m" (repeatable)')
    ] = None,
    at: Annotated[str | None, typer.Option(help="time of issue, such as 2026-01-31T08:00:00Z [default: now]")] = None,
    policy_key: Annotated[Path | None, typer.Option(help="the policy key [default: the key store's]")] = None,
    mission_key: Annotated[Path | None, typer.Option(help="the mission key [default: the key store's]")] = None,
    passphrase_file: Annotated[Path | None, typer.Option(help="a file with the keys' passphrase")] = None,
    with_: Annotated[
        list[Path] | None, typer.Option("--with", help="further sources: a specification's policy (repeatable)")
    ] = None,
    proposer: Annotated[
        str | None,
        typer.Option("--source", metavar="agent|operator", help="who proposes it [default: its word; .json: agent]"),
    ] = None,
    role: Annotated[str | None, typer.Option(help="the role that it is for [default: what it says]")] = None,
    policy: Annotated[
        str | None,
        typer.Option(metavar="NAME[@VERSION]", help="the policy that it is under [default: its word; .json: --with]"),
    ] = None,
    replaces: Annotated[
        list[Path] | None,
        typer.Option(help="the bundle that flies, then what replaced it since: make a replacement (repeatable)"),
    ] = None,
    first: Annotated[
        int | None,
        typer.Option("--from", min=1, help="with --replaces: the number of the first step that is another one"),
    ] = None,
    flight: Annotated[
        str | None, typer.Option(metavar="ID", help="with --replaces: the flight, by its id or a socket of it")
    ] = None,
    root: Annotated[Path | None, typer.Option(help="with --replaces: the signed trust root (the key store's)")] = None,
    deny_warnings: Annotated[bool, typer.Option("--deny-warnings", help="warnings are errors")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object on the standard output")] = False,
) -> ExitCode:
    """Check a mission and sign it into a bundle that can fly. Nothing is written when there are errors.

    With --replaces it is signed for a flight that is under way, under the policy that it flies under: the steps before
    --from stay as they are. `rtshcua replace` hands it in.

    What a mission says of its own source, role and policy gives it no authority: what it claims beyond --source, --role
    and --policy is an error. A specification (.json) is an agent's unless --source says otherwise, and its policy is
    named by --policy or handed in by --with.
    """
    sources_given = [source, *(with_ or [])]
    findings = Findings(json=as_json, deny_warnings=deny_warnings)
    issued_at = time.time_ns() // 1_000 if at is None else moment(at)
    if issued_at is None:
        return findings.refuse(ExitCode.USAGE, "usage", f"`{at}` is not a UTC time", "accepted: 2026-01-31T08:00:00Z")
    pins = _pins(proposer, role, policy)
    if pins is None:
        text = f"`--source {proposer}`" if proposer not in (None, *PROPOSERS) else f"`--policy {policy}`"
        help = f"accepted: {' or '.join(PROPOSERS)}" if "--source" in text else "accepted: a name, or as in `rules@7`"
        return findings.refuse(ExitCode.USAGE, "usage", f"{text} is none", help)
    if len({first is None, flight is None, not replaces}) > 1:
        return findings.refuse(ExitCode.USAGE, "usage", "`--replaces`, `--from` and `--flight` go together")
    unfit = no_source(source)
    if unfit is not None:
        return findings.end(unfit)
    target = output or source.with_suffix(".replacement" if replaces else ".bundle")
    if not target.parent.is_dir():
        return findings.refuse(ExitCode.INPUT, "output", f"there is no folder `{target.parent}` to write to")
    if target.exists() and (not target.is_file() or any(_same(target, each) for each in sources_given)):
        what = "one of the sources" if target.is_file() else "no regular file"
        return findings.refuse(ExitCode.USAGE, "output", f"`{target}` is {what}, and is not replaced by a bundle")
    compiled, sources = compile_sources(
        sources_given, mission=mission, issued_at_us=issued_at, values=tuple(set_ or ()), pins=pins
    )
    unknown = undeclared(pins, compiled.declared, compiled.diagnostics)
    if unknown is not None:
        return findings.end(unknown)
    told = meant(compiled.diagnostics, sources, sources_given)
    if findings.report(told, sources) or compiled.policy is None or compiled.mission is None:
        return findings.finish(exit_code(compiled.diagnostics))
    store = KeyStore(data_folder())
    if replaces and first is not None and flight is not None:
        order = Replacing(
            replaces, index_of(first), flight, root, mission_key, passphrase_file, issued_at, deny_warnings, target
        )  # fmt: skip
        return replace_with(compiled.policy, compiled.mission, order, store, findings, quiet=as_json)
    try:
        signers = (
            unlock(store, Duty.POLICY, path=policy_key, passphrase_file=passphrase_file),
            unlock_for(
                store, compiled.mission, path=mission_key, passphrase_file=passphrase_file, policy=compiled.policy
            ),
        )
        data = sign(compiled.policy, compiled.mission, policy_key=signers[0], mission_key=signers[1])
        check_trusted(store, signers[1], compiled.policy, compiled.mission)
        warnings = strangers(store, signers, compiled.policy.vehicle.identity, issued_at)
    except Untrusted as error:
        return findings.end(another_key(error, compiled.policy, compiled.mission))
    if not warned(warnings, findings, deny=deny_warnings):
        return ExitCode.UNTRUSTED
    replace_inside(target, data)
    if not as_json:
        out(_told(compiled.policy, compiled.mission, target))
        if compiled.bounds is not None:
            out(bounds_told(compiled.bounds))
    return findings.finish(
        ExitCode.OK,
        bundle=_described(compiled.policy, compiled.mission, target, data, signers),
        warnings=warnings,
        bounds=None if compiled.bounds is None else bounds_dict(compiled.bounds),
    )


def _pins(source: str | None, role: str | None, policy: str | None) -> Pins | None:
    """What was said of a mission on the command line; None where it makes no sense."""
    name, at, version = (policy or "").partition("@")
    numbered = version.isascii() and version.isdigit()
    if source not in (None, *PROPOSERS) or (policy is not None and not name) or (at and not numbered):
        return None
    return Pins(source, role, frozenset({name}) if name else None, int(version) if numbered else None)


def _same(one: Path, other: Path) -> bool:
    return other.exists() and one.samefile(other)


def _told(policy: Policy, mission: Mission, target: Path) -> str:
    steps = len(mission.invocations)
    head = f"{mission.name}: {steps} step{'s' * (steps > 1)} under {policy.name}@{policy.version}"
    return f"{head} for {policy.vehicle.identity}, signed into {target}"


def _described(
    policy: Policy, mission: Mission, target: Path, data: bytes, signers: tuple[SigningKey, SigningKey]
) -> dict[str, str | int]:
    return {
        "path": str(target),
        "bytes": len(data),
        "digest": digest(BUNDLE, data).hex(),
        "mission": mission.name,
        "policy": f"{policy.name}@{policy.version}",
        "policy_digest": policy_digest(policy_payload(policy)).hex(),
        "vehicle": policy.vehicle.identity,
        "steps": len(mission.invocations),
        "policy_key": signers[0].kid.hex(),
        "mission_key": signers[1].kid.hex(),
    }
