"""The whole diagnosis: every finding of an examination, in the order in which a person would look."""

from collections.abc import Iterator

from rtshcua.adapters.doctor import link, mission, readiness, settings
from rtshcua.adapters.doctor.examination import Examination
from rtshcua.adapters.doctor.finding import Finding
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy


def diagnose(
    vehicle: Examination, policy: Policy, flown: Mission | None, *, keyed: bool, utc_error_us: int
) -> Iterator[Finding]:
    """What was found. `flown` is the mission that the vehicle is to fly, None where only signals were asked about.

    Before a heartbeat of an autopilot was heard there is nothing to say.
    """
    flavour = vehicle.flavour
    if flavour is None:
        return
    yield from link.link(vehicle.facts, flavour.name, keyed=keyed)
    yield from readiness.readiness(vehicle)
    yield from mission.signals(vehicle, policy, flown)
    if flown is not None:
        yield from mission.bound(vehicle, policy, utc_error_us)
    if vehicle.parameters is not None:
        yield from settings.settings(flavour.name, vehicle.parameters)
