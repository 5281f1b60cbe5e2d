"""`rtshcua init`: a project of one's own, which passes its own lint and tests at once."""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from rtshcua.adapters.store.laying import Taken, lay
from rtshcua.app.exit_codes import words_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import fail
from rtshcua.front.cli.stdout import out, out_json
from rtshcua.library import root

app = typer.Typer(add_completion=False)

#: the name of the shipped example, which stands in its files wherever the project's own goes
EXAMPLE = "starter"

#: what a project is made of; the order is that in which somebody would read it
FILES = (
    "README.md",
    "site.rts",
    "policies/rules.rts",
    "skills/look_around.rts",
    "missions/first_look.rts",
    "tests/rules.rts",
    "tests/flights.rts",
    "rtshcua.toml",
    ".pre-commit-config.yaml",
    ".github/workflows/policy.yml",
    ".gitignore",
)

_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")


@app.command()
def init(
    directory: Annotated[Path, typer.Argument(help="the folder to make it in")] = Path(),
    name: Annotated[str | None, typer.Option(help="its policy's name [default: after the folder]")] = None,
    force: Annotated[bool, typer.Option("--force", help="replace files of the same names; others stay")] = False,
    keep: Annotated[
        bool, typer.Option("--keep", help="keep files of the same names as they are, and make the others")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object on the standard output")] = False,
) -> ExitCode:
    """Make a project of your own: a site with its vehicle, a policy, a skill, a mission, tests, settings and CI.

    It passes `rtshcua fmt --check`, `lint` and `test` as it is, and flies on the simulated vehicle; put your own
    places, rules and tests in. Nothing that is there already is touched; when it fails, nothing is left behind. In a
    repository that has its README.md, .gitignore or a LICENSE, --keep makes what is missing.

    Ends with 0 where it was made, 2 where the name cannot name a policy or --force and --keep are both given, 3 where
    files of the same names are there, 74 where they cannot be written.
    """
    if force and keep:
        return fail(ExitCode.USAGE, "`--force` replaces what `--keep` keeps", "choose one of them")
    chosen = name if name is not None else _named_after(directory)
    if not _NAME.fullmatch(chosen):
        help = "small letters, digits and `_`, a letter first, 40 at most"
        return fail(ExitCode.USAGE, f"`{chosen}` cannot be the name of a policy", help, slug="name")
    files = project(chosen)
    wrong = _first_finding(files)
    if wrong is not None:
        return fail(
            ExitCode.USAGE, f"the project cannot be called `{chosen}`: {wrong}", "--name chooses another", slug="name"
        )
    kept = tuple(file for file in files if keep and (directory / file).is_file())
    made = {file: data for file, data in files.items() if file not in kept}
    try:
        taken = lay(made, directory, replace=force)
    except OSError as error:  # whatever it is: what was asked for is there to be written
        return fail(ExitCode.FULL, f"cannot write to `{directory}`: {words_of(error)}")
    if taken is not None:
        return _is_there(taken)
    _tell(directory, chosen, [*made], kept, None if name is not None else _renamed(directory, chosen), as_json)
    return ExitCode.OK


def _is_there(taken: Taken) -> ExitCode:
    """Files of the same names are there, or what is no file."""
    there = ", ".join(f"`{path}`" for path in taken.paths)
    if not taken.replaceable:
        text = f"nothing was made, for a file or a folder is in the way: {there}"
        return fail(ExitCode.INPUT, text, slug="in-the-way")
    help = "--keep keeps these and makes the rest, --force replaces just these; or choose an empty folder"
    return fail(ExitCode.INPUT, f"nothing was made, for these are there: {there}", help, slug="exists")


def project(name: str) -> dict[str, bytes]:
    """Every file of a new project by its path in it."""
    place = root() / "examples" / EXAMPLE
    word = re.compile(rf"\b{EXAMPLE}\b")
    return {file: word.sub(name, (place / file).read_text(encoding="utf-8")).encode() for file in FILES}


def _named_after(directory: Path) -> str:
    """A name from the folder's: `My-Site 2` is `my_site_2`."""
    word = re.sub(r"[^a-z0-9]+", "_", directory.absolute().resolve().name.lower()).strip("_")
    return (word if re.match("[a-z]", word) else f"site_{word}")[:40].rstrip("_")


def _renamed(directory: Path, chosen: str) -> str | None:
    """Why the policy has another name than the folder; None where it has the same."""
    folder = directory.absolute().resolve().name
    if folder == chosen:
        return None
    return f"the folder's name `{folder}` cannot name a policy, so it is called `{chosen}`; `--name` chooses another"


def _first_finding(files: Mapping[str, bytes]) -> str | None:
    """What the checker says of it: a name may be a word of the language, or that of something else."""
    from rtshcua.app.check import EarlierPolicies, check_all
    from rtshcua.app.files import source_files
    from rtshcua.app.programs import programs

    with TemporaryDirectory(prefix="rtshcua-init-") as place:
        lay(files, Path(place))
        found = source_files([Path(place)])
        assert not isinstance(found, Refusal)
        checked = check_all(programs(found), EarlierPolicies("", ()))
    return None if not checked.diagnostics else checked.diagnostics[0].message


def _tell(
    directory: Path, name: str, files: list[str], kept: tuple[str, ...], renamed: str | None, as_json: bool
) -> None:
    if as_json:
        told = {"name": name, "folder": str(directory), "files": files, "kept": [*kept], "renamed": renamed}
        out_json(json.dumps(told, ensure_ascii=False))
        return
    out(f"made {name} in {directory.absolute()}:")
    for path in files:
        out(f"  {path}")
    if renamed is not None:
        out(renamed)
    if kept:
        out(f"kept as they were: {', '.join(kept)}")
    out("next, in there: `rtshcua lint .`, `rtshcua test .`, and what README.md says")
