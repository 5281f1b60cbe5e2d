"""`--fix`: apply fixes in rounds until none is left. A fix that causes an error is undone."""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

from rtshcua.app.lint.findings import LintFindings
from rtshcua.app.lint.session import LintSession
from rtshcua.diagnostics.codes import Severity
from rtshcua.ground.lint.fixes import fixed

#: most rounds; without a limit, fixes that undo each other would loop forever
_MOST = 50
_BOM = b"\xef\xbb\xbf"


class FixedFiles(NamedTuple):
    """The new bytes of the changed files, the old bytes of all, the findings after the fixes, and the refused files.

    The fixes of a refused file would have caused an error.
    """

    files: dict[str, bytes]
    before: dict[str, bytes]
    told: LintFindings
    refused: tuple[str, ...]


def fix(
    session: LintSession,
    told: LintFindings,
    examine: Callable[[], LintFindings],
    files: Sequence[str],
    *,
    suggested: bool,
) -> FixedFiles:
    """Fix `files` in memory. Afterwards `session` holds the new texts."""
    before = {name: session.read(name) for name in files if name in told.sources}
    writable = [name for name in before if _is_text(before[name])]
    refused: dict[str, None] = {}
    for _ in range(_MOST):
        texts = fixed(told.found, told.sources, [name for name in writable if name not in refused], suggested=suggested)
        if not texts:
            break
        told = _round(session, told, examine, texts, refused)
    now = {name: session.read(name) for name in writable}
    return FixedFiles({name: data for name, data in now.items() if data != before[name]}, before, told, tuple(refused))


def _round(
    session: LintSession,
    told: LintFindings,
    examine: Callable[[], LintFindings],
    texts: dict[str, str],
    refused: dict[str, None],
) -> LintFindings:
    """Try all new texts at once; if that causes an error, one after the other, and refuse those that cause an error."""
    after = _tried(session, told, examine, texts)
    if after is not None:
        return after
    for name, text in texts.items():
        after = _tried(session, told, examine, {name: text}) if len(texts) > 1 else None
        if after is None:
            refused[name] = None
        else:
            told = after
    return told


def _tried(
    session: LintSession, told: LintFindings, examine: Callable[[], LintFindings], texts: dict[str, str]
) -> LintFindings | None:
    """Return the findings with these texts. If there are new errors, restore the old texts and return None."""
    kept = {name: session.read(name) for name in texts}
    for name, text in texts.items():
        mark = _BOM if kept[name].startswith(_BOM) else b""
        session.put(name, mark + text.encode("utf-8"))
    after = examine()
    if not _errors(after) - _errors(told):
        return after
    for name, data in kept.items():
        session.put(name, data)
    return None


def _errors(told: LintFindings) -> Counter[tuple[str, str]]:
    return Counter((each.code.id, each.message) for each in told.found if each.severity is Severity.ERROR)


def _is_text(data: bytes) -> bool:
    try:
        data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return False
    return True
