"""`--since`: the policies of an earlier bundle, source or folder."""

from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.store.reading import read_regular
from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.asked import SOURCE, SPECIFICATION, unfolded
from rtshcua.front.cli.programs import programs
from rtshcua.front.cli.sources import examine
from rtshcua.model.flat.policy import Policy
from rtshcua.wire.bundle import MAX_BUNDLE
from rtshcua.wire.untrusted import Untrusted


class Earlier(NamedTuple):
    """Policies, and where they are from."""

    name: str
    policies: tuple[Policy, ...]


def earlier_policies(path: Path) -> Earlier | Refusal:
    """The policies of a bundle, whoever signed it, or of sources, which must be free of errors."""
    if not path.is_dir() and path.suffix.lower() not in (SOURCE, SPECIFICATION):
        return _bundled(path)
    files = unfolded([path])
    if isinstance(files, Refusal):
        return files
    policies: list[Policy] = []
    for each in programs(files):
        checked = examine(each.reading)
        if has_errors(checked.diagnostics):
            message = f"`{each.name}` has errors, so nothing can be held against it"
            return Refusal("since", message, f"`rtshcua check {path}` shows them")
        policies += [lowered.policy for lowered in checked.policies]
    return Earlier(str(path), tuple(policies))


def _bundled(path: Path) -> Earlier | Refusal:
    try:
        data = read_regular(path, MAX_BUNDLE)
    except OSError as error:
        why = (error.strerror or "it is unreadable").lower()
        return Refusal("since", f"cannot read `{path}`: {why}")
    from rtshcua.front.cli.showing.bundle import claimed  # brings cryptography

    try:
        return Earlier(str(path), (claimed(data).policy,))
    except Untrusted as error:
        return Refusal(error.slug, f"`{path}`: {error}", "accepted: a bundle, a source or a folder of sources")
