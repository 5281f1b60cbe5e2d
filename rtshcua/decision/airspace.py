"""The airspace: inside every zone of the one list, outside every zone of the other."""

from rtshcua.decision.places import Place
from rtshcua.decision.prepared import PreparedAirspace
from rtshcua.decision.truth import AND, NOT, TRUE, Truth


def keeps(place: Place, airspace: PreparedAirspace) -> Truth:
    """Whether a place is in the airspace."""
    truth = TRUE
    for zone in airspace.inside:
        truth = AND[truth][place.inside(zone)]
    for zone in airspace.outside:
        truth = AND[truth][NOT[place.inside(zone)]]
    return truth
