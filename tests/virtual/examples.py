"""Scenarios of the projects in `examples`: found by their names, flown and judged."""

import re
from pathlib import Path

from rtshcua.app.programs import read_sources
from rtshcua.app.testing.run import ISSUED_AT_US
from rtshcua.campaign.rounds import FlownMission
from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.ground.pipeline.suite import scenarios
from rtshcua.ground.testing.scenario_lowering import ScenarioFlight
from rtshcua.mavlink import dialect
from rtshcua.virtual import development_keys
from rtshcua.virtual.expectations import expectations
from rtshcua.virtual.flight import LATER_US
from rtshcua.virtual.judge import judge


def flights_of(source: Path) -> list[tuple[str, str]]:
    """Return the name of each scenario of a file, with each autopilot that it flies aboard."""
    text = source.read_text(encoding="utf-8")
    found: list[tuple[str, str]] = []
    for part in re.split(r"(?m)^(?=scenario )", text)[1:]:
        name, aboard = re.findall(r'^scenario "(.*)"', part), re.findall(r"(?m)^  aboard (.*)$", part)
        flavours = re.split(r",\s*", aboard[0]) if aboard else ["px4", "ardupilot"]
        found += [(name[0], each) for each in flavours]
    return found


def flight_of(source: Path, name: str) -> ScenarioFlight:
    """Return a scenario of a file, ready to be flown."""
    found = scenarios(read_sources([source]).program, dialect.load(), ISSUED_AT_US, LATER_US)
    assert not has_errors(found.diagnostics)
    return next(each for each in found.found if each.scenario.name == name)


def failures_of(source: Path, name: str, flavour: str) -> list[str]:
    """Fly a scenario once; return what the judge found, and the expectations that were not met."""
    chosen = flight_of(source, name)
    assert flavour in chosen.scenario.flavours
    policy, start = chosen.policy.lowered.policy, chosen.scenario.start
    mission = chosen.mission
    if start.utc_us is not None:
        mission = development_keys.flies_at(mission, start.utc_us)
    was = FlownMission.of(policy, mission, mission.issued_at_us).flown(chosen.scenario, flavour, 1)
    verdict = judge(was)
    unmet = [each.found for each in expectations(was, verdict) if not each.met]
    return [each.text for each in verdict.failures] + unmet
