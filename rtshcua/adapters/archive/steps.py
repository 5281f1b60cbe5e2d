"""Which skill the steps and links of a log stand for, replacements of the mission included.

What is read here was verified, or is not used: a log that fails has no rows.
"""

from base64 import b64decode
from collections.abc import Iterator

from msgspec.structs import replace

from rtshcua.adapters.archive.entry import Step
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Effect, Genesis
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.wire import cose, names
from rtshcua.wire.bundle import Bundle, envelopes, parse
from rtshcua.wire.replacement import ReplacementDocument
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP
from rtshcua.wire.untrusted import Untrusted

_REPLACEMENT = b'"event":"replacement"'  # no text can hold it, for a quote inside a text stands behind a backslash
_END = 1 << 62


class Steps:
    """Follows the lines of a log, each after the verifier took it."""

    def __init__(self) -> None:
        self._number = 0
        self._genesis = b""
        self._replaced: list[tuple[int, bytes]] = []  # the record, and its line

    def follow(self, line: bytes) -> None:
        """Takes the next line."""
        if not self._number:
            self._genesis = line
        elif _REPLACEMENT in line:
            self._replaced.append((self._number, line))
        self._number += 1

    def all(self, log: str, bundle: Bundle) -> tuple[Step, ...]:
        """The steps and links, each for the records in which its mission was in force.

        `bundle` is that of the log, as it was verified, with or without what replaced its mission later.
        """
        missions = [(0, self._first() if self._replaced else bundle.mission)]
        for number, line in self._replaced:
            mission = _replacing(missions[-1][1], line)
            if mission is not None:
                missions.append((number, mission))
        ends = [first for first, _ in missions[1:]] + [_END]
        return tuple(
            Step(log, first, until, *row)
            for (first, mission), until in zip(missions, ends, strict=True)
            for row in _rows(bundle.policy, mission)
        )

    def _first(self) -> Mission:
        """The mission that the log began with; its bundle was verified."""
        genesis = read(self._genesis)
        assert isinstance(genesis, Genesis)
        return parse(names.MISSION, cose.unverified(envelopes(b64decode(genesis.bundle))[1]).payload, Mission)


def _replacing(mission: Mission, line: bytes) -> Mission | None:
    """The mission after a replacement was recorded; None where the record makes no sense, which an audit says."""
    record = read(line)
    if not isinstance(record, Effect):
        return None
    try:
        said = parse(names.REPLACEMENT, cose.unverified(b64decode(record.detail)).payload, ReplacementDocument)
    except (Untrusted, ValueError):
        return None
    kept = max(said.kept, 0)
    return replace(said.mission, invocations=(*mission.invocations[:kept], *said.mission.invocations[kept:]))


def _rows(policy: Policy, mission: Mission) -> Iterator[tuple[int, int, int, str, str]]:
    yield from _links(CONTINGENCY_LINK, -1, policy.contingency, policy)
    for number, step in enumerate(mission.invocations):
        yield STEP, number, -1, _skill(policy, step.skill), step.text
        yield from _links(FALLBACK_LINK, number, step.contract.fallback, policy)


def _links(kind: int, step: int, chain: tuple[Link, ...], policy: Policy) -> Iterator[tuple[int, int, int, str, str]]:
    for number, link in enumerate(chain):
        yield kind, step, number, _skill(policy, link.skill), link.text


def _skill(policy: Policy, index: int) -> str:
    return policy.contracts[index].name if 0 <= index < len(policy.contracts) else ""
