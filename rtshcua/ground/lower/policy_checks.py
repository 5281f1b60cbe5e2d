"""Checks of a policy before it is signed for a vehicle.

E0207: all declarations on which the policy relies are in its own files. Otherwise a mission could import another zone,
signal or skill under a name that the policy uses.

E0413, E0517: no condition reads a sensor that the vehicle lacks, or a local time that is not declared. A missing signal
is unknown, so a step with a condition that reads it would never be permitted. A vehicle therefore declares the sensors
that it is `without`, and a clause or rule declares whether it applies only `where fitted`. The policy keeps a record of
clauses and rules that do not apply. A `permit` has no `where fitted`: without its condition it would permit more, and
without the whole rule the skill would not be permitted. Without a `clock`, the local time would silently be UTC.

E1001: the policy fits in the fixed tables on board (`rtshcua.model.flat.limits`).
"""

from collections.abc import Iterable, Iterator, Sequence

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.checks.emits import check_payload
from rtshcua.ground.checker.checks.zones import named
from rtshcua.ground.checker.condition_nodes import walk
from rtshcua.ground.checker.conditions import references
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.symbols import WORDS, brought_about
from rtshcua.model.flat import limits
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.policy import Policy
from rtshcua.model.ir.expression import Comparison, Condition, Reference, TimeOfDay, Within
from rtshcua.model.ir.places import ENTRY, VehicleDecl, ZoneDecl
from rtshcua.model.ir.policies import PolicyDecl, RuleDecl
from rtshcua.model.ir.skills import ClauseDecl, LinkDecl, SkillDecl


def is_self_contained(
    context: CheckContext, policy: PolicyDecl, skills: Sequence[SkillDecl], vehicle: VehicleDecl, files: frozenset[str]
) -> bool:
    """Whether all names in a policy and its skills are declared in its files. Reports each other name once."""
    foreign: dict[str, Span] = {}

    def note(name: str, span: Span) -> None:
        name = name if name in context.symbols.declared else name.removesuffix(ENTRY)
        declared = context.symbols.declared.get(name)
        if declared is not None and declared.span.file not in files:
            foreign.setdefault(name, span)

    zones = (zone for zone in context.symbols.zones.values() if zone.span.file in files)
    of_zones = ((each.name, each.span) for zone in zones for each in named(zone))
    for name, span in (
        *_names_of_policy(policy),
        *(found for skill in skills for found in _names_of_skill(skill)),
        *of_zones,
    ):
        note(name, span)
        signal = context.symbols.signals.get(name)
        if signal is not None:
            note(signal.type.text, span)
    note(vehicle.name.text, policy.name.span)
    for name, span in foreign.items():
        declared = context.symbols.declared[name]
        context.report.add(
            codes.NOT_IN_POLICY,
            span,
            f"`{name}` is {WORDS[type(declared)]} that the policy `{policy.name.text}` does not import",
            help="import its file in the policy's file; a policy is signed together with all that it uses",
            labels=[(declared.name.span, "declared here")],
        )
    return not [each for each in skills if not _own_sizes(context, policy, each, files)] and not foreign


def _own_sizes(context: CheckContext, policy: PolicyDecl, skill: SkillDecl, files: frozenset[str]) -> bool:
    """Whether the sizes of a skill are declared in the policy's files. Reports them otherwise."""
    sizes = context.symbols.sizes.get(skill.name.text)
    if sizes is None or sizes.span.file in files:
        return True
    context.report.add(
        codes.NOT_IN_POLICY,
        sizes.skill.span,
        f"the policy `{policy.name.text}` does not import these sizes of `{skill.name.text}`",
        help="import this file in the policy's file; a policy is signed once for all its missions",
        labels=[(policy.name.span, "the policy is declared here")],
    )
    return False


