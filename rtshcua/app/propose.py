"""Check missions that an agent proposes against the policy's sources, as read when the server began."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import rtshcua.ground.agent.specification  # noqa: F401  loaded before a proposal comes, which may not wait for it
from rtshcua.app.programs import NO_TEXTS, SourceReader, compile_reading, examine
from rtshcua.diagnostics.codes import SPECIFICATION_SHAPE
from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.ground.agent.narrowed_schema import narrowed, permitted_skills
from rtshcua.ground.agent.rejections import frame_of, rejections
from rtshcua.ground.checker.arguments import bind_value
from rtshcua.ground.pipeline.pins import Pins
from rtshcua.ground.prove.step_starts import FROM_HOME, MissionStart
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy

#: the name of a proposal in diagnostics; no file of this name is read
PROPOSAL: Final = "proposal.json"


class NoPolicy(Exception):
    """The sources do not declare exactly one policy without errors."""


@dataclass(frozen=True, slots=True)
class ProposalAnswer:
    """The compiler's result for a proposal: a mission and its policy, or the rejections."""

    policy: Policy | None
    mission: Mission | None
    rejections: list[dict[str, Any]]
    bounds: dict[str, Any] | None
    #: the number of further rejections
    more: int = 0

    @property
    def accepted(self) -> bool:
        """Whether it may be signed."""
        return self.mission is not None


class Missions:
    """Checks proposals against the policy of `sources`. Each file is read once; later changes are ignored. `texts`
    stand in the place of files, by their shown names. Raises `NoPolicy`.
    """

    def __init__(self, sources: Sequence[Path], texts: Mapping[str, bytes] = NO_TEXTS) -> None:
        self._reader = SourceReader(sources, once=True)
        self._names = [str(path) for path in sources]
        reading = self._reader.program(self._names, texts)
        program, checked = reading.program, examine(reading)
        if has_errors(checked.diagnostics):
            raise NoPolicy(f"the policy's sources have errors: {checked.diagnostics[0].message}")
        own = [each.name.text for unit in program.units[: len(sources)] for each in unit.policies]
        lowered = [each for each in checked.policies if each.policy.name in own]
        if len(lowered) != 1:
            raise NoPolicy(f"the sources declare {len(own)} policies; exactly one is required")
        self.lowered = lowered[0]
        self.program = program
        self._context = next(each.context for each in checked.grounds if each.lowered is self.lowered)
        path = program.stable.get(program.units[0].file, "")
        self.schema = narrowed(self.lowered, program.units, path if path.startswith("lib:") else None)
        self.skills = permitted_skills(self.lowered, ())
        self._frame = frame_of(self.schema, self.skills)
        self._pins = Pins("agent", None, frozenset({self.policy.name}), self.policy.version)

    @property
    def policy(self) -> Policy:
        """The policy, lowered for its vehicle."""
        return self.lowered.policy

    @property
    def names(self) -> frozenset[str]:
        """The names that the policy's sources and their imports declare."""
        return frozenset(self._context.symbols.declared)

    def defaults(self) -> dict[str, dict[str, tuple[int, ...]]]:
        """The default of each parameter that has one, by skill and name, in the cells of an invocation."""
        context, found = self._context, dict[str, dict[str, tuple[int, ...]]]()
        for contract in self.policy.contracts:
            skill = context.symbols.skills[contract.name]
            own = found[contract.name] = {}
            for name, argument in context.arguments(skill).items():
                if argument.declaration.default is not None:
                    bound = bind_value(context.scope_of(skill), argument, argument.declaration.default)
                    own[name] = self.lowered.contracts.cells([] if bound is None else [bound])
        return found

    def check(self, specification: Any, issued_at_us: int, start: MissionStart = FROM_HOME) -> ProposalAnswer:
        """Compile a specification as `rtshcua compile --policy` does, for a mission that begins at `start`."""
        proposal = json.dumps(specification, ensure_ascii=False).encode("utf-8", "surrogatepass")
        reading = self._reader.program([PROPOSAL, *self._names], {PROPOSAL: proposal}, self._pins)
        compiled = compile_reading(reading, mission=None, issued_at_us=issued_at_us, pins=self._pins, start=start)
        if compiled.mission is None or compiled.policy is None:
            source = reading.program.sources[PROPOSAL]
            first, more = rejections(specification, compiled.diagnostics, source, self._frame)
            return ProposalAnswer(None, None, first, None, more)
        own = self.policy.vehicle.name
        if compiled.policy.vehicle.name != own:
            source = reading.program.sources[PROPOSAL]
            found = Diagnostic(SPECIFICATION_SHAPE, f"the signed policy is for `{own}`", pointer="/vehicle")
            first, more = rejections(specification, [found], source, self._frame)
            return ProposalAnswer(None, None, first, None, more)
        bounds = None if compiled.bounds is None else compiled.bounds._asdict()
        return ProposalAnswer(compiled.policy, compiled.mission, [], bounds)
