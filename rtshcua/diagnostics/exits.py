"""The exit codes. A code never changes its meaning. The README has the table of `as_markdown()`."""

from enum import IntEnum


class ExitCode(IntEnum):
    """An exit code: the value for the shell, a stable `slug` for programs, one line of `meaning` for people.

    70 and 74 follow sysexits.h (EX_SOFTWARE, EX_IOERR); 130 is the shell's 128 + SIGINT.
    """

    slug: str
    meaning: str

    OK = 0, "ok", "done; a flight succeeded, a log verified, sources have no errors"
    DIAGNOSTICS = (
        1,
        "diagnostics",
        "the sources or the mission specification have errors; each was reported; of `bench`: a headline claim fails",
    )
    USAGE = 2, "usage", "the command line is wrong: unknown command or option, missing argument"
    INPUT = 3, "input", "a file is missing, unreadable, too large or malformed"
    UNTRUSTED = 4, "untrusted", "a signature, key, duty, digest, expiry or format version is not trusted"
    REFUSED = 5, "refused", "the bundle may not run here: wrong vehicle, replay, or enforcement mode refused"
    ABORTED = 6, "aborted", "the mission ended early through a fallback or the contingency, and landed"
    STOOD_DOWN = 7, "stood-down", "the pilot or the autopilot's own failsafe took over; the runtime stood down"
    LINK = 8, "link", "no vehicle answered, the port is busy, or the vehicle went silent"
    EVIDENCE = 9, "evidence", "the log fails verification; the first record that fails was named"
    INCOMPLETE = 10, "incomplete", "the log verifies, but lacks its close, or the requested anchor"
    DECISION = (
        11,
        "decision",
        ("the log is complete and signed, but a decision does not follow from its record, or a command has none"),
    )
    ANCHOR = 12, "anchor", "the log contradicts what a witness cosigned: it was rewritten or cut"
    TESTS = (
        13,
        "tests",
        "a test, scenario, flight of a campaign or check of `qualify` fails, no test is found, or coverage is too low",
    )
    CRASHED = 14, "crashed", "the vehicle crashed; nothing more was sent to it"
    BOUNDARY = 15, "boundary", "the log contradicts what the enforcement boundary signed, or lacks its signature"
    FAULT = 70, "fault", "an internal fault, not caused by your input: please report it"
    FULL = 74, "io", "writing failed: disk full, device error, or a closed pipe"
    INTERRUPTED = (
        130,
        "interrupted",
        "stopped by Ctrl-C, or by the signal itself (-2); a flight closes its log first; a waiting witness ends with 0",
    )

    def __new__(cls, value: int, slug: str, meaning: str) -> "ExitCode":
        member = int.__new__(cls, value)
        member._value_ = value
        member.slug = slug
        member.meaning = meaning
        return member


def as_markdown() -> str:
    """Return the table for the README: one row per code, ending in a newline."""
    rows = [f"| {code.value} | `{code.slug}` | {code.meaning} |" for code in ExitCode]
    return "\n".join(["| code | slug | meaning |", "|---:|---|---|", *rows, ""])
