"""`rtshcua approve`: approve or refuse a step that requires confirmation."""

from pathlib import Path
from typing import Annotated, Final

import typer

from rtshcua.app.approvals import ApprovalDraft, ApprovalRequest, ApprovalSigner, draft_approval, sign_draft
from rtshcua.app.flight_documents import MOST_S
from rtshcua.app.telling import prose
from rtshcua.app.wording import shorten
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.documents import WHERE, deliver
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
from rtshcua.front.cli.unlock import terminal, unlock_person
from rtshcua.ground.lower.signed_paths import PlannedPath

#: how much of a mission's name is shown
NAME_SHOWN: Final = 80

app = typer.Typer(add_completion=False)

OTHER: Final = "other-path"
AGREE: Final = "refuse with `--refuse`, or accept the path with `--other-path`; or compile the mission again"


Step = Annotated[int, typer.Option(min=1, help="number of the step, from 1")]
Role = Annotated[str | None, typer.Option(help="your role, if several roles must confirm the step")]
Refused = Annotated[bool, typer.Option("--refuse", help="refuse: the step is denied even if others agree")]
Seconds = Annotated[int, typer.Option("--for", min=1, max=MOST_S, help="validity of the answer in seconds")]
Replacement = Annotated[list[Path] | None, typer.Option(help="a replacement in force, in order (repeatable)")]
Output = Annotated[Path | None, typer.Option("-o", "--output", help="write the signed answer to this file")]
OtherPath = Annotated[bool, typer.Option("--other-path", help="accept a path that differs from the planner's path")]
Yes = Annotated[bool, typer.Option("--yes", help="sign without a prompt; for scripts")]


@app.command()
def approve(
    bundle: FlyingBundle,
    step: Step,
    role: Role = None,
    refused: Refused = False,
    seconds: Seconds = 300,
    replacement: Replacement = None,
    to: FlightSocket = None,
    output: Output = None,
    root: SignedRoot = None,
    flight: FlightId = None,
    person: Person = None,
    approval_key: ApprovalKey = None,
    passphrase_file: PassphraseFile = None,
    other_path: OtherPath = False,
    yes: Yes = False,
    as_json: AsJson = False,
) -> ExitCode:
    """Approve or refuse one step of a mission for which a `confirm` rule requires your role.

    The command verifies the bundle, then prints the step: its skill and arguments, and each zone with its size and its
    position relative to home. At a terminal it asks before it signs; without one it signs at once. It plans the path in
    a zone again; if the mission's path differs, an approval requires `--other-path`.

    The answer is valid for this step of this mission on its vehicle, and for a limited time. It does not stop a step
    that is already flying.
    """
    if to is None and output is None:
        return fail(ExitCode.USAGE, "no destination for the answer", WHERE)
    request = ApprovalRequest(bundle, step, role, refused, seconds, replacement or (), to, root, flight)
    draft = draft_approval(request)
    if isinstance(draft, Refusal):
        return refuse(draft)
    told = _tell(draft, step)
    if draft.planned is not None and not refused and not other_path:
        return fail(
            ExitCode.REFUSED, f"nothing was signed: the path {_differs(draft.planned)} the planner's", AGREE, slug=OTHER
        )
    own = draft.document.role
    question = visible(f"sign as {own} that {_answer(refused)}?")
    signer = ApprovalSigner(
        person, approval_key,
        agrees=lambda: yes or not terminal() or typer.confirm(question, err=True),
        unlock=lambda store: unlock_person(store, person, own, path=approval_key, passphrase_file=passphrase_file),
    )  # fmt: skip
    document = sign_draft(draft, signer)
    if isinstance(document, Refusal):
        return refuse(document)
    what = f"{'refused' if refused else 'approved'} as {own} for {seconds} s: step {step}, `{told}`"
    return deliver(document, what, to=to, output=output, as_json=as_json)


def _tell(draft: ApprovalDraft, step: int) -> str:
    """Print what is signed; return the step in words."""
    told = prose.step(draft.bundle.policy, draft.step)
    # chosen by the proposer: it must not push the rest out of sight
    mission = shorten(draft.bundle.mission.name, NAME_SHOWN)
    say(f"step {step} of `{mission}` on `{draft.document.vehicle}`: `{told}`")
    if draft.spacing is not None:
        say(f"its grid has a line every {prose.length(draft.spacing)}, as the mission's signer chose for a camera")
    if draft.planned is None:
        return told
    say(f"warning: the path in the mission {_differs(draft.planned)} the planner's: {_other(draft.planned)}")
    return f"{told}, a path that {_differs(draft.planned)} the planner's"


def _differs(planned: PlannedPath) -> str:
    return "differs from" if planned.computable else "is not shown to be"


def _other(planned: PlannedPath) -> str:
    if not planned.computable:
        return "a bundle does not carry the line of a corridor, so the planner cannot compute it again"
    if not planned.points:
        return "the planner finds none there"
    if planned.levels:
        return "it has the planner's places, but other heights or headings"
    apart = f"up to {prose.length(planned.apart)} from the mission's path"
    return f"the planner's path has {planned.points} points, is {prose.length(planned.length)} long, and lies {apart}"


def _answer(refused: bool) -> str:
    return "the step is refused" if refused else "the step may be flown"
