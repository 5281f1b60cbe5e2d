"""What the doctor finds about the link and the autopilot at its other end."""

from collections.abc import Iterator
from typing import Final

from rtshcua.adapters.doctor.facts import Facts
from rtshcua.adapters.doctor.finding import Finding, Verdict
from rtshcua.mavlink.enums import MAV_AUTOPILOT_INVALID as NO_AUTOPILOT
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.mavlink.enums import MAV_TYPE_GCS as GROUND_STATION
from rtshcua.onboard.enforcement.frames import OURS

_SLOW_HEARTBEAT_US: Final = 1_500_000
_SLOW_US, _TOO_SLOW_US = 200_000, 1_000_000
#: parts of the frames that are missing, in 1/1000
_LOSSY, _TOO_LOSSY = 20, 200

#: the versions that the recorded answers and flights are of
_TESTED: Final = {"px4": (1, 16), "ardupilot": (4, 7)}
#: MAV_PROTOCOL_CAPABILITY, and whether a flight needs it
_FENCE, _TARGETS, _COMMAND_INT, _MAVLINK2 = 0x4000, 0x100, 0x08, 0x2000


def link(facts: Facts, flavour: str, *, keyed: bool, crowd: str | None, named: bool) -> Iterator[Finding]:
    """`keyed`: a link key was given, and what is not signed with it was dropped. `crowd`: another vehicle, as a run
    would refuse it; `named`: the operator said which system is meant.
    """
    yield _heartbeat(facts, flavour)
    yield _loss(facts)
    yield _signing(facts, keyed=keyed)
    yield _answers(facts)
    others = list(_others(facts, named=named))
    yield from others
    if crowd is not None and not any(each.slug == "link/other-vehicle" for each in others):
        yield Finding("link/other-vehicle", Verdict.STOP, crowd, "one vehicle")
    yield _round_trip(facts)
    yield _version(facts, flavour)
    yield from _capabilities(facts, flavour)


def _heartbeat(facts: Facts, flavour: str) -> Finding:
    stream = facts.streams.get("HEARTBEAT")
    interval_us = None if stream is None else stream.interval_us
    if interval_us is None:
        return Finding("link/heartbeat", Verdict.UNKNOWN, f"{flavour}, system {facts.system}: one heartbeat only")
    verdict = Verdict.WARN if interval_us > _SLOW_HEARTBEAT_US else Verdict.OK
    found = f"{flavour}, system {facts.system}, a heartbeat every {interval_us // 1_000} ms"
    return Finding("link/heartbeat", verdict, found, "" if verdict is Verdict.OK else "one a second, at the least")


def _loss(facts: Facts) -> Finding:
    talker = facts.talkers[facts.system, AUTOPILOT]
    sent = talker.frames + talker.missing
    lost = 1_000 * talker.missing // sent
    found = f"{talker.missing} of {sent} frames are missing ({lost // 10}.{lost % 10} %)"
    if lost < _LOSSY:
        return Finding("link/loss", Verdict.OK, found)
    verdict = Verdict.STOP if lost >= _TOO_LOSSY else Verdict.WARN
    return Finding("link/loss", verdict, found, "less than 2 %", "lower the stream rates, or look at the radio")


def _signing(facts: Facts, *, keyed: bool) -> Finding:
    talker = facts.talkers[facts.system, AUTOPILOT]
    signed = f"{talker.signed} of {talker.frames} frames are signed"
    if keyed:
        return Finding("link/signing", Verdict.OK if talker.signed else Verdict.STOP, signed)
    if talker.signed:
        return Finding("link/signing", Verdict.WARN, signed, "", "give its key with `--signing-key`")
    advice = "whoever reaches this link commands the vehicle: `rtshcua keys link` makes a key for MAVLink 2 signing"
    return Finding("link/signing", Verdict.WARN, "nothing is signed", "", advice)


def _answers(facts: Facts) -> Finding:
    if facts.answered:
        return Finding("link/answers", Verdict.OK, "it answers what it is asked")
    advice = "it may demand signed frames (`--signing-key`), or the way there may be closed"
    return Finding("link/answers", Verdict.STOP, "it answers nothing that it was asked", "answers", advice)


def _others(facts: Facts, *, named: bool) -> Iterator[Finding]:
    stations = 0
    for (system, component), talker in facts.others():
        if (system, component) == (facts.system, OURS):
            advice = "stop the other one: two that mediate do not see what the other commands"
            yield Finding("link/component", Verdict.STOP, f"another component {OURS} speaks here", "", advice)
        elif talker.kind == GROUND_STATION:
            stations += 1
        elif system != facts.system and component == AUTOPILOT and talker.autopilot not in (None, NO_AUTOPILOT):
            found = f"another vehicle speaks here too, system {system}"
            verdict = Verdict.WARN if named else Verdict.STOP
            yield Finding("link/other-vehicle", verdict, found, "one vehicle", "`--system` says which one is meant")
        elif system != facts.system:
            yield Finding("link/other-system", Verdict.WARN, f"system {system}, component {component} speaks here too")
    words = "no ground station is heard on this link" if not stations else f"{stations} ground station(s) heard"
    yield Finding("link/ground-station", Verdict.OK, words)


def _round_trip(facts: Facts) -> Finding:
    median, error = facts.round_trip_us, facts.clock_error_us
    if median is None or error is None:
        found = "TIMESYNC is not answered, so nobody knows how old its reports are"
        return Finding("link/round-trip", Verdict.STOP, found, "answers", "a router on the way may drop TIMESYNC (111)")
    found = f"{median // 1_000} ms there and back; its clock is known to {-(-error // 1_000)} ms"
    if median <= _SLOW_US:
        return Finding("link/round-trip", Verdict.OK, found)
    return Finding("link/round-trip", Verdict.STOP if median > _TOO_SLOW_US else Verdict.WARN, found, "at most 200 ms")


def _version(facts: Facts, flavour: str) -> Finding:
    message = facts.latest("AUTOPILOT_VERSION")
    if message is None:
        return Finding("autopilot/version", Verdict.UNKNOWN, "it does not tell its version")
    number = message.flight_sw_version
    version = (number >> 24 & 0xFF, number >> 16 & 0xFF, number >> 8 & 0xFF)
    found = f"{flavour} {'.'.join(map(str, version))}"
    tested = _TESTED[flavour]
    if version[:2] == tested:
        return Finding("autopilot/version", Verdict.OK, found)
    advice = f"the answers that we know were recorded of {'.'.join(map(str, tested))}: fly it in simulation first"
    return Finding("autopilot/version", Verdict.WARN, found, "", advice)


def _capabilities(facts: Facts, flavour: str) -> Iterator[Finding]:
    message = facts.latest("AUTOPILOT_VERSION")
    if message is None:
        return
    wanted = {_MAVLINK2: ("MAVLink 2", Verdict.STOP), _FENCE: ("a fence by MAVLink", Verdict.WARN)}
    if flavour == "px4":
        wanted[_COMMAND_INT] = ("COMMAND_INT", Verdict.STOP)
    else:
        wanted[_TARGETS] = ("position targets", Verdict.STOP)
    missing = [(name, verdict) for bit, (name, verdict) in wanted.items() if not message.capabilities & bit]
    for name, verdict in missing:
        yield Finding("autopilot/capability", verdict, f"it says that it cannot do {name}", name)
    if not missing:
        yield Finding("autopilot/capability", Verdict.OK, ", ".join(name for name, _ in wanted.values()))
