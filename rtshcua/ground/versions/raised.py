"""E0716: a policy that says something else than an earlier one has a higher version.

A vehicle never goes back to an older version of a policy; of two that have the same version it cannot tell which is
the newer.
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

#: of how many differences a finding tells
MAX_TOLD = 3

_VERSION = re.compile(
    r"(?>(?:\s++|//[^\n]*+|/\*.*?\*/){0,999})version(?>(?:\s++|//[^\n]*+|/\*.*?\*/){0,999})(\d+)", re.DOTALL
)


class VersionComparison(NamedTuple):
    """A policy that an earlier one was found for, and what is wrong with its version."""

    name: str
    version: int
    earlier: int
    finding: Diagnostic | None
    old: Policy
    new: Policy


def compare(
    policies: Iterable[LoweredPolicy], earlier: Sequence[Policy], where: str, sources: Mapping[str, Source]
) -> tuple[VersionComparison, ...]:
    """Each policy against the earlier one of its name and vehicle; `where` says in a message where that is from.

    A policy for another vehicle is another policy: it is not compared. Of several earlier ones the newest counts.
    """
    found: list[VersionComparison] = []
    for lowered in policies:
        old = newest_earlier(lowered.policy, earlier)
        if old is not None:
            finding = _finding(lowered, old, where, sources)
            found.append(VersionComparison(old.name, lowered.policy.version, old.version, finding, old, lowered.policy))
    return tuple(found)


def newest_earlier(policy: Policy, earlier: Iterable[Policy]) -> Policy | None:
    """The earlier policy that one is held against: of its name and vehicle the newest."""
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
        message = f"`{new.name}` has version {new.version}, and version {old.version} in `{where}`"
        help = f"a version never goes back: write version {next_version if differ else old.version}"
        fix = fix if differ else Fix(span, str(old.version), f"write version {old.version}")
    elif differ:
        message = f"`{new.name}` differs from the one in `{where}`, and both have version {new.version}"
        help = f"raise it to version {next_version}, here and in the missions under it"
    else:
        return None
    told = f"; it differs in {_told(differ)}" if differ else ""
    return Diagnostic(codes.VERSION_NOT_RAISED, message, span, help + told, fixes=(fix,))


def _told(differ: tuple[str, ...]) -> str:
    more = len(differ) - MAX_TOLD
    return ", ".join(differ[:MAX_TOLD]) + (f", and {more} more" if more > 0 else "")


def _version(policy: PolicyDecl, sources: Mapping[str, Source]) -> Span:
    """The version's number; the policy's name, where its text cannot be had."""
    name = policy.name.span
    source = sources.get(name.file)
    found = None if source is None else _VERSION.match(source.text, name.end)
    return name if found is None else Span(name.file, *found.span(1))
