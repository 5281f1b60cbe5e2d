"""`rtshcua approve`: answer a step that asks for confirmation."""

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
AGREE: Final = "`--refuse` says no; `--other-path` agrees to it; ask who signed it, or compile the mission again"


@app.command()
def approve(
    bundle: FlyingBundle,
    step: Annotated[int, typer.Option(min=1, help="the number of the step, from 1")],
    role: Annotated[str | None, typer.Option(help="who you are, where several are asked")] = None,
    refused: Annotated[bool, typer.Option("--refuse", help="say no: the step is denied, whoever else agrees")] = False,
    seconds: Annotated[int, typer.Option("--for", min=1, max=MOST_S, help="how many seconds the answer is good")]
    = 300,
    replacement: Annotated[
        list[Path] | None, typer.Option(help="a replacement that is in force since, in order (repeatable)")
    ] = None,
    to: FlightSocket = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="write the signed answer here")] = None,
    root: SignedRoot = None,
    flight: FlightId = None,
    person: Person = None,
    approval_key: ApprovalKey = None,
    passphrase_file: PassphraseFile = None,
    other_path: Annotated[
        bool, typer.Option("--other-path", help="agree also to a path that is not the planner's for what is asked")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="sign without asking, at a terminal too; for scripts")] = False,
    as_json: AsJson = False,
) -> ExitCode:  # fmt: skip
    """Answer the `confirm` rules that ask you about one step of one mission: yes, or no.

    What you answer is told first, from the step's skill and arguments, each zone with its size and its way from home;
    at a terminal you are then asked whether to sign it. Without a terminal it is told and signed. A path in a zone is
    worked out again from zone and arguments: where another one is to be flown, a yes takes `--other-path`.

    The bundle is verified first, so that you sign what it says. The answer is good for that step of that mission alone,
    on its vehicle, and for a bounded time; a step that flies already is not recalled by it.
    """
    if to is None and output is None:
        return fail(ExitCode.USAGE, "the answer has to go somewhere", WHERE)
    now_us = time.time_ns() // 1000
    try:
        flying = bundle_in_flight(bundle, replacement or [], root, now_us, stops=refused)
        # a no is told in our words too, which nonsense has not
        (ready,) = prepare_missions(flying.policy, [flying.mission])
        steps = flying.mission.invocations
        if step > len(steps):
            return fail(ExitCode.USAGE, f"there is no step {step}", f"accepted: 1 to {len(steps)}")
        about = steps[index_of(step)]
        asked = _roles(ready[index_of(step)])
        if role is None and len(asked) == 1:
            role = asked[0]
        if role is None or role not in asked:
            return _not_asked(ready[index_of(step)], role, asked)
        name = flight_id(flight, to)
        if name is None:
            return fail(ExitCode.USAGE, "the answer is for one flight", WHOSE)
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
        mission = shorten(flying.mission.name, NAME_SHOWN)  # the proposer's word: it pushes nothing out of sight
        say(f"step {step} of `{mission}` on `{said.vehicle}`: `{told}`")
        planned = path_planned_otherwise(flying.policy, about)
        if planned is not None:
            told += ", a path that is not the planner's"
            say(f"who signed the mission chose another path than the planner does: {_other(planned)}")
            if not refused and not other_path:
                return fail(ExitCode.REFUSED, "nothing was signed: the path is not the planner's", AGREE, slug=OTHER)
        store = KeyStore(data_folder())
        if approval_key is None:
            person_key(store, person, role)  # nobody is asked to sign what their key may not
        question = visible(f"sign that {_answer(refused)} as {role}?")
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
        return "it finds none there"
    apart = f"the two are up to {words.length(planned.apart)} apart"
    return f"its has {planned.points} points, {words.length(planned.length)} in all, and {apart}"


def _answer(refused: bool) -> str:
    return "it is refused" if refused else "it may be flown"


def _roles(of: PreparedInvocation) -> list[str]:
    """Who may be asked: by a rule whose condition can hold for the step's arguments."""
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
            help = f"{text} cannot hold for the arguments of the step"
        return fail(ExitCode.USAGE, f"no `confirm` of the policy asks anybody about step {step}", help)
    names = ", ".join(f"`{name}`" for name in asked)
    what = f"several roles are asked about step {step}" if role is None else f"`{role}` is not asked about step {step}"
    return fail(ExitCode.USAGE, what, f"accepted: --role {names}")
