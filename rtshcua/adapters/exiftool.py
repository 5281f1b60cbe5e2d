"""Run ExifTool (https://exiftool.org), which reads and writes the metadata of images.

It gets its arguments from its standard input, one in a line (`-@ -`), and never through a shell. Its configuration
files are programs, and it looks for one in the current folder too: they are off. The environment variables of Perl that
name code are removed.
"""

import json
import os
import shutil
import subprocess
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

#: seconds for one call, and for each file
PATIENCE: Final = 30.0
EACH: Final = 2.0
_NAME: Final = "exiftool"
_CODE: Final = ("PERL5LIB", "PERL5OPT", "PERLLIB", "PERL5DB", "EXIFTOOL_HOME")
_ALWAYS: Final = ("-charset", "filename=utf8")
_MOST_SAID: Final = 200


class ExifToolError(Exception):
    """ExifTool could not do it; the message is its own, shortened."""


def installed() -> str | None:
    """The program; None if it is not installed."""
    return shutil.which(_NAME)


def times_us(program: str, folder: Path, names: Sequence[str]) -> dict[str, int]:
    """The times of images by their own clock (DateTimeOriginal), in us as if it were UTC; those without one are left
    out. Raise ExifToolError.
    """
    wanted = [*_ALWAYS, "-j", "-DateTimeOriginal", "-SubSecTimeOriginal", *(str(folder / name) for name in names)]
    found: dict[str, int] = {}
    for each in json.loads(_run(program, wanted, len(names)) or "[]"):
        text, part = str(each.get("DateTimeOriginal", "")), str(each.get("SubSecTimeOriginal", ""))
        try:
            moment = datetime.strptime(text, "%Y:%m:%d %H:%M:%S").replace(tzinfo=UTC)
        except ValueError:
            continue
        fraction = int(part.ljust(6, "0")[:6]) if part.isascii() and part.isdecimal() else 0
        found[Path(each["SourceFile"]).name] = int(moment.timestamp()) * 1_000_000 + fraction
    return found


def write(program: str, arguments: Sequence[str], files: int) -> None:
    """Write tags by the lines of an argument file. Raise ExifToolError if any file was not written."""
    said = _run(program, [*arguments, "-common_args", *_ALWAYS], files)
    updated = sum(int(line.split()[0]) for line in said.splitlines() if line.strip().endswith("image files updated"))
    if updated != files:
        raise ExifToolError(f"it updated {updated} of {files} files")


def _run(program: str, lines: Sequence[str], files: int) -> str:
    """The standard output of a call."""
    if any("\n" in line or "\r" in line for line in lines):
        raise ExifToolError("an argument has a line break")
    try:
        given = "".join(f"{line}\n" for line in lines).encode()
    except UnicodeEncodeError:
        raise ExifToolError("the name of a file or of its folder is not UTF-8") from None
    kept = {name: value for name, value in os.environ.items() if name not in _CODE} | {"LC_ALL": "C"}
    try:
        done = subprocess.run(
            [program, "-config", "", "-@", "-"], input=given, capture_output=True, env=kept,
            timeout=PATIENCE + EACH * files, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ExifToolError(str(error)[:_MOST_SAID]) from None
    said = done.stdout.decode("utf-8", "replace")
    if done.returncode != 0:
        told = (done.stderr.decode("utf-8", "replace").strip() or said.strip()).splitlines()
        raise ExifToolError((told[0] if told else f"it ended with code {done.returncode}")[:_MOST_SAID])
    return said
