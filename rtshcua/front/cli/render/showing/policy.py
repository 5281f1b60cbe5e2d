"""A policy, in full: what is permitted, to whom, where, and what every skill then means."""

from collections.abc import Iterator, Sequence

from rtshcua.adapters.loop import WAIT_US
from rtshcua.app.telling import prose
from rtshcua.app.wording import utc
from rtshcua.front.cli.render.showing.page import TextPage
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract, TimingClass
from rtshcua.model.flat.mission import Invocation, Mission, OnInadmissible
from rtshcua.model.flat.policy import AfterSilence, Policy, WithoutEvidence
from rtshcua.model.flat.signal import Signal, SignalSource
from rtshcua.model.step_number import number_of
from rtshcua.onboard.runtime.limits import Limits, falling_us

_NOTHING = "nothing"


def show_contract(page: TextPage, policy: Policy, contract: Contract) -> None:
    """Adds a contract to the page."""
    parameters = [prose.parameter(policy, parameter) for parameter in contract.parameters]
    page.text(f"{contract.name}({'' if parameters else ')'}")
    for parameter in parameters:
        page.text(parameter + ",", indent=6)
    if parameters:
        page.text(")")
    for name, value in fields(policy, contract):
        page.row(name, value, indent=6, width=9)


def fields(policy: Policy, contract: Contract) -> list[tuple[str, str]]:
    """The fields but for the parameters, by the words of the language; a name is empty where it goes on."""
    during = f" during {', '.join(contract.phases)}" if contract.phases else ", in any phase"
    chain = [f"{n} {prose.link(policy, link)}" for n, link in enumerate(contract.fallback)]
    left_out = [
        f"{clause.part} {clause.text}: the vehicle is without a sensor for it"
        for clause in policy.left_out
        if clause.skill >= 0 and policy.contracts[clause.skill].name == contract.name
    ]
    return [
        ("motion", prose.motion(contract)),
        ("class", TimingClass(contract.timing_class).name.lower()),
        ("deadline", f"{prose.duration(contract.deadline_us)} after release"),
        ("valid", f"for {prose.duration(contract.validity_us)} after issue{during}"),
        ("lasts", f"at most {prose.duration(contract.duration_us)}"),
        ("grace", f"{prose.duration(contract.grace_us)}: how long a signal may be unknown while the step runs"),
        *_list("require", _texts(contract.require)),
        *_list("assume", _texts(contract.assume)),
        *_list("maintain", _texts(contract.maintain)),
        *(_list("left out", left_out) if left_out else ()),
        *_list("fallback", chain),
        ("energy", f"at most {prose.ratio(contract.energy)}"),
        ("record", ", ".join(contract.record) or _NOTHING),
        *(_list("emits", _emitted(contract)) if contract.emits else []),
    ]


def _emitted(contract: Contract) -> list[str]:
    return [each.text.removeprefix("emits").lstrip() for each in contract.emits]


def _texts(clauses: Sequence[Clause]) -> list[str]:
    return [clause.text for clause in clauses]


def _list(name: str, values: Sequence[str]) -> list[tuple[str, str]]:
    return [(name if number == 0 else "", value) for number, value in enumerate(values or [_NOTHING])]


#: what `without evidence` says, and means
_WITHOUT_EVIDENCE: dict[int, str] = {
    WithoutEvidence.LAND: "evidence land: while records cannot be kept, the mission is aborted",
    WithoutEvidence.REFUSE: "evidence refuse: while records cannot be kept, no further step begins",
}
#: what `without link` says, and means
_AFTER_SILENCE: dict[int, str] = {
    AfterSilence.CONTINUE: "continue: after a longer silence the step continues while its conditions hold",
    AfterSilence.CONTINGENCY: "contingency: after a longer silence the mission is aborted, and the contingency flies",
}
_HOUR_US = 3_600_000_000
_MINUTE_US = 60_000_000


def show_policy(page: TextPage, policy: Policy) -> None:
    """Adds a policy to the page."""
    page.head(f"Policy {policy.name} version {policy.version}")
    for name, value in _of_vehicle(policy):
        page.row(name, value)
    page.row("roles", ", ".join(policy.roles))
    page.rows("sources", policy.sources)
    page.head("Rules: a forbid wins, and without a permit nothing is allowed")
    _show_rules(page, policy)
    if policy.monitors:
        page.head("Temporal monitors: what conditions of the past look at")
        for number, monitor in enumerate(policy.monitors):
            page.row(str(number), prose.monitor(monitor), width=2)
    for title, named in (
        ("Zones", [(zone.name, prose.zone(policy, zone)) for zone in policy.zones]),
        ("Signals", [(signal.name, _signal(signal)) for signal in policy.signals]),
    ):
        page.head(title)
        width = max((len(name) for name, _ in named), default=0)
        for name, value in named:
            page.row(name, value, width=width)
    page.head("Skills: the contracts, with every default that the compiler filled in")
    for contract in policy.contracts:
        show_contract(page, policy, contract)


