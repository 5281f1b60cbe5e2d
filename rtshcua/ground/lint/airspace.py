"""E1307: an airspace that restricts nothing, since its zones lie elsewhere: a slip in a coordinate looks like that.

A zone to stay outside of says nothing that lies beyond all that the vehicle can reach, or that has nothing in common
with a zone to stay inside of: no path can meet it. Nor does a zone to stay inside of that holds all that the vehicle
can reach, at every height that it climbs to and at all times.
"""

from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.ground.geometry.shapes import are_disjoint
from rtshcua.ground.lint.reach import Reach, reach_of, region_of
from rtshcua.ground.lint.subject import Subject
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.model.flat.zone import Zone
from rtshcua.model.ir.node import Name


def check(subject: Subject) -> Iterator[Diagnostic]:
    """Report the zones of airspaces that make no difference."""
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
                yield _found(ground, reach, name, what)
                continue
            within = next((each for each in declared.inside if _apart(zones[name.text], zones[each.text])), None)
            if within is not None:
                yield _shut_out(ground, name, within)
        for name in declared.inside:
            if reach.belongs_to(zones[name.text]):
                what = "holds all that the vehicle can reach, so to stay inside of it is no limit"
                yield _found(ground, reach, name, what)


def _found(ground: ProofContext, reach: Reach, name: Name, what: str) -> Diagnostic:
    vehicle = ground.lowered.vehicle.name.text
    kilometres = reach.across // 1_000_000
    help = f"look at its coordinates: `{vehicle}` comes at most {kilometres} km from its home"
    zone = ground.context.symbols.zones[name.text]
    if zone.floor is not None or zone.ceiling is not None:
        help += f", and {reach.up // 1_000} m above it"
    return Diagnostic(
        codes.IDLE_AIRSPACE, f"`{name.text}` {what}", name.span, help, (Label(zone.name.span, "it is declared here"),)
    )


def _apart(one: Zone, other: Zone) -> bool:
    """Whether it is proved that two zones have nothing in common, whenever they exist."""
    return are_disjoint(region_of(one), region_of(other))


def _shut_out(ground: ProofContext, name: Name, within: Name) -> Diagnostic:
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