def _names_of_policy(policy: PolicyDecl) -> Iterator[tuple[str, Span]]:
    for rule in policy.rules:
        for name in rule.skills:
            yield name.text, name.span
        if rule.when is not None:
            yield from _names_of_condition(rule.when)
    links = [*policy.contingency, *(rule.target for rule in policy.rules if rule.target is not None)]
    yield from _names_of_links(links)
    if policy.airspace is not None:
        for name in (*policy.airspace.inside, *policy.airspace.outside):
            yield name.text, name.span


def _names_of_skill(skill: SkillDecl) -> Iterator[tuple[str, Span]]:
    yield skill.name.text, skill.name.span
    parameters = {parameter.name.text for parameter in skill.parameters}
    for clause in (*skill.require, *skill.assume, *skill.maintain):
        yield from ((name, span) for name, span in _names_of_condition(clause.condition) if name not in parameters)
    yield from _names_of_links(skill.fallback)


def _names_of_links(links: Iterable[LinkDecl]) -> Iterator[tuple[str, Span]]:
    for link in links:
        yield link.skill.text, link.skill.span
        for argument in link.arguments:
            if isinstance(argument.value, Reference):
                yield argument.value.name, argument.value.span


def _names_of_condition(condition: Condition) -> Iterator[tuple[str, Span]]:
    for reference in references(condition):
        yield reference.name, reference.span


def unfitted_signals(condition: Condition, without: frozenset[str]) -> dict[str, Span]:
    """Return the signals that a condition reads and a vehicle lacks, with the span of the first use of each."""
    found: dict[str, Span] = {}
    for reference in references(condition):
        if reference.name in without:
            found.setdefault(reference.name, reference.span)
    return found


def applies(clause: ClauseDecl, without: frozenset[str]) -> bool:
    """Whether a clause applies to a vehicle without these signals."""
    return not (clause.where_fitted and unfitted_signals(clause.condition, without))


def rule_applies(rule: RuleDecl, without: frozenset[str]) -> bool:
    """Whether a rule applies to a vehicle without these signals."""
    return not (rule.where_fitted and rule.when is not None and unfitted_signals(rule.when, without))


def check_fitted(
    context: CheckContext,
    policy: PolicyDecl,
    vehicle: VehicleDecl,
    skills: Iterable[SkillDecl],
    zones: Iterable[ZoneDecl],
) -> None:
    """Report rules, clauses and zones that read a sensor or a local time that the vehicle does not have."""
    for rule in policy.rules:
        if rule.when is not None and not rule.where_fitted:
            help = "remove the signal from the rule" if rule.kind == "permit" else "end the rule with `where fitted`"
            with context.report.within(brought_about(rule)):
                _sensors(context, vehicle, rule.when, help)
    skills = tuple(skills)
    clauses = [clause for skill in skills for clause in (*skill.require, *skill.assume, *skill.maintain)]
    for skill in skills:
        check_payload(context, vehicle, skill)
    for clause in clauses:
        if not clause.where_fitted:
            _sensors(context, vehicle, clause.condition, "write the clause on a line of its own, with `where fitted`")
    for rule in policy.rules:
        if rule.when is not None:
            with context.report.within(brought_about(rule)):
                _clock(context, vehicle, _timed(rule.when))
    for clause in clauses:
        _clock(context, vehicle, _timed(clause.condition))
    for zone in zones:
        if zone.daily is not None:
            _clock(context, vehicle, [zone.daily.span], f"`{zone.name.text}` is active at times of the local day")


def check_step_fitted(context: CheckContext, vehicle: VehicleDecl, own: Sequence[ClauseDecl]) -> bool:
    """Whether a step's own clauses read only sensors that the vehicle has. Reports the others."""
    for clause in own:
        _clock(context, vehicle, _timed(clause.condition))
    before = len(context.report.found)
    for clause in own:
        _sensors(context, vehicle, clause.condition, "remove the clause")
    return len(context.report.found) == before