def _of_vehicle(policy: Policy) -> Iterator[tuple[str, str]]:
    """The vehicle, by the words of the page."""
    vehicle, projection = policy.vehicle, policy.projection
    yield "vehicle", f"`{vehicle.identity}`, declared as {vehicle.name}"
    home = prose.geographic(projection.latitude, projection.longitude)
    yield "home", f"{home}, within {prose.length(vehicle.home_within)}"
    yield "moves", f"at most {prose.speed(vehicle.speed)}, climbs at most {prose.speed(vehicle.climb)}"
    if vehicle.speeds is not None:
        kept, wind = vehicle.speeds, prose.speed(vehicle.speeds.wind)
        up, down = prose.speed(kept.climb), prose.speed(kept.descent)
        yield "keeps", f"at least {prose.speed(kept.cruise)}, {up} up, {down} down, in at most {wind} of wind"
    if vehicle.return_altitude:
        yield "returns", f"at {prose.length(vehicle.return_altitude)} above home, if it flies lower"
    if vehicle.braking:
        braking, reaction = prose.speed(vehicle.braking), prose.duration(vehicle.reaction_us)
        yield "brakes", f"by {braking} in a second, after {reaction}: limits apply at the point where it would stop"
    yield (
        "position",
        f"true to {prose.length(vehicle.position_error)}: every planned path is widened by this error",
    )
    hover, reserve = prose.duration(vehicle.endurance_us), prose.ratio(vehicle.reserve)
    yield "energy", f"a full battery hovers {hover}; {reserve} stay in reserve"
    if vehicle.without:
        yield "without", f"{', '.join(vehicle.without)}: not fitted; what reads it `where fitted` is left out"
    if vehicle.servos:
        yield "servos", f"{', '.join(map(str, vehicle.servos))}: free outputs, which skills may set"
    offset, data = f"UTC {vehicle.utc_offset_us / _HOUR_US:+g} h", vehicle.time_zone_data
    yield "local time", f"{vehicle.time_zone}, by the time-zone data {data}" if vehicle.time_zone else offset


def _show_rules(page: TextPage, policy: Policy) -> None:
    """The rules, the airspace, the contingency, and what is done without evidence or link."""
    for number, rule in enumerate(policy.rules):
        page.row(str(number), rule.text, width=2)
        if rule.target is not None:
            page.row("", f"flies {prose.link(policy, rule.target)}", width=2)
    rules_left_out = [each.text for each in policy.left_out if each.skill < 0]
    if rules_left_out:
        page.rows("left out", [f"{text}: the vehicle is without a sensor for it" for text in rules_left_out])
    page.row("airspace", "anywhere" if policy.airspace is None else policy.airspace.text.removeprefix("airspace "))
    page.rows("contingency", [f"{n} {prose.link(policy, link)}" for n, link in enumerate(policy.contingency)])
    if policy.contingency and all(0 <= link.skill < len(policy.contracts) for link in policy.contingency):
        most = prose.duration(-(-falling_us(policy, None, Limits(), WAIT_US) // _MINUTE_US) * _MINUTE_US)
        page.row("", f"at most {most} until the vehicle is on the ground, or the last attempt has failed")
    page.row("without", _WITHOUT_EVIDENCE.get(policy.without_evidence, f"evidence: {policy.without_evidence}?"))
    then = _AFTER_SILENCE.get(policy.after_silence, f"{policy.after_silence}?")
    page.row("without", f"link for {prose.duration(policy.silence_us)} {then}")


def _source(source: SignalSource) -> str:
    where = " and ".join(f"{name} = {value}" for name, value in source.where)
    return f"{source.message}.{', .'.join(source.fields)}" + (f" where {where}" if where else "")


def _signal(signal: Signal) -> str:
    sources = [_source(source) for source in signal.sources]
    unknown = sorted({value for source in signal.sources for value in source.unknown})
    parts = [f"{signal.dimension} from {' or '.join(sources)}", f"stale after {prose.duration(signal.stale_us)}"]
    if unknown:
        parts.append(f"unknown where it is {', '.join(map(str, unknown))}")
    return "; ".join(parts)


def show_mission(page: TextPage, mission: Mission, policy: Policy) -> None:
    """Adds a mission to the page."""
    page.head(f"Mission {mission.name}")
    page.row("intent", mission.intent or "not said")
    page.row("proposed by", mission.proposer or "a person")
    page.row("vehicle", f"`{mission.vehicle}`")
    page.row("policy", f"{mission.policy} version {mission.policy_version}, digest {mission.policy_digest.hex()}")
    page.row("issued", utc(mission.issued_at_us))
    page.rows("sources", mission.sources)
    phase = -1
    for invocation in mission.invocations:
        if invocation.phase != phase:
            phase = invocation.phase
            page.head(f"Phase {mission.phases[phase]}")
        _show_step(page, invocation, mission, policy)


def _show_step(page: TextPage, step: Invocation, mission: Mission, policy: Policy) -> None:
    contract = step.contract
    page.text(
        f"{number_of(step.step):>2} {contract.name}({prose.arguments(policy, contract.parameters, step.arguments)})"
    )
    phases = [name for number, name in enumerate(mission.phases) if step.phases >> number & 1]
    rows = [
        ("asked by", f"role {policy.roles[step.role]} through {prose.source(step.source)}"),
        ("goes", prose.plan(policy, step.plan)),
        ("valid", f"until {utc(step.issued_at_us + contract.validity_us)}, during {', '.join(phases)}"),
        ("otherwise", f"{OnInadmissible(step.on_inadmissible).name.lower()}, when it is not admitted in the air"),
        ("id", step.invocation_id.hex()),
        ("binding", step.binding.hex()),
        *_tightened(step, policy),
    ]
    for name, value in rows:
        page.row(name, value, indent=6, width=9)


def _tightened(step: Invocation, policy: Policy) -> list[tuple[str, str]]:
    """How the step's contract differs from its skill's."""
    own, skill = fields(policy, step.contract), fields(policy, policy.contracts[step.skill])
    if own == skill:
        return [("contract", "the skill's own")]
    return [("contract", "tighter than the skill's in:"), *(each for each in own if each not in skill)]
