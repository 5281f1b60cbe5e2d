"""What `rtshcua check` does, however its command line was read."""

import textwrap
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rtshcua.diagnostics.codes import UNKNOWN_NAME
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.asked import SPECIFICATION, unfolded
from rtshcua.front.cli.bounds import bounds_dict, bounds_told, steps_told
from rtshcua.front.cli.checking import Found, Mission, check_all
from rtshcua.front.cli.earlier import Earlier, earlier_policies
from rtshcua.front.cli.faults import say
from rtshcua.front.cli.findings import Findings, exit_code
from rtshcua.front.cli.moments import moment
from rtshcua.front.cli.overwriting import refusal
from rtshcua.front.cli.programs import Asked, programs
from rtshcua.front.cli.progress import watched
from rtshcua.front.cli.shown import utc
from rtshcua.front.cli.sources import examine
from rtshcua.front.cli.stdout import out
from rtshcua.ground.report.model import ChangeTold


def check_sources(
    paths: Sequence[Path],
    *,
    since: Path | None = None,
    with_: Sequence[Path] = (),
    map_: Path | None = None,
    at: str | None = None,
    deny_warnings: bool = False,
    as_json: bool = False,
) -> ExitCode:
    """Report everything that is wrong with sources; see `rtshcua.front.cli.check`."""
    findings = Findings(json=as_json, deny_warnings=deny_warnings)
    issued_at_us = 0 if at is None else moment(at)
    if issued_at_us is None:
        return findings.refuse(ExitCode.USAGE, "usage", f"`{at}` is not a UTC time", "accepted: 2026-01-31T08:00:00Z")
    files = unfolded(paths)
    if isinstance(files, Refusal):
        return findings.end(files)
    unfit = None if map_ is None else _unfit(map_, files)
    if unfit is not None:
        return findings.end(unfit)
    earlier = Earlier("", ()) if since is None else earlier_policies(since)
    if isinstance(earlier, Refusal):
        return findings.end(earlier)
    asked = programs(files, tuple(with_))
    now_us = time.time_ns() // 1_000
    found = check_all(watched(asked), earlier, issued_at_us, now_us)
    code = exit_code(found.diagnostics) if findings.report(found.diagnostics, found.sources) else ExitCode.OK
    alone = len(files) == 1 and not with_ and files[0].suffix.lower() == SPECIFICATION
    if alone and not as_json and any(each.code is UNKNOWN_NAME for each in found.diagnostics):
        say(" help: what a specification speaks of stands in its policy's sources: `--with FILE` names them")
    gone = _not_here(earlier, found)
    if code is ExitCode.OK and not as_json:
        _tell(found, since, gone, now_us)
    if map_ is not None:
        imported = refusal(map_, found.sources, "a page")
        if imported is not None:
            return findings.end(imported)
        drawn = _draw(asked, map_, issued_at_us)
        if not as_json:
            out(drawn)
    if code is ExitCode.OK and since is not None and not found.versions:
        return findings.end(_nothing_compared(since, gone))
    return findings.finish(code, **_as_json(found, gone))


def _as_json(found: Found, gone: Sequence[str]) -> dict[str, object]:
    """What else the object of `--json` holds."""
    versions = [
        {
            "policy": each.name,
            "version": each.version,
            "earlier": each.earlier,
            "changes": [asdict(change) for change in each.changes],
        }
        for each in found.versions
    ]
    return {
        "missions": [{"mission": each.name, "file": each.file} | bounds_dict(each.bounds) for each in found.missions],
        "versions": versions,
        "not_here": gone,
        "left_out": [each._asdict() for each in found.left_out],
        "issued_now": [{"code": each.code.id, "message": each.message} for each in found.now],
    }


def _not_here(earlier: Earlier, found: Found) -> list[str]:
    """The names of earlier policies that no policy here was held against."""
    compared = {each.name for each in found.versions}
    return sorted({each.name for each in earlier.policies} - compared)


def _nothing_compared(since: Path, gone: Sequence[str]) -> Refusal:
    """That no policy here has an earlier version there: who asked for that relies on it."""
    there = f"there: {', '.join(f'`{name}`' for name in gone)}" if gone else "there is no policy for a vehicle in it"
    help = f"{there}; one of another name or for another vehicle is another policy: name a bundle of this one"
    return Refusal("since", f"nothing in `{since}` is an earlier version of a policy here", help)


def _tell(found: Found, since: Path | None, gone: Sequence[str], now_us: int) -> None:
    """What is said of sources in which nothing is wrong."""
    empty = [name for name, source in found.sources.items() if not source.text.strip()]
    out(f"no errors in {len(found.sources)} file{'s' * (len(found.sources) > 1)}")
    for name in empty:
        out(f"note: `{name}` is empty")
    for mission in found.missions:
        out(f"{_named(mission, found.missions)}: {bounds_told(mission.bounds)}")
        for line in steps_told(mission.bounds):
            out(line)
    for left_out in found.left_out:
        out(left_out.told())
    for refused in found.now:
        out(f"issued now, it would be refused: {refused.code.id}, {refused.message}")
    if found.now:
        at = utc(now_us).replace(" ", "T")
        out(f"the dates of zones count from the time of issue: `rtshcua check --at {at}` shows where")
    for each in found.versions:
        same = "" if each.changes else "; they mean the same"
        out(f"{each.name}: version {each.version}, and {each.earlier} in {since}{same}")
        for change in each.changes:
            _tell_change(change)
    for name in gone if found.versions else ():
        out(f"{name}: in {since}, and compared with no policy here")


def _tell_change(change: ChangeTold) -> None:
    """One difference: which way it goes, and its words then and now."""
    out_wrapped(f"  {change.direction:<11}  ", change.what)
    for what, lines in (("before", change.before), ("now", change.after)):
        for line in lines or ("there was none" if what == "before" else "there is none",):
            out_wrapped(f"  {'':11}    {what:<6}  ", line)


def out_wrapped(head: str, text: str) -> None:
    """A line of at most 80 columns, and what does not fit beneath, under its text."""
    body = " ".join(text.split())
    beneath = " " * len(head)
    for line in textwrap.wrap(body, 80, initial_indent=head, subsequent_indent=beneath, break_on_hyphens=False):
        out(line)


def _unfit(target: Path, files: Sequence[Path]) -> Refusal | None:
    """Why no page can be written to a file."""
    if not target.parent.is_dir():
        return Refusal("output", f"there is no folder `{target.parent}` to write to")
    if target.exists() and not target.is_file():
        return Refusal("output", f"`{target}` is no regular file, and is not replaced by a page")
    return refusal(target, files, "a page")


def _draw(asked: Sequence[Asked], target: Path, issued_at_us: int) -> str:
    """Write the page of the programs that were asked for; what to say of it."""
    from rtshcua.adapters.store.writing import replace
    from rtshcua.ground.report.checked import Checking, checked_page

    checked = [(each.reading.program, examine(each.reading, issued_at_us)) for each in asked]
    checkings = [Checking(program, one.planned, one.diagnostics) for program, one in checked]
    replace(target, checked_page(checkings).encode("utf-8"))
    missions = sum(len(one.planned) for _, one in checked)
    return f"{missions} mission{'' if missions == 1 else 's'} drawn in {target}"


def _named(mission: Mission, missions: tuple[Mission, ...]) -> str:
    """A mission's name; with its file, where another has the same."""
    alone = sum(each.name == mission.name for each in missions) == 1
    return mission.name if alone else f"{mission.name} ({mission.file})"
