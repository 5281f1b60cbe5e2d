"""Missions that an agent proposes: checked against the policy's sources, as they were when the server began."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from rtshcua.adapters.store.readable import Readable
from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.diagnostics.span import Source
from rtshcua.ground.agent.narrowed_schema import narrowed, permitted_skills
from rtshcua.ground.agent.rejections import frame_of, rejections
from rtshcua.ground.agent.specification import load_specification
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.pins import Pins
from rtshcua.ground.pipeline.program import compile_program, examine_program
from rtshcua.mavlink import dialect
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy

#: what a proposal is called in findings; no file of it is ever read
PROPOSAL: Final = "proposal.json"


class NoPolicy(Exception):
    """The sources make no policy that an agent can be held to."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What the compiler says of a proposal: a mission and its policy, or why not."""

    policy: Policy | None
    mission: Mission | None
    rejections: list[dict[str, Any]]
    bounds: dict[str, Any] | None
    #: rejections that there are beside those that are told
    more: int = 0

    @property
    def accepted(self) -> bool:
        """Whether it may be signed."""
        return self.mission is not None


class Missions:
    """Checks proposals against the one policy of `sources`. Each file is read once: what changes later does not count.

    Raises `NoPolicy`.
    """

    def __init__(self, sources: Sequence[Path], shipped: str) -> None:
        self._shipped = shipped
        self._readable = Readable(shipped, sources)
        self._names = [str(path) for path in sources]
        self._texts: dict[str, bytes] = {}
        program = load(self._names, self._read, shipped, self._readable.listing, packs=self._readable.pack)
        checked = examine_program(program, dialect.load())
        if has_errors(checked.diagnostics):
            raise NoPolicy(f"the policy's sources have errors: {checked.diagnostics[0].message}")
        own = [each.name.text for unit in program.units[: len(sources)] for each in unit.policies]
        lowered = [each for each in checked.policies if each.policy.name in own]
        if len(lowered) != 1:
            raise NoPolicy(f"the sources declare {len(own)} policies, and one is asked for")
        self.lowered = lowered[0]
        path = program.stable.get(program.units[0].file, "")
        self.schema = narrowed(self.lowered, program.units, path if path.startswith("lib:") else None)
        self.skills = permitted_skills(self.lowered, ())
        self._frame = frame_of(self.schema, self.skills)
        self._pins = Pins("agent", None, frozenset({self.policy.name}), self.policy.version)

    @property
    def policy(self) -> Policy:
        """The policy, lowered for its vehicle."""
        return self.lowered.policy

    def check(self, specification: Any, issued_at_us: int) -> Answer:
        """What the compiler says of a specification; the same as `rtshcua compile --policy` does."""
        proposal = json.dumps(specification, ensure_ascii=False).encode("utf-8", "surrogatepass")

        def readable(name: str) -> bytes:  # of this proposal alone: several are checked at a time
            return proposal if name == PROPOSAL else self._read(name)

        program, read = load_specification(
            PROPOSAL, self._names, readable, self._shipped, self._readable.listing, self._readable.pack, self._pins
        )
        compiled = compile_program(program, dialect.load(), mission=None, issued_at_us=issued_at_us, pins=self._pins)
        if compiled.mission is None or compiled.policy is None:
            found = read.pointed(compiled.diagnostics)
            source: Source = read.source
            told, more = rejections(specification, found, source, self._frame)
            return Answer(None, None, told, None, more)
        bounds = None if compiled.bounds is None else compiled.bounds._asdict()
        return Answer(compiled.policy, compiled.mission, [], bounds)

    def _read(self, name: str) -> bytes:
        if name not in self._texts:
            self._texts[name] = self._readable.read(name)
        return self._texts[name]
