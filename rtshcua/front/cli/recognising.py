"""Names the kind of a file that stands where another kind was asked for."""

from pathlib import Path
from typing import Final

from rtshcua.adapters.store.reading import open_regular, read_regular
from rtshcua.diagnostics.kinds import BUNDLE, DOCUMENT, EMPTY, LOG, LOOKED_AT, Kind, recognised
from rtshcua.wire.bundle import MAX_BUNDLE
from rtshcua.wire.untrusted import Untrusted

_BUNDLES: Final = "accepted: a bundle, as `rtshcua compile` makes it"


class Mistaken(Untrusted):
    """A file of another kind than was asked for; `help` is what is done with one."""

    def __init__(self, text: str, help: str) -> None:
        super().__init__("wrong-kind", text)
        self.help = help


def kind_of(path: Path) -> Kind | None:
    """What a file is; None where nothing tells, also where it cannot be read."""
    try:
        with open_regular(path) as file:
            data = file.read(LOOKED_AT)
            return recognised(data, path.name) if data else EMPTY
    except OSError:
        return None


def no_log(path: Path, name: Path, help: str) -> tuple[str, str]:
    """What to say of a file that is no log, which was given by a name: in words, and what would help."""
    kind = kind_of(path)
    if kind is None or kind is LOG:
        return f"`{name}` is not a log of this program", help
    return f"`{name}` is {kind.name}, and no log", f"{kind.help}; {help}" if kind.help else help


def no_bundle(path: Path) -> Mistaken | None:
    """Why a file is surely no bundle; None where it may be one."""
    kind = kind_of(path)
    if kind is None or kind in (BUNDLE, DOCUMENT):
        return None
    return Mistaken(f"`{path}` is {kind.name}, and no bundle", kind.help or _BUNDLES)


def read_bundle(path: Path) -> bytes:
    """A bundle's octets. Raises `Mistaken` for what is of another kind, and OSError."""
    data = read_regular(path, MAX_BUNDLE)
    mistaken = no_bundle(path)
    if mistaken is not None:
        raise mistaken
    return data
