"""`rtshcua init`: create a project that passes its own lint and tests."""

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

#: the name of the shipped example; in its files it is replaced by the name of the project
EXAMPLE = "starter"

#: the files of a project, in reading order
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
    directory: Annotated[Path, typer.Argument(help="folder of the new project")] = Path(),
    name: Annotated[str | None, typer.Option(help="name of its policy [default: from the folder]")] = None,
    force: Annotated[bool, typer.Option("--force", help="replace existing files of the project")] = False,
    keep: Annotated[bool, typer.Option("--keep", help="keep existing files and create the missing ones")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")] = False,
) -> ExitCode:
    """Create a project: a site with its vehicle, a policy, a skill, a mission, tests, settings and CI.

    The project passes `rtshcua fmt --check`, `lint` and `test`, and its mission flies on the simulated vehicle. Replace
    its places, rules and tests with your own. Existing files are not changed, and a failed run leaves nothing behind.
    In a repository that already has a README.md, .gitignore or LICENSE, use --keep.

    Exit codes: 0 created; 2 the name cannot be a policy's name, or both --force and --keep are used; 3 files of these
    names exist; 74 they cannot be written.
    """
    if force and keep:
        return fail(ExitCode.USAGE, "`--force` and `--keep` cannot be combined", "choose one of them")
    chosen = name if name is not None else _named_after(directory)
    if not _NAME.fullmatch(chosen):
        help = "accepted: at most 40 lower-case letters, digits and `_`, beginning with a letter"
        return fail(ExitCode.USAGE, f"`{chosen}` is not a valid policy name", help, slug="name")
    files = project(chosen)
    wrong = _first_finding(files)
    if wrong is not None:
        return fail(
            ExitCode.USAGE,
            f"`{chosen}` cannot be the name of the project: {wrong}",
            "choose another with `--name`",
            slug="name",
        )
    kept = tuple(file for file in files if keep and (directory / file).is_file())
    made = {file: data for file, data in files.items() if file not in kept}
    try:
        taken = lay(made, directory, replace=force)
    except OSError as error:  # whatever the error, the fault is in writing
        return fail(ExitCode.FULL, f"cannot write to `{directory}`: {words_of(error)}")
    if taken is not None:
        return _is_there(taken)
    _tell(directory, chosen, [*made], kept, None if name is not None else _renamed(directory, chosen), as_json)
    return ExitCode.OK


def _is_there(taken: Taken) -> ExitCode:
    """Fail because files of the project exist, or because something that is not a file is in the way."""
    there = ", ".join(f"`{path}`" for path in taken.paths)
    if not taken.replaceable:
        text = f"no file was created, because a file or folder is in the way: {there}"
        return fail(ExitCode.INPUT, text, slug="in-the-way")
    help = "`--keep` keeps them and creates the rest; `--force` replaces them; or choose an empty folder"
    return fail(ExitCode.INPUT, f"no file was created, because these exist: {there}", help, slug="exists")


def project(name: str) -> dict[str, bytes]:
    """Return the files of a new project by their relative paths."""
    place = root() / "examples" / EXAMPLE
    word = re.compile(rf"\b{EXAMPLE}\b")
    return {file: word.sub(name, (place / file).read_text(encoding="utf-8")).encode() for file in FILES}


def _named_after(directory: Path) -> str:
    """Return a policy name made from the folder's name: `My-Site 2` gives `my_site_2`."""
    word = re.sub(r"[^a-z0-9]+", "_", directory.absolute().resolve().name.lower()).strip("_")
    return (word if re.match("[a-z]", word) else f"site_{word}")[:40].rstrip("_")


def _renamed(directory: Path, chosen: str) -> str | None:
    """Return a note if the policy's name differs from the folder's; None if they are equal."""
    folder = directory.absolute().resolve().name
    if folder == chosen:
        return None
    return f"`{folder}` is not a valid policy name, so the policy is named `{chosen}`; choose another with `--name`"


def _first_finding(files: Mapping[str, bytes]) -> str | None:
    """Return the first error of the new project, for example if its name is a keyword or already used; None if none."""
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
    out(f"created {name} in {directory.absolute()}:")
    for path in files:
        out(f"  {path}")
    if renamed is not None:
        out(renamed)
    if kept:
        out(f"kept unchanged: {', '.join(kept)}")
    out("next, in this folder: `rtshcua lint .`, `rtshcua test .`, and see README.md")
