"""Pins: the source, role and policy of a mission that the person who compiles it sets.

The source, role and policy in the text of a mission are claims, which are checked against the pins. A mission
specification comes from an agent, so its source is `agent` unless the command line sets another one, and its policy is
the one that the command line names or supplies.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.suggest import listed, nearest
from rtshcua.ground.language.load import Program
from rtshcua.ground.pipeline.closure import Imports
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.node import Name


class Pins(NamedTuple):
    """What the command line sets for a mission; None accepts the mission's own claim.

    The mission's policy must be one of `policies`; an empty set means that no policy was named.
    """

    source: str | None = None
    role: str | None = None
    policies: frozenset[str] | None = None
    version: int | None = None


#: the pins of a specification if nothing else is set
PROPOSED = Pins(source="agent")


def claims(mission: MissionDecl, pins: Pins) -> Iterator[Diagnostic]:
    """Yield a finding for each claim of a mission that contradicts a pin."""
    for word, name, pinned in (("source", mission.source, pins.source), ("role", mission.role, pins.role)):
        if name is not None and pinned is not None and name.text != pinned:
            help = f"write `{pinned}` in the mission, or compile with `--{word} {name.text}`"
            yield _claim(name, f"claims the {word} `{name.text}` but is compiled as `{pinned}`", help)
    policy, allowed = mission.policy, pins.policies
    if allowed is not None and not allowed:
        yield Diagnostic(
            codes.POLICY_NOT_NAMED,
            f"the policy `{policy.text}` is named by the mission only",
            policy.span,
            f"name the policy on the command line: `--policy {policy.text}`, or `--with` and its source",
        )
    elif allowed is not None and policy.text not in allowed:
        names = " or ".join(f"`{each}`" for each in sorted(allowed))
        yield _claim(policy, f"names the policy `{policy.text}` but is compiled for {names}", f"write {names}")
    elif pins.version is not None and mission.policy_version != pins.version:
        named = f"`{policy.text}@{mission.policy_version}`"
        text = f"names the policy {named} but is compiled for version {pins.version}"
        yield _claim(policy, text, f"write `{policy.text}@{pins.version}`")


def undeclared(pins: Pins, declared: frozenset[tuple[str, int]], found: Iterable[Diagnostic]) -> Refusal | None:
    """Return a refusal if the pinned policy is not one of those `declared` (name and version).

    Then the option is wrong, not the mission. None if the policy is declared, or if other errors may have kept its
    source from being read.
    """
    claimed = (codes.CLAIMED_AUTHORITY, codes.POLICY_NOT_NAMED)
    if not pins.policies or has_errors(each for each in found if each.code not in claimed):
        return None
    versions = sorted(version for name, version in declared if name in pins.policies)
    if pins.version in versions or (versions and pins.version is None):
        return None
    word = min(pins.policies)
    if versions:
        help = f"the sources declare `{word}@{versions[-1]}`; use `--with` to add another source"
        return Refusal("usage", f"there is no policy `{word}@{pins.version}`", help)
    names = sorted({name for name, _ in declared})
    near = nearest(word, names)
    known = f"the sources declare {listed(names) or 'none'}; use `--with` to add another source"
    return Refusal("usage", f"there is no policy `{word}`", f"did you mean `--policy {near}`?" if near else known)


def _claim(name: Name, text: str, help: str) -> Diagnostic:
    return Diagnostic(codes.CLAIMED_AUTHORITY, f"the mission {text}", name.span, help)


def policies_of(program: Program, files: frozenset[str]) -> frozenset[str]:
    """The policies that the files declare; if they declare none, those that they import."""
    own = _declared(program, files)
    if own or not files:
        return own
    imports = Imports(program.units, program.stable)
    return _declared(program, frozenset(each for file in files for each in imports.closure(file)))


def _declared(program: Program, files: frozenset[str]) -> frozenset[str]:
    return frozenset(each.name.text for unit in program.units if unit.file in files for each in unit.policies)
