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

#: what to do about what is not to be trusted, by slug
_REMEDIES = {
    "no-keys": "run `rtshcua keys init` to create a development root",
    "malformed": "it was cut off or damaged, or is another kind of file: make it again, or copy it again",
    "exposed": "`chmod 600` it; replace what others may have read: `rtshcua keys replace`, or another passphrase",
}
#: of what is refused for another reason than that it is not to be trusted, by slug
_CODES = dict.fromkeys(("usage", "output", "no-approver", "several-approvers"), ExitCode.USAGE)
_CODES |= dict.fromkeys(
    ("changed", "configuration", "input", "malformed", "no-policy", "no-source", "outside", "since", "wrong-kind"),
    ExitCode.INPUT,
)
_CODES |= {"not-flown": ExitCode.TESTS, "not-generated": ExitCode.DIAGNOSTICS}


def untrusted(error: Untrusted) -> Refusal:
    """What is not to be trusted, with what to do about it where that is known."""
    return Refusal(error.slug, str(error), remedy(error))


def remedy(error: Untrusted) -> str:
    """What to do about what is not to be trusted; empty where nothing is known."""
    return str(getattr(error, "help", "")) or _REMEDIES.get(error.slug, "")


def code_of(slug: str) -> ExitCode:
    """The exit code for a refusal or an `Untrusted`: what cannot be read at all is bad input, whoever signed it."""
    return _CODES.get(slug, ExitCode.UNTRUSTED)


def exit_code_of(error: OSError) -> ExitCode:
    """The exit code for an error of the operating system: the link, the input, or else the output."""
    if error.errno in _LINK or (isinstance(error, (ConnectionError, TimeoutError)) and error.errno not in _FULL):
        return ExitCode.LINK
    if isinstance(error, PermissionError):
        from rtshcua.adapters.store.writing import NotWritten

        return ExitCode.FULL if isinstance(error, NotWritten) else ExitCode.INPUT
    return ExitCode.INPUT if error.errno in _INPUT else ExitCode.FULL


def words_of(error: OSError) -> str:
    """What the system says, as our messages are written."""
    words = error.strerror or str(error) or "the system gave no reason"
    return words[:1].lower() + words[1:]


def is_unreadable(found: "Diagnostic") -> bool:
    """Whether a file that was asked for itself cannot be read: such a finding has no span."""
    from rtshcua.diagnostics.codes import NO_SUCH_FILE, TOO_LARGE  # the front door opens without these

    return found.code in (NO_SUCH_FILE, TOO_LARGE) and found.span is None


def exit_code(found: "Iterable[Diagnostic]") -> ExitCode:
    """How a command ends that cannot go on: INPUT where a file that was asked for is none that can be read."""
    return ExitCode.INPUT if any(is_unreadable(each) for each in found) else ExitCode.DIAGNOSTICS
