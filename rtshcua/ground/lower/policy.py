"""A policy and its whole closure to the flat form, for one vehicle.

The policy holds every skill that its rules and chains name (where a permit is for any: all that its files declare),
every signal that these read, and every zone that its files declare, for a mission may name any as an argument.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from rtshcua.diagnostics import codes
from rtshcua.ground.checker import time_zones
from rtshcua.ground.checker.checks.vehicles import deceleration
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.scope import signal_type
from rtshcua.ground.checker.types import Type
from rtshcua.ground.checker.well_known import MEASURED, PER_CELL, VELOCITY, WELL_KNOWN, read_by_all
from rtshcua.ground.geometry.projection import projection_at
from rtshcua.ground.lower import lacking
from rtshcua.ground.lower.belonging import belongs
from rtshcua.ground.lower.conditions import Conditions
from rtshcua.ground.lower.contracts import Contracts
from rtshcua.ground.lower.files import Files
from rtshcua.ground.lower.limits import fits
from rtshcua.ground.lower.rules import Rules
from rtshcua.ground.lower.slots import Slots
from rtshcua.ground.lower.speeds import speeds_of
from rtshcua.ground.lower.zones import ZoneTable
from rtshcua.model.flat.policy import SILENCE_US, AfterSilence, Airspace, Policy, Rule, Vehicle, WithoutEvidence
from rtshcua.model.flat.signal import CELL
from rtshcua.model.ir.places import GeoJson, VehicleDecl
from rtshcua.model.ir.policies import PolicyDecl
from rtshcua.model.ir.policies import Rule as RuleDecl
from rtshcua.model.ir.skills import LinkDecl, SkillDecl

#: whoever flies the vehicle; a rule `by any` is about this role too, where no rule names it
OPERATOR = "operator"


@dataclass(frozen=True, slots=True)
class LoweredPolicy:
    """A flat policy with what its missions are lowered and checked by: indexes by name, zones, files."""

    policy: Policy
    declaration: PolicyDecl
    vehicle: VehicleDecl
    skills: Mapping[str, int]
    roles: Mapping[str, int]
    zones: ZoneTable
    contracts: Contracts
    files: Files
    conditions: Conditions
    slots: Slots
    written: Mapping[Rule, RuleDecl]  # each flat rule's declaration
    rules: tuple[RuleDecl, ...] = ()  # the same by the number of the flat rule


def lower_policy(
    context: Context, policy: PolicyDecl, vehicle: VehicleDecl, files: frozenset[str], names: Mapping[str, str]
) -> LoweredPolicy | None:
    """The policy for a vehicle; `files` is its import closure, `names` what a file is called in what is signed.

    None after a finding.
    """
    before = len(context.report.found)
    skills = _skills(context, policy, files)
    read = read_by_all(vehicle)
    if not _well_known(context, policy, read, files) or not belongs(context, policy, skills, vehicle, files):
        return None
    declared = [zone for zone in context.symbols.zones.values() if zone.span.file in files]
    lacking.check_policy(context, policy, vehicle, skills, declared)
    table = Files(context.report, names)
    slots = Slots(context, 1 if vehicle.cells is None else vehicle.cells.value)
    well_known = [slots.of(name) for name in read]
    sizes = [context.symbols.sizes[each.name.text] for each in skills if each.name.text in context.symbols.sizes]
    for part in (policy, vehicle, *declared, *(context.symbols.signals[name] for name in read), *skills, *sizes):
        table.index(part.span.file)  # all that the policy rests on is named, quoted or not
    for zone in declared:
        data = context.data.name(zone.shape) if isinstance(zone.shape, GeoJson) else None
        if data is not None:
            table.index(data)
    projection = projection_at(vehicle.home.latitude, vehicle.home.longitude)
    zones = ZoneTable(projection, declared, context.report, vehicle, context.data)
    conditions = Conditions(context, slots, zones, table)
    flat_vehicle = _vehicle(vehicle, *well_known)
    numbers = {skill.name.text: number for number, skill in enumerate(skills)}
    contracts = Contracts(context, numbers, conditions, zones, table, flat_vehicle)
    roles = _roles(policy)
    lowered = [contracts.contract(skill) for skill in skills]
    lowered_rules = Rules(context, numbers, roles, conditions, contracts, table, flat_vehicle.without).lowered(policy)
    contingency = contracts.chain(policy.contingency)
    airspace = _airspace(policy, zones, table)
    silence = policy.without_link
    if vehicle.cells is None and any(each.name == CELL for each in slots.signals):
        context.report.add(
            codes.WELL_KNOWN_SIGNAL,
            vehicle.name.span,
            f"`{vehicle.name.text}` does not say how many cells its battery has, and a condition reads `{CELL}`",
            help="write `cells 4` into the vehicle, or `without battery.cell` where nothing measures the voltage",
        )
    fitted = MEASURED.keys() - {name.text for name in vehicle.without}
    for name in sorted(fitted):  # last, so that the others keep their slots
        if _is_declared(context, name, files):
            table.index(context.symbols.signals[name].span.file)
            slots.of(name)
    if len(context.report.found) > before:
        return None
    flat = Policy(
        name=policy.name.text,
        version=policy.version,
        vehicle=flat_vehicle,
        projection=zones.projection,
        roles=roles,
        signals=tuple(slots.signals),
        slots=slots.count,
        zones=zones.flat(),
        declared=len(zones.regions),
        tables=tuple(zones.tables),
        sets=tuple(conditions.sets.all),
        contracts=tuple(lowered),
        rules=tuple(rule for rule, _ in lowered_rules),
        airspace=airspace,
        contingency=contingency,
        sources=table.names,
        source_digests=table.digests,
        monitors=tuple(conditions.monitors.all),
        phases=tuple(conditions.sets.phases),
        without_evidence=int(WithoutEvidence[policy.without_evidence.upper()]),
        silence_us=SILENCE_US if silence is None else silence.limit.value,
        left_out=tuple(contracts.left_out),
        after_silence=int(AfterSilence.CONTINGENCY if silence is None else AfterSilence[silence.then.upper()]),
    )
    if not fits(context, policy, flat):
        return None
    by_name = {role: number for number, role in enumerate(roles)}
    return LoweredPolicy(
        flat,
        policy,
        vehicle,
        numbers,
        by_name,
        zones,
        contracts,
        table,
        conditions,
        slots,
        dict(lowered_rules),
        tuple(rule for _, rule in lowered_rules),
    )


def _skills(context: Context, policy: PolicyDecl, files: frozenset[str]) -> list[SkillDecl]:
    """The skills of a policy, sorted by name."""
    table = context.symbols.skills
    links: list[LinkDecl] = [*policy.contingency, *(rule.target for rule in policy.rules if rule.target is not None)]
    waiting = [name.text for rule in policy.rules for name in rule.skills] + [link.skill.text for link in links]
    if any(rule.kind == "permit" and not rule.skills for rule in policy.rules):
        waiting += [name for name, skill in table.items() if skill.span.file in files]
    found: dict[str, SkillDecl] = {}
    while waiting:
        name = waiting.pop()
        if name not in found:
            found[name] = table[name]
            waiting += [link.skill.text for link in table[name].fallback]
    return [found[name] for name in sorted(found)]


def _roles(policy: PolicyDecl) -> tuple[str, ...]:
    """The roles of a policy, sorted: those that its rules name, and the one that every vehicle has."""
    named = {OPERATOR, *(role.text for rule in policy.rules for role in rule.roles)}
    asked = {name.text for rule in policy.rules for name in (rule.approver, rule.another) if name is not None}
    return tuple(sorted(named | asked))


def _well_known(context: Context, policy: PolicyDecl, read: Mapping[str, Type], files: frozenset[str]) -> bool:
    """Whether the signals are declared that every decision reads, or all supervision."""
    good = True
    declared = {name: type for name, type in {**MEASURED, **PER_CELL}.items() if _is_declared(context, name, files)}
    for name, type in (*read.items(), *declared.items()):
        every = "every decision reads it" if name not in VELOCITY else "what brakes is watched by it"
        needs = "every flight needs it" if name in WELL_KNOWN else "a vehicle that `brakes` is watched by it"
        signal = context.symbols.signals.get(name)
        if signal is None or signal.span.file not in files:
            good = False
            context.report.add(
                codes.WELL_KNOWN_SIGNAL,
                policy.name.span,
                f"the policy `{policy.name.text}` neither declares nor imports a signal `{name}`",
                help=f"{needs}: declare it as {type.describe()}, or import `lib:skills/signals.rts`",
            )
        elif signal_type(context.symbols, signal) != type:
            good = False
            context.report.add(
                codes.WELL_KNOWN_SIGNAL,
                signal.type.span,
                f"the signal `{name}` must be {type.describe()}, for {every} as that",
                help="give the signal another name, or read it from a fitting field",
            )
    return good


def _is_declared(context: Context, name: str, files: frozenset[str]) -> bool:
    signal = context.symbols.signals.get(name)
    return signal is not None and signal.span.file in files


def _airspace(policy: PolicyDecl, zones: ZoneTable, files: Files) -> Airspace | None:
    airspace = policy.airspace
    if airspace is None:
        return None
    text, source, start, end = files.place(airspace.span)
    return Airspace(
        inside=tuple(sorted(zones.zone(name.text, 0, smaller=True, span=name.span) for name in airspace.inside)),
        outside=tuple(sorted(zones.zone(name.text, 0, smaller=False, span=name.span) for name in airspace.outside)),
        text=text,
        source=source,
        start=start,
        end=end,
    )


def _vehicle(
    vehicle: VehicleDecl, position: int, height: int, battery: int, north: int = -1, east: int = -1, down: int = -1
) -> Vehicle:
    braking, zone = vehicle.braking, vehicle.time_zone
    return Vehicle(
        name=vehicle.name.text,
        identity=vehicle.identity,
        home_within=vehicle.within.value,
        speed=vehicle.speed.value,
        climb=vehicle.climb.value,
        position_error=vehicle.position_error.value,
        endurance_us=vehicle.endurance.value,
        reserve=vehicle.reserve.value,
        utc_offset_us=0 if vehicle.utc_offset is None else vehicle.utc_offset.value,
        position=position,
        height=height,
        battery=battery,
        return_altitude=0 if vehicle.return_altitude is None else vehicle.return_altitude.value,
        braking=0 if braking is None else deceleration(braking),
        reaction_us=0 if braking is None else braking.reaction.value,
        north=north,
        east=east,
        down=down,
        without=tuple(sorted({name.text for name in vehicle.without})),
        speeds=speeds_of(vehicle),
        time_zone="" if zone is None else zone.text,
        time_zone_data="" if zone is None else time_zones.VERSION,
        offsets=() if zone is None else time_zones.offsets(zone.text),
    )
