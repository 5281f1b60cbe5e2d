"""Report the drawings that a command made: their paths, or a picture on standard output."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from rtshcua.app.pictures import STANDARD_OUTPUT, DrawnMissions
from rtshcua.app.wording import many
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.stdout import out, out_rendered

#: what to do where there is no mission
_NONE: Final = ": name a file with a mission, or draw the zones of a policy with `rtshcua docs`"


def tell_drawn(drawn: Sequence[DrawnMissions], picture: Path | None, findings: Findings, *, quiet: bool) -> None:
    """Print a picture for standard output; of other drawings say where they are, unless `quiet`. JSON has `picture`."""
    for each in drawn:
        if each.path == STANDARD_OUTPUT:
            out_rendered(each.text, end="")
        elif not quiet:
            out(f"{many(each.missions, 'mission')} drawn in {each.path}{'' if each.missions else _NONE}")
        if each.path == picture:
            findings.add(picture={"path": str(each.path), "missions": each.missions})
