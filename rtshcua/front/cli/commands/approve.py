"""`rtshcua approve`: approve or refuse a step that requires confirmation, or wait for such steps."""

import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Final

import typer

from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.app.approvals import (
    ApprovalDraft,
    ApprovalRequest,
    ApprovalSigner,
    DeskRequest,
    draft_approval,
    sign_draft,
    told_differs,
    told_other_path,
    told_spacing,
)
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
from rtshcua.wire.keys import SigningKey

#: how much of a mission's name is shown
NAME_SHOWN: Final = 80

app = typer.Typer(add_completion=False)

OTHER: Final = "other-path"
#: how long a page may learn how the flight ended, s
LAST_LOOK_S: Final = 2.0
WAITING: Final = "leave out `--step`, `--refuse`, `--output`, `--flight`, `--other-path` and `--yes`"
AGREE: Final = "refuse with `--refuse`, or accept the path with `--other-path`; or compile the mission again"


Step = Annotated[int | None, typer.Option(min=1, help="number of the step, from 1")]
Role = Annotated[str | None, typer.Option(help="your role, if several roles must confirm the step")]
Refused = Annotated[bool, typer.Option("--refuse", help="refuse: the step is denied even if others agree")]
Seconds = Annotated[int, typer.Option("--for", min=1, max=MOST_S, help="validity of the answer in seconds")]
Replacement = Annotated[list[Path] | None, typer.Option(help="a replacement in force, in order (repeatable)")]
Output = Annotated[Path | None, typer.Option("-o", "--output", help="write the signed answer to this file")]
OtherPath = Annotated[bool, typer.Option("--other-path", help="accept a path that differs from the planner's path")]
Yes = Annotated[bool, typer.Option("--yes", help="sign without a prompt; for scripts")]
Wait = Annotated[bool, typer.Option("--wait", help="wait for the steps that need your answer, until the flight ends")]
Page = Annotated[
    int | None,
    typer.Option("--page", metavar="PORT", min=0, max=65_535, help="also ask on a page on 127.0.0.1; 0: any port"),
]
Runs = Annotated[
    Path, typer.Option(metavar="FOLDER", help="where the flight keeps its log, which tells of agents' missions")
]


@app.command()
def approve(
    bundle: FlyingBundle,
    step: Step = None,
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
    wait: Wait = False,
    page: Page = None,
    runs: Runs = Path("runs"),
    as_json: AsJson = False,
) -> ExitCode:
    """Approve or refuse a step for which a `confirm` rule requires your role, or wait for such steps.

    The command verifies the bundle, then prints the step: its skill and arguments, and each zone with its size and its
    position relative to home. At a terminal it asks before it signs; without one it signs at once. It plans the path in
    a zone again; if the mission's path differs, an approval requires `--other-path`.

    The answer is valid for this step of this mission on its vehicle, and for a limited time. It does not stop a step
    that is already flying.

    With `--wait` it follows the flight, rings for each step that waits for your role, shows it with a map, and signs
    what you type; with `--page` also what you confirm on a page. Exit codes then: 0 the flight ended, or you left; 5 it
    is under another policy; 8 the connection was lost; 130 Ctrl-C.
    """

    def unlock(store: KeyStore, own: str) -> SigningKey:
        return unlock_person(store, person, own, path=approval_key, passphrase_file=passphrase_file)

    if wait or page is not None:
        if to is None or any((step, refused, output, flight, other_path, yes)):
            return fail(ExitCode.USAGE, "`--wait` needs `--to SOCKET`, and no options of a single answer", WAITING)
        waits = DeskRequest(bundle, replacement or (), to, runs, role, seconds, root)
        return _wait(waits, unlock, page, as_json=as_json)
    if step is None:
        return fail(ExitCode.USAGE, "no step: which one is answered?", "add `--step N`, or `--wait` to be asked")
    if to is None and output is None:
        return fail(ExitCode.USAGE, "no destination for the answer", WHERE)
    request = ApprovalRequest(bundle, step, role, refused, seconds, replacement or (), to, root, flight)
    signed = _signed(request, person, approval_key, unlock, other_path=other_path, yes=yes)
    return signed if isinstance(signed, ExitCode) else deliver(*signed, to=to, output=output, as_json=as_json)


def _signed(
    request: ApprovalRequest, person: str | None, key: Path | None, unlock: Callable[[KeyStore, str], SigningKey], *,
    other_path: bool, yes: bool,
) -> tuple[bytes, str] | ExitCode:  # fmt: skip
    """The signed answer to a step, and what it says; or the exit code, once it was said why nothing was signed."""
    draft = draft_approval(request)
    if isinstance(draft, Refusal):
        return refuse(draft)
    differs = told_other_path(draft)
    step_number = request.step
    told = _tell(draft, step_number, differs)
    if differs and not request.refused and not other_path:
        return fail(ExitCode.REFUSED, f"nothing was signed: {differs}", AGREE, slug=OTHER)
    own = draft.document.role
    question = visible(f"sign as {own} that {_answer(request.refused)}?")
    signer = ApprovalSigner(
        person, key,
        agrees=lambda: yes or not terminal() or typer.confirm(question, err=True),
        unlock=lambda store: unlock(store, own),
    )  # fmt: skip
    document = sign_draft(draft, signer)
    if isinstance(document, Refusal):
        return refuse(document)
    what = f"{'refused' if request.refused else 'approved'} as {own} for {request.seconds} s"
    return document, f"{what}: step {step_number}, `{told}`"


def _wait(
    request: DeskRequest, unlock: Callable[[KeyStore, str], SigningKey], port: int | None, *, as_json: bool
) -> ExitCode:
    """Ask at the terminal, and on a page if there is a port, until the flight ends."""
    # a single answer starts without these
    from rtshcua.app.approval_desk import open_desk
    from rtshcua.front.cli.approver_terminal import ApproverTerminal
    from rtshcua.front.web.approval_server import ApprovalPage

    desk = open_desk(request, unlock)
    if isinstance(desk, Refusal):
        return refuse(desk)
    with ExitStack() as open_:
        open_.callback(desk.close)
        asking = ApproverTerminal(desk, None if sys.stdin is None else sys.stdin.fileno(), as_json=as_json)
        page = None if port is None else open_.enter_context(ApprovalPage(desk, port))
        if page is not None:
            asking.tell("page", f"{page.address} opens the page for you, once, on this machine")
        code = asking.follow()
        if page is not None and page.session:
            time.sleep(LAST_LOOK_S)  # for the page to learn how it ended
        return code


def _tell(draft: ApprovalDraft, step: int, differs: str) -> str:
    """Print what is signed; return the step in words."""
    told = prose.step(draft.bundle.policy, draft.step)
    # chosen by the proposer: it must not push the rest out of sight
    mission = shorten(draft.bundle.mission.name, NAME_SHOWN)
    say(f"step {step} of `{mission}` on `{draft.document.vehicle}`: `{told}`")
    if draft.spacing is not None:
        say(told_spacing(draft))
    if not differs:
        return told
    say(f"warning: {differs}")
    return f"{told}, a path that {told_differs(draft)} the planner's"


def _answer(refused: bool) -> str:
    return "the step is refused" if refused else "the step may be flown"
