"""A whole program: check every declaration, lower every policy and mission, and hand out the one that was asked for."""

from dataclasses import dataclass

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.check import check_declarations
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.dialect import Dialect
from rtshcua.ground.checker.lookup import find_mission
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.symbols import collect
from rtshcua.ground.compiler.closure import Imports, beside
from rtshcua.ground.compiler.mission import lower_mission
from rtshcua.ground.compiler.policy import lower_policy
from rtshcua.ground.compiler.proofs.prove import prove_mission, prove_policy
from rtshcua.ground.compiler.proofs.situation import Ground
from rtshcua.ground.language.load import Program
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.places import VehicleDecl
from rtshcua.model.ir.policies import PolicyDecl

#: findings that leave out a whole file
FILE_CODES = frozenset({codes.NO_SUCH_FILE, codes.NOT_TEXT, codes.TOO_LARGE, codes.IMPORT_PATH})


@dataclass(frozen=True, slots=True)
class Compiled:
    """A flat policy and mission, both None where there are errors; the mission is not yet bound to the policy."""

    policy: Policy | None
    mission: Mission | None
    diagnostics: tuple[Diagnostic, ...]


def compile_program(program: Program, dialect: Dialect, *, mission: str | None, issued_at_us: int) -> Compiled:
    """Compile one mission (None: the only one of the file that was asked for) and the policy that it is under.

    All declarations are checked, and all missions. Never raises for what the sources say.
    """
    run = _Run(program, dialect, issued_at_us)
    run.check()
    chosen = run.choose(mission)
    compiled = run.lowered(chosen)
    policy, flat = (None, None) if compiled is None or run.report.failed() else compiled
    return Compiled(policy, flat, run.diagnostics())


def check_program(program: Program, dialect: Dialect) -> tuple[Diagnostic, ...]:
    """All findings on a program, which need not have a mission."""
    run = _Run(program, dialect, 0)
    run.check()
    run.lowered(None)
    return run.diagnostics()


class _Run:
    """One compilation."""

    def __init__(self, program: Program, dialect: Dialect, issued_at_us: int) -> None:
        self.program = program
        self.issued_at_us = issued_at_us
        self.report = Report(program.sources)
        self.report.found += program.diagnostics
        self.context = Context(collect(program.units, program.broken), self.report, dialect)
        self._imports = Imports(program.units, program.stable)
        self._policies: dict[tuple[str, str], Ground | None] = {}

    def check(self) -> None:
        """Check all declarations; where a file is missing altogether, half of all names would be unknown."""
        if not any(found.code in FILE_CODES for found in self.program.diagnostics):
            check_declarations(self.context)

    def choose(self, name: str | None) -> MissionDecl | None:
        """The mission that was asked for; None, and reported, where there is not exactly one."""
        missions = self.context.symbols.missions
        if any(found.code in FILE_CODES for found in self.program.diagnostics):
            return None
        if name is not None:
            return find_mission(self.context, name)
        first = self.program.units[0].missions if self.program.units else ()
        candidates = list(first) or list(missions.values())
        if len(candidates) == 1:
            return candidates[0]
        if not self.context.symbols.broken and not (self.report.failed() and not candidates):
            names = ", ".join(f"`{each.name.text}`" for each in candidates)
            self.report.add(
                codes.NO_MISSION,
                candidates[1].name.span if candidates else None,
                f"there are {len(candidates)} missions" if candidates else "the sources declare no mission",
                help=f"say which one to compile: {names}" if candidates else "add a mission, or name the file of one",
            )
        return None

    def lowered(self, chosen: MissionDecl | None) -> tuple[Policy, Mission] | None:
        """Lower every mission and every policy, if nothing is wrong with the declarations."""
        if self.report.failed():
            return None
        found: tuple[Policy, Mission] | None = None
        for mission in self.context.symbols.missions.values():
            flat = self._mission(mission)
            if mission is chosen:
                found = flat
        for policy in self.context.symbols.policies.values():
            self._unused(policy)
        return found

    def diagnostics(self) -> tuple[Diagnostic, ...]:
        """The findings by file, in the order in which the files were reached, and by place."""
        order = {unit.file: number for number, unit in enumerate(self.program.units)}

        def place(found: Diagnostic) -> tuple[int, Span]:
            span = found.span
            return (-1, Span("", 0, 0)) if span is None else (order.get(span.file, len(order)), span)

        return tuple(dict.fromkeys(sorted(self.report.found, key=place)))

    def _mission(self, mission: MissionDecl) -> tuple[Policy, Mission] | None:
        symbols = self.context.symbols
        under = self._policy(symbols.policies[mission.policy.text], symbols.vehicles[mission.vehicle.text])
        if under is None:
            return None
        flat = lower_mission(self.context, mission, under.lowered, self.program.stable, self.issued_at_us)
        if flat is None:
            return None
        prove_mission(under, mission, flat)
        return under.lowered.policy, flat

    def _unused(self, policy: PolicyDecl) -> None:
        """Lower a policy that no mission is under, for the first vehicle that it imports."""
        if any(name == policy.name.text for name, _ in self._policies):
            return
        files = self._imports.closure(policy.span.file)
        vehicle = next((each for each in self.context.symbols.vehicles.values() if each.span.file in files), None)
        if vehicle is not None:
            self._policy(policy, vehicle)

    def _policy(self, policy: PolicyDecl, vehicle: VehicleDecl) -> Ground | None:
        key = (policy.name.text, vehicle.name.text)
        if key not in self._policies:
            files = self._imports.closure(policy.span.file)
            stable = self.program.stable
            own = stable.get(policy.span.file, policy.span.file)
            names = {file: beside(stable.get(file, file), own) for file in files}
            lowered = lower_policy(self.context, policy, vehicle, files, names)
            self._policies[key] = None if lowered is None else prove_policy(self.context, lowered)
        return self._policies[key]
