"""What is found in several programs, together."""

from collections.abc import Iterable
from typing import NamedTuple

from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source
from rtshcua.front.cli.earlier import Earlier
from rtshcua.front.cli.programs import Asked
from rtshcua.front.cli.sources import examine
from rtshcua.ground.prove.mission_bounds import Bounds
from rtshcua.ground.report.changes import told_changes
from rtshcua.ground.report.model import ChangeTold
from rtshcua.ground.versions.raised import compare
from rtshcua.model.flat.policy import Policy


class Mission(NamedTuple):
    """What a mission takes at most, and the file that it stands in."""

    name: str
    file: str
    bounds: Bounds


class LeftOut(NamedTuple):
    """What does not count of a policy for a vehicle: how many clauses and rules; and the signals that it lacks."""

    policy: str
    vehicle: str
    without: tuple[str, ...]
    clauses: int
    rules: int

    def told(self) -> str:
        """In words."""
        counts = [
            f"{count} {what}{'s' * (count != 1)}"
            for count, what in ((self.clauses, "clause"), (self.rules, "rule"))
            if count
        ]
        without = ", ".join(self.without)
        return f"{self.policy} on {self.vehicle}: {' and '.join(counts)} `where fitted` left out, without {without}"


class Version(NamedTuple):
    """A policy that an earlier one was found for: both versions, and what differs, on any vehicle."""

    name: str
    version: int
    earlier: int
    changes: tuple[ChangeTold, ...]


class Found(NamedTuple):
    """Everything that was found, each thing once; of what has no errors its bounds, its versions, what is left out.

    `now` are the errors that missions without any would have if they were issued now, where a zone exists on dates.
    """

    diagnostics: tuple[Diagnostic, ...]
    sources: dict[str, Source]
    missions: tuple[Mission, ...]
    versions: tuple[Version, ...]
    left_out: tuple[LeftOut, ...]
    now: tuple[Diagnostic, ...]


def check_all(asked: Iterable[Asked], earlier: Earlier, issued_at_us: int = 0, now_us: int = 0) -> Found:
    """Check programs, one after the other, and hold their policies against earlier ones.

    Without a time of issue the dates of zones are not looked at; where one of them is in force, it is told what would
    be found now.
    """
    now: dict[tuple[object, ...], Diagnostic] = {}
    found: dict[tuple[object, ...], Diagnostic] = {}
    sources: dict[str, Source] = {}
    missions: dict[tuple[str, str], Mission] = {}
    versions: dict[tuple[str, int, int], dict[ChangeTold, None]] = {}
    left_out: dict[LeftOut, None] = {}
    for each in asked:
        program = each.reading.program
        checked = examine(each.reading, issued_at_us)
        sources |= program.sources
        compared = compare(checked.policies, earlier.policies, earlier.name, program.sources)
        for one in compared:
            changes = versions.setdefault((one.name, one.version, one.earlier), {})
            changes |= dict.fromkeys(told_changes(one.old, one.new))
        left_out |= {_left_out(lowered.policy): None for lowered in checked.policies if lowered.policy.left_out}
        wrong = [*checked.diagnostics, *(one.finding for one in compared if one.finding is not None)]
        for diagnostic in wrong:  # a file that two programs share has its findings once
            found.setdefault((diagnostic.code, diagnostic.span, diagnostic.message), diagnostic)
        if not issued_at_us and checked.bounds and any(_dated(one.policy, now_us) for one in checked.policies):
            wrong = [one for one in examine(each.reading, now_us).diagnostics if one.code.severity is Severity.ERROR]
            now |= {(one.code, one.span, one.message): one for one in wrong}
        files = {mission.name.text: unit.file for unit in program.units for mission in unit.missions}
        for name, bounds in checked.bounds.items():
            missions.setdefault((files[name], name), Mission(name, files[name], bounds))
    return Found(
        tuple(found.values()),
        sources,
        tuple(missions.values()),
        tuple(Version(*key, tuple(changes)) for key, changes in versions.items()),
        tuple(left_out),
        tuple(one for key, one in now.items() if key not in found),
    )


def _dated(policy: Policy, now_us: int) -> bool:
    """Whether a zone exists now, on its dates."""
    return any(zone.dates and zone.dates[0] <= now_us <= zone.dates[1] for zone in policy.zones)


def _left_out(policy: Policy) -> LeftOut:
    rules = sum(each.skill < 0 for each in policy.left_out)
    vehicle = policy.vehicle
    return LeftOut(policy.name, vehicle.name, vehicle.without, len(policy.left_out) - rules, rules)
