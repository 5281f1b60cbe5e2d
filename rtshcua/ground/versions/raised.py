"""Checks that a policy that differs from an earlier one has a higher version.

A vehicle never goes back to an older version of a policy, and it cannot order two policies of the same version.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.ground.versions.differences import differences
from rtshcua.model.flat.policy import Policy
from rtshcua.model.ir.policies import PolicyDecl

#: the most differences that a finding lists
MAX_LISTED = 3

_VERSION = re.compile(
    r"(?>(?:\s++|//[^\n]*+|/\*.*?\*/){0,999})version(?>(?:\s++|//[^\n]*+|/\*.*?\*/){0,999})(\d+)", re.DOTALL
)


class VersionComparison(NamedTuple):
    """A policy with its earlier version, and the finding about its version, if any."""

    name: str
    version: int
    earlier: int
    finding: Diagnostic | None
    old: Policy
    new: Policy


def compare(
    policies: Iterable[LoweredPolicy], earlier: Sequence[Policy], where: str, sources: Mapping[str, Source]
) -> tuple[VersionComparison, ...]:
    """Compare each policy with the newest earlier one of its name and vehicle.

    `where` is the origin of the earlier policies, for messages. A policy for another vehicle is not compared.
    """
    found: list[VersionComparison] = []
    for lowered in policies:
        old = newest_earlier(lowered.policy, earlier)
        if old is not None:
            finding = _finding(lowered, old, where, sources)
            found.append(VersionComparison(old.name, lowered.policy.version, old.version, finding, old, lowered.policy))
    return tuple(found)


def newest_earlier(policy: Policy, earlier: Iterable[Policy]) -> Policy | None:
    """Return the newest earlier policy of the same name and vehicle, or None."""
    own = [each for each in earlier if _same(each, policy)]
    return max(own, key=lambda each: (each.version, not differences(each, policy)), default=None)


def _same(old: Policy, new: Policy) -> bool:
    one, other = old.vehicle, new.vehicle
    return old.name == new.name and (one.identity == other.identity or one.name == other.name)


def _finding(lowered: LoweredPolicy, old: Policy, where: str, sources: Mapping[str, Source]) -> Diagnostic | None:
    new, span = lowered.policy, _version(lowered.declaration, sources)
    if new.version > old.version:
        return None
    next_version = old.version + 1
    fix = Fix(span, str(next_version), f"raise it to version {next_version}")
    differ = differences(old, new)
    if new.version < old.version:
        message = f"`{new.name}` has version {new.version}, but version {old.version} in `{where}`"
        help = f"a version never goes back: write version {next_version if differ else old.version}"
        fix = fix if differ else Fix(span, str(old.version), f"write version {old.version}")
    elif differ:
        message = f"`{new.name}` differs from the one in `{where}`, but both have version {new.version}"
        help = f"raise it to version {next_version}, here and in the missions under it"
    else:
        return None
    listed = f"; it differs in {_listed(differ)}" if differ else ""
    return Diagnostic(codes.VERSION_NOT_RAISED, message, span, help + listed, fixes=(fix,))


def _listed(differ: tuple[str, ...]) -> str:
    more = len(differ) - MAX_LISTED
    return ", ".join(differ[:MAX_LISTED]) + (f", and {more} more" if more > 0 else "")


def _version(policy: PolicyDecl, sources: Mapping[str, Source]) -> Span:
    """The span of the version number; that of the policy's name if the source is not available."""
    name = policy.name.span
    source = sources.get(name.file)
    found = None if source is None else _VERSION.match(source.text, name.end)
    return name if found is None else Span(name.file, *found.span(1))
