"""Policies that restrict nothing (E1306), and zones of an airspace that restrict nothing (E1307).

E1306: a policy permits every request. Only skills that move the vehicle elsewhere count. Each of them that is permitted
at all is permitted to everyone through every source in every situation (`restrictions`), no `forbid`, `confirm` or
`degrade` ever acts on it, and the airspace has no zone that the vehicle could leave or enter. Where the analysis cannot
answer, nothing is reported.

E1307: a zone to stay outside of that the vehicle cannot reach, or that has nothing in common with a zone to stay inside
of; and a zone to stay inside of that contains everything that the vehicle can reach, at every height and at all times.
A wrong coordinate is the usual cause.
"""

from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.ground.geometry.shapes import are_disjoint
from rtshcua.ground.lint.lint_input import LintInput
from rtshcua.ground.lint.restrictions import ConditionEffects, VehicleReach, is_open, reach_of, region_of
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.ruleset import Ruleset
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.policy import RuleKind
from rtshcua.model.ir.node import Name

_MOVING = (MotionKind.CLIMB, MotionKind.FLY, MotionKind.COVER)
#: more permits of one skill than this are not looked at together
_MAX_PERMITS = 12


def policies_that_permit_all(subject: LintInput) -> Iterator[Diagnostic]:
    """Report policies that refuse nothing (E1306)."""
    for ground in subject.lowered():
        deciding = ConditionEffects(ground)
        moving = _permitted_moving_skills(ground, deciding.rules)
        if moving and is_open(ground.prepared.policy) and all(_always_permitted(deciding, skill) for skill in moving):
            yield _permits_all(ground, deciding.rules, moving)


def _permitted_moving_skills(ground: ProofContext, rules: Ruleset) -> list[int]:
    """The skills that move the vehicle and that a permit is about."""
    permits = [number for group in rules.groups if group.kind == RuleKind.PERMIT for number in group.rules]
    skills = dict.fromkeys(skill for number in permits for skill in rules.skills(number))
    contracts = ground.prepared.policy.contracts
    return [skill for skill in skills if contracts[skill].motion.kind in _MOVING]


def _always_permitted(deciding: ConditionEffects, skill: int) -> bool:
    """Whether nothing that the skill can be asked for is refused, as far as can be told."""
    rules = deciding.rules
    about = [number for number in range(len(rules.policy.rules)) if skill in rules.skills(number)]
    permits = [number for number in about if rules.rule(number).kind == RuleKind.PERMIT]
    if any(deciding.acts(number, skill) for number in about if number not in permits):
        return False
    anyone = [number for number in permits if not rules.rule(number).roles and not rules.rule(number).sources]
    return 0 < len(anyone) <= _MAX_PERMITS and deciding.always_permit(anyone, skill)


def _permits_all(ground: ProofContext, rules: Ruleset, moving: list[int]) -> Diagnostic:
    declaration = ground.lowered.declaration
    contracts = ground.prepared.policy.contracts
    names = ", ".join(f"`{contracts[skill].name}`" for skill in moving)
    permits = [
        group.span
        for group in rules.groups
        if group.kind == RuleKind.PERMIT and any(skill in rules.skills(group.rules[0]) for skill in moving)
    ]
    return Diagnostic(
        codes.GATES_NOTHING,
        f"`{declaration.name.text}` gates nothing: everyone may ask for {names}, whatever the arguments and the state",
        declaration.name.span,
        "name the roles, add conditions with `when` that can fail, or an `airspace` that the vehicle can leave",
        tuple(
            Label(span, "this leaves nothing out" if len(permits) == 1 else "together, these leave nothing out")
            for span in permits
        ),
    )


def idle_airspaces(subject: LintInput) -> Iterator[Diagnostic]:
    """Report the zones of airspaces that make no difference (E1307)."""
    for ground in subject.lowered():
        declared = ground.lowered.declaration.airspace
        if declared is None:
            continue
        policy = ground.prepared.policy
        zones = {zone.name: zone for zone in policy.zones[: policy.declared]}
        reach = reach_of(policy.vehicle)
        for name in declared.outside:
            if reach.misses(zones[name.text]):
                what = "lies where the vehicle cannot come, so to stay outside of it is no limit"
                yield _idle_zone(ground, reach, name, what)
                continue
            region = region_of(zones[name.text])
            within = next((each for each in declared.inside if are_disjoint(region, region_of(zones[each.text]))), None)
            if within is not None:
                yield _unmeetable_zone(ground, name, within)
        for name in declared.inside:
            if reach.belongs_to(zones[name.text]):
                what = "holds all that the vehicle can reach, so to stay inside of it is no limit"
                yield _idle_zone(ground, reach, name, what)


def _idle_zone(ground: ProofContext, reach: VehicleReach, name: Name, what: str) -> Diagnostic:
    vehicle = ground.lowered.vehicle.name.text
    kilometres = reach.across // 1_000_000
    help = f"look at its coordinates: `{vehicle}` comes at most {kilometres} km from its home"
    zone = ground.context.symbols.zones[name.text]
    if zone.floor is not None or zone.ceiling is not None:
        help += f", and {reach.up // 1_000} m above it"
    return Diagnostic(
        codes.IDLE_AIRSPACE, f"`{name.text}` {what}", name.span, help, (Label(zone.name.span, "it is declared here"),)
    )


def _unmeetable_zone(ground: ProofContext, name: Name, within: Name) -> Diagnostic:
    zones = ground.context.symbols.zones
    return Diagnostic(
        codes.IDLE_AIRSPACE,
        f"no path can meet `{name.text}`: it lies outside of `{within.text}`, which no path leaves",
        name.span,
        "look at its coordinates and heights; to stay outside of it is no limit",
        (
            Label(zones[name.text].name.span, "it is declared here"),
            Label(zones[within.text].name.span, "no path leaves this"),
        ),
    )
