"""Sign a recall, or send one signed earlier. No typer here: a recall must start fast."""

from pathlib import Path
from typing import Final

from rtshcua.app.recalls import recall_in, recall_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.documents import WHERE, deliver
from rtshcua.front.cli.faults import fail, refuse

#: default validity of a recall, s
GOOD_S: Final = 300
#: help if another mission flies: one that an agent submitted has its own bundle
HELP: Final = {"other-mission": "`--policy` recalls every mission under the policy of this bundle"}
_SENT_HELP: Final = HELP | {"expired": "sign a new one: `rtshcua recall BUNDLE --to SOCKET`"}


def recall(
    bundle: Path | None, *, policy: bool = False, seconds: int = GOOD_S, to: Path | None = None,
    output: Path | None = None, send: Path | None = None, root: Path | None = None, flight: str | None = None,
    person: str | None = None, approval_key: Path | None = None, passphrase_file: Path | None = None,
    as_json: bool = False,
) -> ExitCode:  # fmt: skip
    """Run `rtshcua recall`. Raises OSError."""
    if send is not None:
        return _send(send, to, alone=bundle is None and output is None, as_json=as_json)
    if bundle is None:
        return fail(
            ExitCode.USAGE, "BUNDLE is missing", "name the flying bundle, or send a signed recall with `--send FILE`"
        )
    if to is None and output is None:
        return fail(ExitCode.USAGE, "no destination for the recall", WHERE)
    recalled = recall_of(bundle, root, flight, to, whole_policy=policy)
    if isinstance(recalled, Refusal):
        return refuse(recalled)
    from rtshcua.front.cli.unlock import unlock_person  # slow to import, and not needed for `--send`

    document = recalled.signed(
        lambda store: unlock_person(store, person, None, path=approval_key, passphrase_file=passphrase_file), seconds
    )
    if isinstance(document, Refusal):
        return refuse(document)
    return deliver(document, f"recalled {recalled.name}", to=to, output=output, as_json=as_json, help=HELP)


def _send(path: Path, to: Path | None, *, alone: bool, as_json: bool) -> ExitCode:
    """Send a recall signed earlier. Only its kind is checked here; the flight verifies it."""
    if not alone or to is None:
        text = "`--send` requires `--to SOCKET`, and conflicts with BUNDLE and `--output`"
        return fail(ExitCode.USAGE, text, "`rtshcua recall --send FILE --to SOCKET`")
    document = recall_in(path)
    if isinstance(document, Refusal):
        return refuse(document)
    return deliver(document, f"sent `{path}`", to=to, output=None, as_json=as_json, help=_SENT_HELP)
