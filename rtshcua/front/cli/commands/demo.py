"""`rtshcua demo`: four refusals and one flight of the simulated vehicle, in a minute."""

import json
import shlex
import textwrap
from pathlib import Path
from typing import Annotated, Final

import typer

from rtshcua.app.demonstration import DATA, PARTS, DemoBroken, PartBegun, PartSays, demonstrate
from rtshcua.app.exit_codes import words_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import fail, say
from rtshcua.front.cli.interrupts import breakable
from rtshcua.front.cli.stdout import out, out_json

app = typer.Typer(add_completion=False)

_WIDTH: Final = 80
#: what may be tried afterwards, in the folder of the demonstration
NEXT: Final = (
    ("rtshcua compile bridge.json --policy bridge_inspection -o again.bundle", "sign it again"),
    ("rtshcua run again.bundle --speed 10", "fly it again, with a live display"),
    ("rtshcua explain E0703", "what a refusal means, with examples"),
    ("rtshcua init mine", "a project of your own; then docs/tutorial.md"),
)

Folder = Annotated[Path, typer.Option(help="folder for keys, bundles, logs and the page; created if missing")]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object a line")]


@app.command()
def demo(folder: Folder = Path("rtshcua-demo"), as_json: AsJson = False) -> ExitCode:
    """Show what this is for: an agent's proposals are refused four times, and one flies, on the simulated vehicle.

    Each part is a command that you can repeat. Keys, bundles, logs and the page of the flight stay in the folder. Needs
    no vehicle and no network; takes about half a minute.

    Exit codes: 0 all went as it should; 74 the folder cannot be written; else that of the command that failed.
    """
    try:
        with breakable():
            for told in demonstrate(folder):
                _tell(told, as_json=as_json)
    except OSError as error:
        return fail(ExitCode.FULL, f"cannot write to `{folder}`: {words_of(error)}", "choose another `--folder`")
    except DemoBroken as broken:
        say(str(broken))
        return next((each for each in ExitCode if each == broken.code), ExitCode.USAGE)
    if not as_json:
        _tell_next(folder)
    return ExitCode.OK


def _tell(told: PartBegun | PartSays, *, as_json: bool) -> None:
    if as_json:
        fields: dict[str, object] = {"event": "begun" if isinstance(told, PartBegun) else "said"}
        out_json(json.dumps(fields | told._asdict()))
        return
    if isinstance(told, PartBegun):
        if told.number > 1:
            out("")
        out(f"{told.number} of {PARTS}  {told.title}")
        words = textwrap.wrap(
            shlex.join(("rtshcua", *told.words)), _WIDTH - 12, break_long_words=False, break_on_hyphens=False
        )
        for at, line in enumerate(words):
            out(f"  {'$' if at == 0 else ' '} {line}{'' if at + 1 == len(words) else ' ' + chr(92)}")
        return
    for line in textwrap.wrap(told.text, _WIDTH - 4):
        out(f"    {line}")


def _tell_next(folder: Path) -> None:
    out("")
    out("Try next")
    out(f"  cd {shlex.quote(str(folder))}")
    out(f"  export RTSHCUA_DATA_DIR=$PWD/{DATA}")
    for words, what in NEXT:
        out(f"  {words}")
        out(f"      {what}")
