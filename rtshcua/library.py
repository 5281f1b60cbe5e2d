"""Where the shipped library is: the grammar, what ships written in the language, and a page for each code.

A wheel carries it inside the package (`rtshcua/_library/`, see the build section of pyproject.toml); a checkout, and
an editable install of it, has it beside the package. Only `front`, `app` and `evaluation` call this; other layers are
given a path.
"""

from errno import ENOENT
from functools import cache
from pathlib import Path

FOLDERS = ("grammar", "skills", "policies", "missions", "evaluation", "examples", "docs/codes")


@cache
def root() -> Path:
    """The absolute folder that holds every one of `FOLDERS`.

    Raises FileNotFoundError, naming what is missing and where it was looked for, when the installation is broken.
    """
    package = Path(__file__).resolve().parent
    shipped = package / "_library"
    place = shipped if shipped.is_dir() else package.parent
    missing = [name for name in FOLDERS if not (place / name).is_dir()]
    if missing:
        lost = ", ".join(f"`{name}/`" for name in missing)
        raise FileNotFoundError(ENOENT, f"this installation is broken, install it again: {lost} missing in", str(place))
    return place
