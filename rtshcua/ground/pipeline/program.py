"""Compiles a whole program: checks every declaration, and lowers and proves every policy and mission."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from rtshcua.decision.prepare import prepare
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.checker.check import check_declarations
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.geojson import DataFiles
from rtshcua.ground.checker.lookup import find_mission
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.symbols import collect, with_uses
from rtshcua.ground.elaborate.elaborate import elaborate
from rtshcua.ground.elaborate.parameters import ParameterSettings
from rtshcua.ground.language.load import Program
from rtshcua.ground.lower.mission import lower_mission
from rtshcua.ground.lower.policy import LoweredPolicy, lower_policy
from rtshcua.ground.pipeline.closure import Imports, beside
from rtshcua.ground.pipeline.pins import Pins, claims
from rtshcua.ground.prove.mission_bounds import Bounds, bounds_of, greatest
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.proofs import prove_mission, prove_policy, report_refused
from rtshcua.ground.prove.step_starts import FROM_HOME, MissionStart
from rtshcua.ground.prove.survey_quality import StepPictures, step_pictures
from rtshcua.ground.testing.case import PolicyCase, PolicyUnderTest
from rtshcua.ground.testing.case_lowering import cases_of
from rtshcua.ground.testing.scenario_lowering import ScenarioFlight, ScenarioMission, scenarios_of
from rtshcua.mavlink.dialect import Dialect
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.places import VehicleDecl
from rtshcua.model.ir.policies import PolicyDecl

#: findings that exclude a whole file
FILE_CODES = frozenset({codes.NO_SUCH_FILE, codes.NOT_TEXT, codes.TOO_LARGE, codes.IMPORT_PATH})


class PlannedMission(NamedTuple):
    """A mission with its planned path, and its policy. The mission may have errors."""

    under: LoweredPolicy
    mission: Mission
    declaration: MissionDecl


@dataclass(frozen=True, slots=True)
class Compiled:
    """A flat policy and mission, both None if there are errors; the mission is not yet bound to the policy.

    `bounds` are the upper bounds of the mission. `sources` are the texts of the program and of the mission's parameter
    settings, to which findings refer. `declared` are all policies of the program, by name and version. `planned` is the
    mission as far as its path is planned, even if there are errors.
    """

    policy: Policy | None
    mission: Mission | None
    diagnostics: tuple[Diagnostic, ...]
    bounds: Bounds | None = None
    sources: Mapping[str, Source] = field(default_factory=dict)
    declared: frozenset[tuple[str, int]] = frozenset()
    planned: PlannedMission | None = None


@dataclass(frozen=True, slots=True)
class Checked:
    """The findings of a program, and the upper bounds of each mission by name, over all values of its parameters.

    `policies` are the lowered policies for each vehicle with a mission, if there are no errors. `planned` are the
    missions with the defaults of their parameters, even if there are errors.
    """

    diagnostics: tuple[Diagnostic, ...]
    bounds: Mapping[str, Bounds]
    policies: tuple[LoweredPolicy, ...] = ()
    grounds: tuple[ProofContext, ...] = ()  # the policies, prepared as on board, with the state of their proofs
    planned: tuple[PlannedMission, ...] = ()
    pictures: Mapping[str, tuple[StepPictures, ...]] = field(default_factory=dict)  # of surveys, as `planned`


def compile_program(
    program: Program,
    dialect: Dialect,
    *,
    mission: str | None,
    issued_at_us: int,
    settings: ParameterSettings | None = None,
    pins: Pins | None = None,
    start: MissionStart = FROM_HOME,
) -> Compiled:
    """Compile one mission (None: the only one of the first file) and its policy. The mission is proved from `start`.

    `settings` are values for that mission's parameters. A claim that contradicts `pins` is a finding. All declarations
    and all missions are checked. Errors in the sources become findings, never exceptions.
    """
    settings = settings or ParameterSettings()
    candidates = _candidates(program)
    name = mission if mission is not None or len(candidates) != 1 else candidates[0].name.text
    run = Compilation(program, dialect, issued_at_us, name, settings)
    run.start = start
    run.check()
    chosen = run.choose(mission)
    if chosen is not None and pins is not None:
        run.report.found += claims(chosen, pins)
    compiled = run.lowered(chosen)
    found = run.diagnostics()
    declared = frozenset((each.name.text, each.version) for unit in program.units for each in unit.policies)
    planned = None if chosen is None else run.planned.get(chosen.name.text)
    if compiled is None or run.report.failed() or chosen is None:
        return Compiled(None, None, found, None, run.report.sources, declared, planned)
    return Compiled(*compiled, found, run.bounds.get(chosen.name.text), run.report.sources, declared, planned)


def check_program(program: Program, dialect: Dialect) -> tuple[Diagnostic, ...]:
    """Return all findings of a program, with or without missions."""
    return examine_program(program, dialect).diagnostics


def check_declared(program: Program, dialect: Dialect) -> tuple[Diagnostic, ...]:
    """Return the findings on declarations, without lowering or proofs: fast enough for an editor at every keystroke."""
    run = Compilation(program, dialect, 0)
    run.check()
    return run.diagnostics()


def examine_program(program: Program, dialect: Dialect, issued_at_us: int = 0) -> Checked:
    """Return all findings of a program and the bounds of its missions, with the missions issued at a UTC time in us."""
    run = Compilation(program, dialect, issued_at_us)
    run.check()
    run.lowered(None)
    run.cases()
    run.scenarios()
    if run.report.failed():
        return Checked(run.diagnostics(), {}, planned=tuple(run.planned.values()))
    grounds = tuple(run.grounds())
    lowered = tuple(each.lowered for each in grounds)
    return Checked(run.diagnostics(), run.bounds, lowered, grounds, tuple(run.planned.values()), run.pictures)


def _candidates(program: Program) -> list[MissionDecl]:
    """The missions to choose from if none is named: those of the first file, or else all."""
    first = list(program.units[0].missions) if program.units else []
    return first or [mission for unit in program.units for mission in unit.missions]


class Compilation:
    """One compilation. Call `check` first, then the other methods, then `diagnostics`.

    `issues` are the times of issue of missions, by name, that differ from `issued_at_us`.
    """

    def __init__(
        self,
        program: Program,
        dialect: Dialect,
        issued_at_us: int,
        chosen: str | None = None,
        settings: ParameterSettings | None = None,
        issues: Mapping[str, int] | None = None,
    ) -> None:
        self.program = program
        self.issued_at_us = issued_at_us
        self.issues = issues or {}
        self._chosen = chosen
        self.start = FROM_HOME  # of the chosen mission
        settings = settings or ParameterSettings()
        options = {settings.source.file: settings.source} if settings.source.text else {}
        self.report = Report({**program.sources, **options}, program.data)
        self.report.found += program.diagnostics
        self.bounds: dict[str, Bounds] = {}
        self.planned: dict[str, PlannedMission] = {}
        self.pictures: dict[str, tuple[StepPictures, ...]] = {}
        self.whole = program.whole and not any(found.code in FILE_CODES for found in program.diagnostics)
        self._imports = Imports(program.units, program.stable)
        self._policies: dict[tuple[str, str], ProofContext | None] = {}
        self._tested: dict[tuple[str, str], PolicyUnderTest | None] = {}
        self._flown: dict[str, ScenarioMission] = {}
        data = DataFiles(program.data, program.data_names)
        self.context = CheckContext(collect(program.units, program.broken), self.report, dialect, data=data)
        if self.whole:
            plain = elaborate(self.context, program.units, self._imports.closure, chosen, settings)
            symbols = collect(plain.units, program.broken)
            instances, samples = plain.instances, plain.samples
            self.context = CheckContext(symbols, self.report, dialect, instances=instances, samples=samples, data=data)

    def check(self) -> None:
        """Check all declarations, unless a file is missing: then many names would be unknown."""
        if self.whole:
            check_declarations(self.context)

    def choose(self, name: str | None) -> MissionDecl | None:
        """Return the chosen mission; report an error and return None if there is not exactly one."""
        if not self.whole:
            return None
        if name is not None:
            return find_mission(self.context, name)
        candidates = _candidates(self.program)
        if len(candidates) == 1:
            return self.context.symbols.missions.get(candidates[0].name.text)
        if not self.context.symbols.broken and not (self.report.failed() and not candidates):
            names = ", ".join(f"`{each.name.text}`" for each in candidates)
            self.report.add(
                codes.NO_MISSION,
                candidates[1].name.span if candidates else None,
                f"there are {len(candidates)} missions" if candidates else "the sources declare no mission",
                help=f"choose one with `--mission`: {names}" if candidates else "add a mission, or name its file",
            )
        return None

    def lowered(self, chosen: MissionDecl | None) -> tuple[Policy, Mission] | None:
        """Lower every mission and every policy if the declarations have no errors; return the chosen mission's."""
        if self.report.failed():
            return None
        found: tuple[Policy, Mission] | None = None
        symbols = self.context.symbols
        # first, so that a finding on a policy does not depend on a mission's values
        for mission in symbols.missions.values():
            self._policy(symbols.policies[mission.policy.text], symbols.vehicles[mission.vehicle.text])
        for mission in self.context.missions():
            flat = self._mission(mission)
            if mission is chosen:
                found = flat
        for policy in self.context.symbols.policies.values():
            self._unused(policy)
        return found

    def diagnostics(self) -> tuple[Diagnostic, ...]:
        """Return the findings, sorted by file in the order of import, and by place."""
        order = {unit.file: number for number, unit in enumerate(self.program.units)}

        def place(found: Diagnostic) -> tuple[int, Span]:
            span = found.span
            return (-1, Span("", 0, 0)) if span is None else (order.get(span.file, len(order)), span)

        merged = [with_uses(found, self.context.symbols) for found in self.report.merged()]
        return tuple(dict.fromkeys(sorted(merged, key=place)))

    def grounds(self) -> list[ProofContext]:
        """Return the lowered policies."""
        return [ground for ground in self._policies.values() if ground is not None]

    def _mission(self, mission: MissionDecl) -> tuple[Policy, Mission] | None:
        symbols = self.context.symbols
        under = self._policy(symbols.policies[mission.policy.text], symbols.vehicles[mission.vehicle.text])
        if under is None:
            return None
        lowered = lower_mission(self.context, mission, under.lowered, self.program.stable, self._issued(mission))
        if lowered is None:
            return None
        under = replace(under, lowered=replace(under.lowered, files=lowered.files))
        flat = lowered.mission
        self.planned.setdefault(mission.name.text, PlannedMission(under.lowered, flat, mission))
        start = self.start if mission.name.text == self._chosen else FROM_HOME
        bounds = bounds_of(under, mission, flat, prove_mission(under, mission, flat, start))
        self.pictures.setdefault(mission.name.text, step_pictures(under, mission, flat))
        self.bounds[mission.name.text] = greatest(bounds, self.bounds.get(mission.name.text))
        tested = PolicyUnderTest(under.lowered, under.prepared)
        self._flown.setdefault(mission.name.text, ScenarioMission(tested, flat, mission))  # the first has the defaults
        return under.lowered.policy, flat

    def _issued(self, mission: MissionDecl) -> int:
        return self.issues.get(mission.name.text, self.issued_at_us)

    def _unused(self, policy: PolicyDecl) -> None:
        """Lower a policy without missions, for the first vehicle that it imports."""
        if any(name == policy.name.text for name, _ in self._policies):
            return
        vehicle = self._imported_vehicle(policy)
        if vehicle is not None:
            self._policy(policy, vehicle)

    def _imported_vehicle(self, policy: PolicyDecl) -> VehicleDecl | None:
        files = self._imports.closure(policy.span.file)
        return next((each for each in self.context.symbols.vehicles.values() if each.span.file in files), None)

    def _policy(self, policy: PolicyDecl, vehicle: VehicleDecl) -> ProofContext | None:
        key = (policy.name.text, vehicle.name.text)
        if key not in self._policies:
            lowered = self._unproved(policy, vehicle)
            self._policies[key] = None if lowered is None else prove_policy(self.context, lowered)
        return self._policies[key]

    def unproved(self) -> None:
        """Lower every mission and every policy, without proofs."""
        if self.report.failed():
            return
        symbols = self.context.symbols
        for mission in self.context.missions():
            under = self._under_test(symbols.policies[mission.policy.text], symbols.vehicles[mission.vehicle.text])
            if under is not None:
                lower_mission(self.context, mission, under.lowered, self.program.stable, self._issued(mission))
        for policy in symbols.policies.values():
            vehicle = self._imported_vehicle(policy)
            if vehicle is not None and all(name != policy.name.text for name, _ in self._tested):
                self._under_test(policy, vehicle)

    def cases(self) -> tuple[PolicyCase, ...]:
        """Return the test cases of the first file, if the declarations have no errors."""
        if self.report.failed() or not self.context.symbols.tests:
            return ()
        return tuple(cases_of(self.context, self._under_test, self.program.stable))

    def scenarios(self) -> tuple[ScenarioFlight, ...]:
        """Return the scenarios of the first file, if lowering found no errors."""
        if self.report.failed() or not self.context.symbols.scenarios:
            return ()
        return tuple(scenarios_of(self.context, self._flown, self.program.stable))

    def _under_test(self, policy: PolicyDecl, vehicle: VehicleDecl) -> PolicyUnderTest | None:
        """Return a policy prepared for tests, without proofs; None if it has errors."""
        key = (policy.name.text, vehicle.name.text)
        if key not in self._tested:
            proved = self._policies.get(key)
            self._tested[key] = (
                self._unproved_test(policy, vehicle)
                if proved is None
                else PolicyUnderTest(proved.lowered, proved.prepared)
            )
        return self._tested[key]

    def _unproved_test(self, policy: PolicyDecl, vehicle: VehicleDecl) -> PolicyUnderTest | None:
        lowered = self._unproved(policy, vehicle)
        prepared = None if lowered is None else prepare(lowered.policy)
        if lowered is None or prepared is None:
            return None
        if isinstance(prepared, Refusal):
            report_refused(self.context, lowered, prepared)
            return None
        return PolicyUnderTest(lowered, prepared)

    def _unproved(self, policy: PolicyDecl, vehicle: VehicleDecl) -> LoweredPolicy | None:
        files = self._imports.closure(policy.span.file)
        stable = self.program.stable
        own = stable.get(policy.span.file, policy.span.file)
        names = {file: beside(stable.get(file, file), own) for file in (*files, *self.program.data)}
        return lower_policy(self.context, policy, vehicle, files, names)
