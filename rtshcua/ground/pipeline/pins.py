"""E0905, E0906: whose mission it is, and under which policy, is for whoever compiles to say, never for its text.

What a mission says of its own source, role and policy is a claim. A mission specification comes from an agent, so its
source is `agent` unless whoever compiles it says otherwise, and its policy is the one that they name or hand in.
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
    """What whoever compiles a mission says of it; None leaves it to the mission.

    `policies` are the names of which its policy must be one; none at all where nobody named any.
    """

    source: str | None = None
    role: str | None = None
    policies: frozenset[str] | None = None
    version: int | None = None


#: what holds of a specification that nobody said more about
PROPOSED = Pins(source="agent")


def claims(mission: MissionDecl, pins: Pins) -> Iterator[Diagnostic]:
    """What a mission claims beyond what is pinned."""
    for word, name, pinned in (("source", mission.source, pins.source), ("role", mission.role, pins.role)):
        if name is not None and pinned is not None and name.text != pinned:
            text = f"says that its {word} is `{name.text}`, and is compiled as `{pinned}`"
            yield _claim(name, text, _either(word, name.text, pinned))
    policy, allowed = mission.policy, pins.policies
    if allowed is not None and not allowed:
        yield Diagnostic(
            codes.POLICY_NOT_NAMED,
            f"nothing but the mission itself says that it flies under `{policy.text}`",
            policy.span,
            f"whoever compiles it names the policy: `--policy {policy.text}`, or `--with` and its source",
        )
    elif allowed is not None and policy.text not in allowed:
        names = " or ".join(f"`{each}`" for each in sorted(allowed))
        text = f"says that it flies under `{policy.text}`, and is compiled for {names}"
        yield _claim(policy, text, f"write {names}")
    elif pins.version is not None and mission.policy_version != pins.version:
        named = f"`{policy.text}@{mission.policy_version}`"
        text = f"says that it flies under {named}, and is compiled for version {pins.version}"
        yield _claim(policy, text, f"write `{policy.text}@{pins.version}`")


def undeclared(pins: Pins, declared: frozenset[tuple[str, int]], found: Iterable[Diagnostic]) -> Refusal | None:
    """Why the policy that whoever compiles named is none of those `declared` (name and version): a slip in an option is
    no fault of the mission. None where it is one of them, and where errors other than a claim may have kept its source
    from being read.
    """
    claimed = (codes.CLAIMED_AUTHORITY, codes.POLICY_NOT_NAMED)
    if not pins.policies or has_errors(each for each in found if each.code not in claimed):
        return None
    versions = sorted(version for name, version in declared if name in pins.policies)
    if pins.version in versions or (versions and pins.version is None):
        return None
    word = min(pins.policies)
    if versions:
        help = f"the sources declare `{word}@{versions[-1]}`; `--with` hands in the source of another"
        return Refusal("usage", f"there is no policy `{word}@{pins.version}`", help)
    names = sorted({name for name, _ in declared})
    near = nearest(word, names)
    known = f"the sources declare {listed(names) or 'none'}; `--with` hands in the source of another"
    return Refusal("usage", f"there is no policy `{word}`", f"did you mean `--policy {near}`?" if near else known)


def _either(word: str, claimed: str, pinned: str) -> str:
    """Which of both is wrong nobody knows here: a slip in an option, or a claim that goes too far."""
    return f"if `--{word} {pinned}` is what you mean, write `{pinned}`; else `--{word} {claimed}` is for you to say"


def _claim(name: Name, text: str, help: str) -> Diagnostic:
    return Diagnostic(codes.CLAIMED_AUTHORITY, f"the mission {text}", name.span, help)


def policies_of(program: Program, files: frozenset[str]) -> frozenset[str]:
    """The policies that sources declare; where they declare none, those that they import."""
    own = _declared(program, files)
    if own or not files:
        return own
    imports = Imports(program.units, program.stable)
    return _declared(program, frozenset(each for file in files for each in imports.closure(file)))


def _declared(program: Program, files: frozenset[str]) -> frozenset[str]:
    return frozenset(each.name.text for unit in program.units if unit.file in files for each in unit.policies)