def _sensors(context: CheckContext, vehicle: VehicleDecl, condition: Condition, help: str) -> None:
    listed = {name.text: name.span for name in vehicle.without}
    for name, span in unfitted_signals(condition, frozenset(listed)).items():
        context.report.add(
            codes.NOT_FITTED,
            span,
            f"this reads the signal `{name}`, but the vehicle `{vehicle.name.text}` has no sensor for it",
            help=f"{help}; or, if the vehicle has the sensor, remove `{name}` from its `without`",
            labels=[(listed[name], "declared here as not fitted")],
        )


def _timed(condition: Condition) -> Iterator[Span]:
    """Yield the spans at which a condition compares with a time of day."""
    for part in walk(condition):
        if isinstance(part, Comparison | Within) and any(isinstance(each, TimeOfDay) for each in walk(part)):
            yield part.span


def _clock(
    context: CheckContext, vehicle: VehicleDecl, spans: Iterable[Span], reason: str = "this reads the local time"
) -> None:
    if vehicle.utc_offset is not None or vehicle.time_zone is not None:
        return
    for span in spans:
        context.report.add(
            codes.NO_CLOCK,
            span,
            f"{reason}, but `{vehicle.name.text}` does not declare its offset from UTC",
            help='declare it in the vehicle, as in `clock "Europe/Berlin"` or `clock utc +02:00`',
            labels=[(vehicle.name.span, "the vehicle, without `clock`")],
        )


#: span, kind, number and limit of something that a policy contains
_Count = tuple[Span, str, int, int]


def fits_on_board(context: CheckContext, policy: PolicyDecl, flat: Policy) -> bool:
    """Whether a lowered policy fits on board. Reports each exceeded limit."""
    good = True
    skills = ((contract, context.symbols.skills[contract.name].name.span) for contract in flat.contracts)
    counts = [
        *_counts_of_policy(policy.name.span, flat),
        *(count for skill, span in skills for count in _counts_of_skill(span, skill)),
    ]
    for span, kind, count, limit in counts:
        if count > limit:
            good = False
            context.report.add(
                codes.TOO_MANY,
                span,
                f"`{context.report.text(span)}` has {count:,} {kind}, but at most {limit:,} fit on board",
            )
    return good


def _counts_of_policy(span: Span, flat: Policy) -> Iterator[_Count]:
    keys = sum((len(rule.skills) or 1) * (len(rule.roles) or 1) for rule in flat.rules)
    yield span, "rules", len(flat.rules), limits.MAX_RULES
    yield span, "pairs of a skill and a role in its rules", keys, limits.MAX_RULE_KEYS
    yield span, "roles", len(flat.roles), limits.MAX_ROLES
    yield span, "skills", len(flat.contracts), limits.MAX_CONTRACTS
    yield span, "state slots for the signals that it reads", flat.slots, limits.MAX_SLOTS
    yield span, "zones, including grown zones", len(flat.zones), limits.MAX_ZONES
    yield span, "different margins of grown zone arguments", len(flat.tables), limits.MAX_TABLES
    yield span, "sets of values in its conditions", len(flat.sets), limits.MAX_SETS
    yield span, "temporal operators over different conditions", len(flat.monitors), limits.MAX_MONITORS
    yield span, "names of phases in its conditions", len(flat.phases), limits.MAX_PHASE_NAMES
    yield span, "values in one set", max(map(len, flat.sets), default=0), limits.MAX_MEMBERS
    corners = sum(len(zone.data) // 2 for zone in flat.zones)
    yield span, "corners of zones", corners, limits.MAX_TOTAL_VERTICES


def _counts_of_skill(span: Span, contract: Contract) -> Iterator[_Count]:
    cells = max((parameter.cell + 2 for parameter in contract.parameters), default=0)
    yield span, "parameters", len(contract.parameters), limits.MAX_PARAMETERS
    yield span, "argument cells", cells, limits.MAX_CELLS
    for kind, clauses in (
        ("`require` clauses", contract.require),
        ("`assume` clauses", contract.assume),
        ("`maintain` clauses", contract.maintain),
    ):
        yield span, kind, len(clauses), limits.MAX_CLAUSES
