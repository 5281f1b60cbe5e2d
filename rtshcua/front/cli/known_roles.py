"""The roles that the policies of a project know, as far as its sources lie here."""

from collections.abc import Iterable
from pathlib import Path
from typing import Final

from rtshcua.front.cli.faults import say

#: where a project has its sources (`rtshcua init`)
_FOLDERS: Final = (Path(), Path("policies"), Path("missions"))
#: of more sources than these nothing is said: it is no project, or takes too long
_MOST: Final = 40


def warn_of_unknown(roles: Iterable[str]) -> None:
    """Say of roles that no policy here knows: a key in such a role signs nothing that anybody asks for. It is no error,
    for a policy may come later, or lie elsewhere.
    """
    known = _known()
    for role in sorted(set(roles) - known) if known else ():
        names = ", ".join(f"`{name}`" for name in sorted(known))
        say(f"warning: no policy here knows the role `{role}`; its roles are {names}")


def _known() -> set[str]:
    try:
        files = [path for folder in _FOLDERS for path in sorted(folder.glob("*.rts")) if path.is_file()]
    except OSError:
        return set()
    if not 0 < len(files) <= _MOST:
        return set()
    from rtshcua.app.programs import examine, programs

    return {
        role for each in programs(files) for lowered in examine(each.reading).policies for role in lowered.policy.roles
    }
