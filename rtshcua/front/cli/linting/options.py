"""What `rtshcua lint` is asked for."""

from pathlib import Path
from typing import NamedTuple

FORMATS = ("human", "json", "sarif", "github", "junit")


class Options(NamedTuple):
    """The command line, after it was read; each is explained in `rtshcua/front/cli/lint.py`."""

    paths: tuple[Path, ...]
    format: str = "human"
    output: Path | None = None
    fail_on: str | None = None
    with_: tuple[Path, ...] = ()
    changed: bool = False
    base: str | None = None
    config: Path | None = None
    isolated: bool = False
    fix: bool = False
    unsafe_fixes: bool = False
    diff: bool = False
    no_cache: bool = False
    statistics: bool = False
    json: bool = False

    @property
    def fixes(self) -> bool:
        """Whether fixes are made, or shown."""
        return self.fix or self.unsafe_fixes or self.diff
