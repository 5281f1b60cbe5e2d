"""`rtshcua approve`: approve or refuse a step that requires confirmation."""

import time
from pathlib import Path
from typing import Annotated, Final

import typer

from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.app.exit_codes import untrusted
from rtshcua.app.flight_documents import MOST_S, bundle_in_flight, flight_id, prepare_missions
from rtshcua.app.signing_keys import person_key
from rtshcua.app.wording import shorten
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.documents import WHERE, WHOSE, deliver
from rtshcua.front.cli.faults import fail, refuse, say
from rtshcua.front.cli.options.document_options import (
    ApprovalKey,
    AsJson,
    FlightId,
    FlightSocket,
    FlyingBundle,
    PassphraseFile,
    Person,
    SignedRoot,
)
from rtshcua.front.cli.render.showing import words
from rtshcua.front.cli.unlock import terminal, unlock_person
from rtshcua.ground.analysis.solve import may_match
from rtshcua.ground.lower.signed_paths import PlannedPath, path_planned_otherwise
from rtshcua.model.step_number import index_of, number_of
from rtshcua.wire.approval import ApprovalDocument, confirms, sign_approval
from rtshcua.wire.untrusted import Untrusted

#: how much of a mission's name is shown
NAME_SHOWN: Final = 80

app = typer.Typer(add_completion=False)

OTHER: Final = "other-path"
AGREE: Final = "refuse with `--refuse`, or accept the path with `--other-path`; or compile the mission again"


@app.command()
def approve(
    bundle: FlyingBundle,
    step: Annotated[int, typer.Option(min=1, help="number of the step, from 1")],
    role: Annotated[str | None, typer.Option(help="your role, if several roles must confirm the step")] = None,
    refused: Annotated[bool, typer.Option("--refuse", help="refuse: the step is denied even if others agree")] = False,
    seconds: Annotated[int, typer.Option("--for", min=1, max=MOST_S, help="validity of the answer in seconds")]
    = 300,
    replacement: Annotated[
        list[Path] | None, typer.Option(help="a replacement in force, in order (repeatable)")
    ] = None,
    to: FlightSocket = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="write the signed answer to this file")] = None,
    root: SignedRoot = None,
    flight: FlightId = None,
    person: Person = None,
    approval_key: ApprovalKey = None,
    passphrase_file: PassphraseFile = None,
    other_path: Annotated[
        bool, typer.Option("--other-path", help="accept a path that differs from the planner's path")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="sign without a prompt; for scripts")] = False,
    as_json: AsJson = False,
) -> ExitCode:  # fmt: skip
    """Approve or refuse one step of a mission for which a `confirm` rule requires your role.

    The command verifies the bundle, then prints the step: its skill and arguments, and each zone with its size and its
    position relative to home. At a terminal it asks before it signs; without one it signs at once. It plans the path in
    a zone again; if the mission's path differs, an approval requires `--other-path`.

    The answer is valid for this step of this mission on its vehicle, and for a limited time. It does not stop a step
    that is already flying.
    """
    if to is None and output is None:
        return fail(ExitCode.USAGE, "no destination for the answer", WHERE)
    now_us = time.time_ns() // 1000
    try:
        flying = bundle_in_flight(bundle, replacement or [], root, now_us, stops=refused)
        # a refusal describes the step too, which requires a valid mission
        (ready,) = prepare_missions(flying.policy, [flying.mission])
        steps = flying.mission.invocations
        if step > len(steps):
            return fail(ExitCode.USAGE, f"the mission has no step {step}", f"accepted: 1 to {len(steps)}")
        about = steps[index_of(step)]
        asked = _roles(ready[index_of(step)])
        if role is None and len(asked) == 1:
            role = asked[0]
        if role is None or role not in asked:
            return _not_asked(ready[index_of(step)], role, asked)
        name = flight_id(flight, to)
        if name is None:
            return fail(ExitCode.USAGE, "the flight of the answer is unknown", WHOSE)
        said = ApprovalDocument(
            flight=name,
            mission=flying.mission_digest,
            invocation_id=about.invocation_id,
            binding=about.binding,
            vehicle=flying.policy.vehicle.identity,
            role=role,
            granted=int(not refused),
            issued_at_us=now_us,
            expires_at_us=now_us + seconds * 1_000_000,
        )
        told = words.step(flying.policy, about)
        mission = shorten(
            flying.mission.name, NAME_SHOWN
        )  # chosen by the proposer: it must not push the rest out of sight
        say(f"step {step} of `{mission}` on `{said.vehicle}`: `{told}`")
        planned = path_planned_otherwise(flying.policy, about)
        if planned is not None:
            told += ", a path that differs from the planner's"
            say(f"warning: the path in the mission differs from the planner's: {_other(planned)}")
            if not refused and not other_path:
                return fail(
                    ExitCode.REFUSED, "nothing was signed: the path differs from the planner's", AGREE, slug=OTHER
                )
        store = KeyStore(data_folder())
        if approval_key is None:
            person_key(store, person, role)  # fail before the prompt if the key may not sign for this role
        question = visible(f"sign as {role} that {_answer(refused)}?")
        if not yes and terminal() and not typer.confirm(question, err=True):
            return fail(ExitCode.REFUSED, "nothing was signed", slug="not-signed")
        key = unlock_person(store, person, role, path=approval_key, passphrase_file=passphrase_file)
        document = sign_approval(said, key)
    except Untrusted as error:
        return refuse(untrusted(error))
    what = f"{'refused' if refused else 'approved'} as {role} for {seconds} s: step {step}, `{told}`"
    return deliver(document, what, to=to, output=output, as_json=as_json)


def _other(planned: PlannedPath) -> str:
    if not planned.points:
        return "the planner finds none there"
    apart = f"up to {words.length(planned.apart)} from the mission's path"
    return f"the planner's path has {planned.points} points, is {words.length(planned.length)} long, and lies {apart}"


def _answer(refused: bool) -> str:
    return "the step is refused" if refused else "the step may be flown"


def _roles(of: PreparedInvocation) -> list[str]:
    """Return the roles of the `confirm` rules whose conditions can hold for the step's arguments."""
    policy = of.policy.policy
    return [
        name
        for number, name in enumerate(policy.roles)
        if any(may_match(of, rule) for rule in confirms(policy, of.invocation, number))
    ]


def _not_asked(of: PreparedInvocation, role: str | None, asked: list[str]) -> ExitCode:
    policy, step = of.policy.policy, number_of(of.invocation.step)
    if not asked:
        rules = {rule for number in range(len(policy.roles)) for rule in confirms(policy, of.invocation, number)}
        help = None
        if rules:
            text = " and ".join(f"`{policy.rules[each].text}`" for each in sorted(rules))
            help = f"{text} cannot hold for the step's arguments"
        return fail(ExitCode.USAGE, f"no `confirm` rule of the policy applies to step {step}", help)
    names = ", ".join(f"`{name}`" for name in asked)
    what = (
        f"several roles must confirm step {step}"
        if role is None
        else f"step {step} requires no confirmation by `{role}`"
    )
    return fail(ExitCode.USAGE, what, f"accepted: --role {names}")
