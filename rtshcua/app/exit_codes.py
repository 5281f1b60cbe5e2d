"""The exit code of what is refused, of what the operating system would not do, and of findings."""

import errno
from collections.abc import Iterable
from typing import TYPE_CHECKING

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.wire.untrusted import Untrusted

if TYPE_CHECKING:
    from rtshcua.diagnostics.diagnostic import Diagnostic

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS, errno.EPIPE}
_LINK = {
    errno.EADDRINUSE, errno.EADDRNOTAVAIL, errno.ECONNABORTED, errno.ECONNREFUSED, errno.ECONNRESET, errno.EHOSTDOWN,
    errno.EHOSTUNREACH, errno.ENETDOWN, errno.ENETUNREACH, errno.ENOTCONN, errno.ETIMEDOUT,
}  # fmt: skip
_INPUT = {
    errno.E2BIG, errno.EACCES, errno.EEXIST, errno.EISDIR, errno.ELOOP, errno.ENAMETOOLONG, errno.ENOENT, errno.ENOTDIR,
    errno.ENOTEMPTY, errno.ENXIO, errno.EPERM,
}  # fmt: skip

#: the help for untrusted input, by slug
_REMEDIES = {
    "no-keys": "run `rtshcua keys init` to create a development root",
    "malformed": "the file was cut off or damaged, or is of another kind: create or copy it again",
    "exposed": "`chmod 600` it; then replace the exposed key with `rtshcua keys replace`, or change the passphrase",
}
#: the exit codes of other refusals, by slug
_CODES = dict.fromkeys(("usage", "output", "no-approver", "several-approvers"), ExitCode.USAGE)
_CODES |= dict.fromkeys(
    ("changed", "configuration", "input", "malformed", "no-policy", "no-source", "outside", "since", "wrong-kind"),
    ExitCode.INPUT,
)
_CODES |= {"not-flown": ExitCode.TESTS, "not-generated": ExitCode.DIAGNOSTICS}


def untrusted(error: Untrusted) -> Refusal:
    """The refusal for untrusted input."""
    return Refusal(error.slug, str(error), remedy(error))


def remedy(error: Untrusted) -> str:
    """The help for untrusted input; empty if there is none."""
    return str(getattr(error, "help", "")) or _REMEDIES.get(error.slug, "")


def code_of(slug: str) -> ExitCode:
    """The exit code for the slug of a refusal or an `Untrusted`; unparsable input is bad input even if it is signed."""
    return _CODES.get(slug, ExitCode.UNTRUSTED)


def exit_code_of(error: OSError) -> ExitCode:
    """The exit code for an OSError: of the link, the input, or else the output."""
    if error.errno in _LINK or (isinstance(error, (ConnectionError, TimeoutError)) and error.errno not in _FULL):
        return ExitCode.LINK
    if isinstance(error, PermissionError):
        from rtshcua.adapters.store.writing import NotWritten

        return ExitCode.FULL if isinstance(error, NotWritten) else ExitCode.INPUT
    return ExitCode.INPUT if error.errno in _INPUT else ExitCode.FULL


def words_of(error: OSError) -> str:
    """The system's error text, in lower case as in other messages."""
    text = error.strerror or str(error) or "the system gave no reason"
    return text[:1].lower() + text[1:]


def is_unreadable(found: "Diagnostic") -> bool:
    """Whether a file named by the user cannot be read; such a finding has no span."""
    from rtshcua.diagnostics.codes import NO_SUCH_FILE, TOO_LARGE  # imported late, to start fast

    return found.code in (NO_SUCH_FILE, TOO_LARGE) and found.span is None


def exit_code(found: "Iterable[Diagnostic]") -> ExitCode:
    """The exit code of a command that stops on errors: INPUT if a named file cannot be read."""
    return ExitCode.INPUT if any(is_unreadable(each) for each in found) else ExitCode.DIAGNOSTICS
