"""A policy, in full: what is permitted, to whom, where, and what every skill then means."""

from rtshcua.adapters.loop import WAIT_US
from rtshcua.front.cli.showing import words
from rtshcua.front.cli.showing.contract import show_contract
from rtshcua.front.cli.showing.page import Page
from rtshcua.model.flat.policy import AfterSilence, Policy, WithoutEvidence
from rtshcua.model.flat.signal import Signal, SignalSource
from rtshcua.onboard.runtime.limits import Limits, falling_us

#: what `without evidence` says, and means
_WITHOUT_EVIDENCE: dict[int, str] = {
    WithoutEvidence.LAND: "evidence land: while records are not kept the mission is given up",
    WithoutEvidence.REFUSE: "evidence refuse: while records are not kept no further step begins",
}
#: what `without link` says, and means
_AFTER_SILENCE: dict[int, str] = {
    AfterSilence.CONTINUE: "continue: after a longer silence the step goes on, if all that must hold holds",
    AfterSilence.CONTINGENCY: "contingency: after a longer silence the mission is given up, and the contingency flies",
}
_HOUR_US = 3_600_000_000
_MINUTE_US = 60_000_000


def show_policy(page: Page, policy: Policy) -> None:
    """Adds a policy to the page."""
    vehicle, projection = policy.vehicle, policy.projection
    page.head(f"Policy {policy.name} version {policy.version}")
    page.row("vehicle", f"`{vehicle.identity}`, declared as {vehicle.name}")
    home = words.geographic(projection.latitude, projection.longitude)
    page.row("home", f"{home}, within {words.length(vehicle.home_within)}")
    page.row("moves", f"at most {words.speed(vehicle.speed)}, climbs at most {words.speed(vehicle.climb)}")
    if vehicle.speeds is not None:
        kept, wind = vehicle.speeds, words.speed(vehicle.speeds.wind)
        up, down = words.speed(kept.climb), words.speed(kept.descent)
        page.row("keeps", f"at least {words.speed(kept.cruise)}, {up} up, {down} down, in at most {wind} of wind")
    if vehicle.return_altitude:
        page.row("returns", f"at {words.length(vehicle.return_altitude)} above home, if it flies lower")
    if vehicle.braking:
        braking, reaction = words.speed(vehicle.braking), words.duration(vehicle.reaction_us)
        page.row("brakes", f"by {braking} in a second, after {reaction}: limits count where it would come to stand")
    page.row("position", f"true to {words.length(vehicle.position_error)}: every planned path is widened by this")
    hover, reserve = words.duration(vehicle.endurance_us), words.ratio(vehicle.reserve)
    page.row("energy", f"a full battery hovers {hover}; {reserve} stay in reserve")
    if vehicle.without:
        page.row("without", f"{', '.join(vehicle.without)}: not fitted; what reads it `where fitted` is left out")
    if vehicle.time_zone:
        page.row("local time", f"{vehicle.time_zone}, by the time-zone data {vehicle.time_zone_data}")
    else:
        page.row("local time", f"UTC {vehicle.utc_offset_us / _HOUR_US:+g} h")
    page.row("roles", ", ".join(policy.roles))
    page.rows("sources", policy.sources)

    page.head("Rules: a forbid wins, and without a permit nothing is allowed")
    for number, rule in enumerate(policy.rules):
        page.row(str(number), rule.text, width=2)
        if rule.target is not None:
            page.row("", f"flies {words.link(policy, rule.target)}", width=2)
    rules_left_out = [each.text for each in policy.left_out if each.skill < 0]
    if rules_left_out:
        page.rows("left out", [f"{text}: the vehicle is without a sensor for it" for text in rules_left_out])
    page.row("airspace", "anywhere" if policy.airspace is None else policy.airspace.text.removeprefix("airspace "))
    page.rows("contingency", [f"{n} {words.link(policy, link)}" for n, link in enumerate(policy.contingency)])
    if policy.contingency and all(0 <= link.skill < len(policy.contracts) for link in policy.contingency):
        most = words.duration(-(-falling_us(policy, None, Limits(), WAIT_US) // _MINUTE_US) * _MINUTE_US)
        page.row("", f"at most {most} until it is down, or given up after the last tries")
    page.row("without", _WITHOUT_EVIDENCE.get(policy.without_evidence, f"evidence: {policy.without_evidence}?"))
    then = _AFTER_SILENCE.get(policy.after_silence, f"{policy.after_silence}?")
    page.row("without", f"link for {words.duration(policy.silence_us)} {then}")

    if policy.monitors:
        page.head("Temporal monitors: what conditions of the past look at")
        for number, monitor in enumerate(policy.monitors):
            page.row(str(number), words.monitor(monitor), width=2)

    page.head("Zones")
    width = max((len(zone.name) for zone in policy.zones), default=0)
    for zone in policy.zones:
        page.row(zone.name, words.zone(policy, zone), width=width)

    page.head("Signals")
    width = max((len(signal.name) for signal in policy.signals), default=0)
    for signal in policy.signals:
        page.row(signal.name, _signal(signal), width=width)

    page.head("Skills: the contracts, with every default that the compiler filled in")
    for contract in policy.contracts:
        show_contract(page, policy, contract)


def _source(source: SignalSource) -> str:
    where = " and ".join(f"{name} = {value}" for name, value in source.where)
    return f"{source.message}.{', .'.join(source.fields)}" + (f" where {where}" if where else "")


def _signal(signal: Signal) -> str:
    sources = [_source(source) for source in signal.sources]
    unknown = sorted({value for source in signal.sources for value in source.unknown})
    parts = [f"{signal.dimension} from {' or '.join(sources)}", f"stale after {words.duration(signal.stale_us)}"]
    if unknown:
        parts.append(f"unknown where it is {', '.join(map(str, unknown))}")
    return "; ".join(parts)
