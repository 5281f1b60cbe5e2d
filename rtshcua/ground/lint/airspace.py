"""E1307: an airspace that restricts nothing, since its zones lie elsewhere: a slip in a coordinate looks like that.

A zone to stay outside of that lies beyond all that the vehicle can reach says nothing; nor does a zone to stay inside
of that holds all of it, at every height that it climbs to and at all times.
"""

from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.ground.compiler.proofs.situation import Ground
from rtshcua.ground.lint.reach import Reach, reach_of
from rtshcua.ground.lint.subject import Subject
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
        for name in declared.inside:
            if reach.belongs_to(zones[name.text]):
                what = "holds all that the vehicle can reach, so to stay inside of it is no limit"
                yield _found(ground, reach, name, what)


def _found(ground: Ground, reach: Reach, name: Name, what: str) -> Diagnostic:
    vehicle = ground.lowered.vehicle.name.text
    kilometres = reach.across // 1_000_000
    help = f"look at its coordinates: `{vehicle}` comes at most {kilometres} km from its home"
    zone = ground.context.symbols.zones[name.text]
    if zone.floor is not None or zone.ceiling is not None:
        help += f", and {reach.up // 1_000} m above it"
    return Diagnostic(
        codes.IDLE_AIRSPACE, f"`{name.text}` {what}", name.span, help, (Label(zone.name.span, "it is declared here"),)
    )
