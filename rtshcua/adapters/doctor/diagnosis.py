"""The whole diagnosis: every finding of an examination, in the order in which a person would look."""

from collections.abc import Iterator

from rtshcua.adapters.doctor import link, mission, readiness, settings
from rtshcua.adapters.doctor.examination import Examination
from rtshcua.adapters.doctor.finding import Finding
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy


def diagnose(
    vehicle: Examination,
    policy: Policy,
    flown: Mission | None,
    *,
    keyed: bool,
    utc_error_us: int,
    unheard: frozenset[int] = frozenset(),
    named: bool = False,
) -> Iterator[Finding]:
    """What was found. `flown` is the mission that the vehicle is to fly, None where only signals were asked about.

    `unheard` are the slots of signals that cannot come on this link, for nobody signs what carries them. `named`: the
    operator said which system is meant.

    Before a heartbeat of an autopilot was heard there is nothing to say.
    """
    flavour = vehicle.flavour
    if flavour is None:
        return
    yield from link.link(vehicle.facts, flavour.name, keyed=keyed, crowd=vehicle.link.crowd, named=named)
    yield from readiness.readiness(vehicle)
    yield from mission.signals(vehicle, policy, flown, unheard)
    if flown is not None:
        yield from mission.bound(vehicle, policy, utc_error_us)
    if vehicle.parameters is not None:
        yield from settings.settings(flavour.name, vehicle.parameters)
