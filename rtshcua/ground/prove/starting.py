"""E0508: the mission begins in the airspace, wherever home may really be.

The vehicle stands at home before the first step, and comes down there after the last. How little is known of where
that is must not make this easier: the whole disc within which home may lie has to be in the airspace.
"""

from collections.abc import Sequence
from dataclasses import replace

from rtshcua.decision.values import FALSE, TRUE
from rtshcua.decision.zones import Place as Places
from rtshcua.diagnostics import codes
from rtshcua.ground.prove.fan import Fan, Landmarks, disc, hull
from rtshcua.ground.prove.leaving import breach
from rtshcua.ground.prove.period import Period, keeps
from rtshcua.ground.prove.situation import Ground
from rtshcua.model.ir.missions import Step
from rtshcua.model.quantity import Dimension, display


def prove(ground: Ground, first: Step, comes: Sequence[Period]) -> bool:
    """Whether a vehicle on the ground is in the airspace wherever its home is; reports at the first step where not."""
    airspace, policy = ground.prepared.airspace, ground.prepared.policy
    if airspace is None:
        return True
    whole = replace(comes[0], high=comes[-1].high, asked=comes[0].asked)
    present = whole.present(airspace, comes[-1].lasts_us)
    error, within = policy.vehicle.position_error, policy.vehicle.home_within
    homes = disc(within)
    space = Places(((Fan(homes, (-error, -error, error, error), Landmarks(policy)), 0, 0),), 0)
    if keeps(space, present) == TRUE:
        for zone in whole.avoidable(airspace, comes[-1].lasts_us):
            if space.inside(zone) != FALSE:
                whole.avoid(zone, comes[-1].lasts_us)
        return True
    edge = hull(homes)
    legs = [*((corner, corner) for corner in edge), *(((0, 0), corner) for corner in edge)]
    written = ground.lowered.vehicle.within
    ground.context.report.add(
        codes.PATH_OUTSIDE,
        first.span,
        f"home may lie up to {display(within, Dimension.LENGTH)} from where it is declared, and from there the "
        f"vehicle would {breach(policy, present, legs, 0, 0)}",
        help="every place where home may be must lie in the airspace: make that wider, or state home more exactly",
        labels=[
            (written.span, "how far the real home may lie"),
            (ground.span(airspace.airspace), "the airspace"),
            *whole.labels(present, space, comes[-1].lasts_us),
        ],
    )
    return False
