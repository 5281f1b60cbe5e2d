"""The airspace: inside every zone of the one list, outside every zone of the other."""

from rtshcua.decision.evaluate import Environment, within
from rtshcua.decision.places import Place
from rtshcua.decision.prepared import PreparedAirspace
from rtshcua.decision.truth import AND, NOT, TRUE, Truth


def keeps(place: Place, airspace: PreparedAirspace, at: Environment, through: int) -> Truth:
    """Whether a place is in the airspace at every moment from now to `through` us from now."""
    truth = TRUE
    for zone in airspace.inside:
        truth = AND[truth][place.inside(zone) if zone.times is None else within(place, zone, at, through)]
    for zone in airspace.outside:
        truth = AND[truth][NOT[place.inside(zone) if zone.times is None else within(place, zone, at, through)]]
    return truth
