"""The airspace at a time that nothing is known of."""

from rtshcua.decision.prepare import PreparedAirspace
from rtshcua.decision.values import AND, NOT, TRUE, Truth
from rtshcua.decision.zones import Place


def may_keep(place: Place, airspace: PreparedAirspace) -> Truth:
    """Whether a place is in the airspace when its inner zones exist, and of the outer ones those that always do."""
    truth = TRUE
    for zone in airspace.inside:
        truth = AND[truth][place.inside(zone)]
    for zone in airspace.outside:
        if zone.times is None:
            truth = AND[truth][NOT[place.inside(zone)]]
    return truth
