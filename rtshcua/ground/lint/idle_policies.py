"""Policies that restrict nothing (E1306), and zones of an airspace that restrict nothing (E1307).

E1306: a policy permits every request for the skills that it permits. Only skills that move the vehicle to another place
count. Each of these is permitted to everyone, through every source and in every situation (`restrictions`). No
`forbid`, `confirm` or `degrade` acts on it, and the airspace has no zone that the vehicle could leave or enter. If the
analysis reaches no result, nothing is reported.

E1307: an `outside` zone that the vehicle cannot reach, or that shares no point with an `inside` zone; and an `inside`
zone that contains all points that the vehicle can reach, at every height and at all times. The usual cause is a wrong
coordinate.
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
#: most permits of one skill that are analysed together
_MAX_PERMITS = 12


def policies_that_permit_all(subject: LintInput) -> Iterator[Diagnostic]:
    """Report policies that permit every request (E1306)."""
    for ground in subject.lowered():
        deciding = ConditionEffects(ground)
        moving = _permitted_moving_skills(ground, deciding.rules)
        if moving and is_open(ground.prepared.policy) and all(_always_permitted(deciding, skill) for skill in moving):
            yield _permits_all(ground, deciding.rules, moving)


def _permitted_moving_skills(ground: ProofContext, rules: Ruleset) -> list[int]:
    """Return the permitted skills that move the vehicle to another place."""
    permits = [number for group in rules.groups if group.kind == RuleKind.PERMIT for number in group.rules]
    skills = dict.fromkeys(skill for number in permits for skill in rules.skills(number))
    contracts = ground.prepared.policy.contracts
    return [skill for skill in skills if contracts[skill].motion.kind in _MOVING]


def _always_permitted(deciding: ConditionEffects, skill: int) -> bool:
    """Whether it is proved that every request for the skill is permitted."""
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
        f"`{declaration.name.text}` restricts nothing: everyone may request {names}, with any arguments in any state",
        declaration.name.span,
        "name the roles, add conditions with `when` that can fail, or add an `airspace` that the vehicle can leave",
        tuple(
            Label(span, "this covers every request" if len(permits) == 1 else "together, these cover every request")
            for span in permits
        ),
    )


def idle_airspaces(subject: LintInput) -> Iterator[Diagnostic]:
    """Report the zones of airspaces that have no effect (E1307)."""
    for ground in subject.lowered():
        declared = ground.lowered.declaration.airspace
        if declared is None:
            continue
        policy = ground.prepared.policy
        zones = {zone.name: zone for zone in policy.zones[: policy.declared]}
        reach = reach_of(policy.vehicle)
        for name in declared.outside:
            if reach.misses(zones[name.text]):
                yield _idle_zone(ground, reach, name, "is beyond the vehicle's reach, so staying outside is no limit")
                continue
            region = region_of(zones[name.text])
            within = next((each for each in declared.inside if are_disjoint(region, region_of(zones[each.text]))), None)
            if within is not None:
                yield _zone_beyond_airspace(ground, name, within)
        for name in declared.inside:
            if reach.belongs_to(zones[name.text]):
                yield _idle_zone(ground, reach, name, "contains the vehicle's reach, so staying inside is no limit")


def _idle_zone(ground: ProofContext, reach: VehicleReach, name: Name, problem: str) -> Diagnostic:
    vehicle = ground.lowered.vehicle.name.text
    kilometres = reach.across // 1_000_000
    help = f"check its coordinates: `{vehicle}` can fly at most {kilometres} km from its home"
    zone = ground.context.symbols.zones[name.text]
    if zone.floor is not None or zone.ceiling is not None:
        help += f", and {reach.up // 1_000} m above it"
    labels = (Label(zone.name.span, "declared here"),)
    return Diagnostic(codes.IDLE_AIRSPACE, f"`{name.text}` {problem}", name.span, help, labels)


def _zone_beyond_airspace(ground: ProofContext, name: Name, within: Name) -> Diagnostic:
    zones = ground.context.symbols.zones
    return Diagnostic(
        codes.IDLE_AIRSPACE,
        f"staying outside `{name.text}` is no limit: it lies outside `{within.text}`, which no path leaves",
        name.span,
        "check its coordinates and heights",
        (
            Label(zones[name.text].name.span, "declared here"),
            Label(zones[within.text].name.span, "no path leaves this zone"),
        ),
    )
