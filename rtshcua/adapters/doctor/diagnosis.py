"""The diagnosis: all findings of an examination, in the order in which a person would check."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import StrEnum
from types import MappingProxyType
from typing import Final

import msgspec

from rtshcua.adapters.doctor.examination import ExaminingDriver, Talker
from rtshcua.adapters.doctor.identity import Standing, firmware_of, those_that_matter
from rtshcua.adapters.doctor.settings import SETTINGS, VehicleSetting
from rtshcua.adapters.utc import TimeSources
from rtshcua.adapters.vehicle.bounds import FlightReach, reach_of
from rtshcua.adapters.vehicle.drain import drained
from rtshcua.adapters.vehicle.preflight import SAME_MM
from rtshcua.adapters.vehicle.returns import ONLY_ZERO, Need
from rtshcua.adapters.vehicle.source_time import VehicleClock
from rtshcua.adapters.vehicle.streams import IN_THE_AIR
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.mavlink.enums import MAV_TYPE_GCS as GROUND_STATION
from rtshcua.mavlink.modes import is_another
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import CELL, DRAIN, Signal
from rtshcua.model.flat.zone import project
from rtshcua.model.quantity import Dimension, display
from rtshcua.onboard.enforcement.frames import OURS
from rtshcua.onboard.rehearsal import needed
from rtshcua.wire.qualification import Firmware


class MissionVerdict(StrEnum):
    """What a finding means for a mission."""

    OK = "ok"
    WARN = "warn"  # the mission would fly, but a person should know
    STOP = "stop"  # the mission would not fly, or not to its end
    UNKNOWN = "unknown"  # the vehicle did not report it


OK, WARN, STOP, UNKNOWN = MissionVerdict


class VehicleFinding(msgspec.Struct, frozen=True):
    """The result of one check: a stable slug, the finding and, in case of a fault, what is needed and what to do."""

    slug: str
    verdict: MissionVerdict
    found: str
    needed: str = ""
    advice: str = ""


def told_apart(agent: str, user: int, own: int) -> VehicleFinding:
    """Whether the kernel can tell an agent, running as the user `agent` with the id `user`, from operators (`own`)."""
    found = f"the agent runs as `{agent}`"
    if user not in (0, own):
        return VehicleFinding("agents/user", MissionVerdict.OK, f"{found}, and the flight as another user")
    return VehicleFinding(
        "agents/user", MissionVerdict.WARN,
        f"{found}, as which it may open the operators' socket and cannot be told from an operator",
        "a user other than the flight's and other than root",
        "let the agent run as a user of its own, and give that user's group to `run --agent-group`",
    )  # fmt: skip


def diagnose(
    vehicle: ExaminingDriver, policy: Policy, flown: Mission | None, *, keyed: bool, time: TimeSources,
    unheard: frozenset[int] = frozenset(), named: bool = False,
    qualified: Callable[[Firmware | None, Mapping[str, bytes]], Standing] | None = None,
) -> Iterator[VehicleFinding]:  # fmt: skip
    """All findings. `flown` is the mission to fly, None for signals only. `keyed`: a link key was given, and frames
    without its signature were dropped. `unheard` are the slots of signals that cannot come on this link, because their
    messages come unsigned. `time` holds the sources of a run's time of day. `named`: the operator selected the system.
    `qualified` is the vehicle's standing by its qualification record; None if the vehicle's identity is unknown.

    Without a heartbeat of an autopilot there are no findings.
    """
    if vehicle.flavour is None:
        return
    found = _found(vehicle, policy, flown, keyed, time, unheard, named, qualified)
    if keyed or not locked(vehicle):
        yield from found
        return
    for each in found:  # without any answer, single missing facts are not findings of their own
        wrong = each.verdict is STOP or (each.verdict is WARN and each.slug.startswith("signal/"))
        if wrong and each.slug not in _WITHOUT_ANSWERS:
            yield VehicleFinding(each.slug, UNKNOWN, _NOT_ASKED)
        else:
            yield each


def _found(
    vehicle: ExaminingDriver, policy: Policy, flown: Mission | None, keyed: bool, time: TimeSources,
    unheard: frozenset[int], named: bool,
    qualified: Callable[[Firmware | None, Mapping[str, bytes]], Standing] | None,
) -> Iterator[VehicleFinding]:  # fmt: skip
    assert vehicle.flavour is not None
    flavour = vehicle.flavour.name
    yield _heartbeat(vehicle, flavour)
    yield _loss(vehicle)
    yield _signing(vehicle, keyed=keyed)
    yield _answers(vehicle)
    yield from _others(vehicle, named=named)
    yield _round_trip(vehicle.source.clock)
    yield _streams(vehicle, flavour)
    yield _kind(vehicle)
    yield from _version(vehicle, flavour)
    if qualified is not None:
        yield _qualification(vehicle, flavour, qualified)
    yield from _readiness(vehicle, policy)
    yield from _signals(vehicle, policy, flown, unheard)
    if flown is not None:
        yield _place(vehicle, policy)
        yield _clock(vehicle, time)
    yield from _settings(vehicle, flavour, policy, flown)


#: slugs that stop a mission without any answer of the vehicle
_WITHOUT_ANSWERS: Final = (
    "link/signing", "link/loss", "link/component", "link/other-vehicle", "autopilot/kind", "vehicle/airborne",
    "vehicle/armed", "sensor/unwell",
)  # fmt: skip
_NOT_ASKED: Final = "not checked: the vehicle answers signed frames only, and no key was given (`link/signing`)"


def _graded(
    slug: str, found: str, needed: str = "", advice: str = "", *, warns: bool = False, stops: bool = False
) -> VehicleFinding:
    """A finding with a need and an advice only if something is wrong."""
    if not (warns or stops):
        return VehicleFinding(slug, OK, found)
    return VehicleFinding(slug, STOP if stops else WARN, found, needed, advice)


# ---------------------------------------------------------------- the link

_SLOW_HEARTBEAT_US: Final = 1_500_000
_SLOW_US, _TOO_SLOW_US = 200_000, 1_000_000
#: the share of missing frames, in 1/1000
_LOSSY, _TOO_LOSSY = 20, 200


def _heartbeat(vehicle: ExaminingDriver, flavour: str) -> VehicleFinding:
    slug, who = "link/heartbeat", f"{flavour}, system {vehicle.system}"
    interval_us = vehicle.streams["HEARTBEAT"].interval_us
    if interval_us is None:
        return VehicleFinding(slug, UNKNOWN, f"{who}: one heartbeat only")
    found = f"{who}, a heartbeat every {interval_us // 1_000} ms"
    return _graded(slug, found, "at least one a second", warns=interval_us > _SLOW_HEARTBEAT_US)


def _loss(vehicle: ExaminingDriver) -> VehicleFinding:
    talker = vehicle.talkers[vehicle.system, AUTOPILOT]
    sent = talker.frames + talker.missing
    lost = 1_000 * talker.missing // sent
    found = f"{talker.missing} of {sent} frames are missing ({lost // 10}.{lost % 10} %)"
    advice = "lower the stream rates, or check the radio"
    return _graded("link/loss", found, "less than 2 %", advice, warns=lost >= _LOSSY, stops=lost >= _TOO_LOSSY)


def _signing(vehicle: ExaminingDriver, *, keyed: bool) -> VehicleFinding:
    talker = vehicle.talkers[vehicle.system, AUTOPILOT]
    signed = f"{talker.signed} of {talker.frames} frames are signed"
    if keyed:
        return VehicleFinding("link/signing", OK if talker.signed else STOP, signed)
    if locked(vehicle):
        found = f"{signed}, and the vehicle answers no unsigned frame"
        return VehicleFinding("link/signing", STOP, found, "its key", "give its key with `--signing-key`")
    if talker.signed:
        return VehicleFinding("link/signing", WARN, signed, "", "give its key with `--signing-key`")
    return VehicleFinding("link/signing", WARN, "no frame is signed", "", _for_signing(vehicle))


#: the first PX4 that accepts a key for MAVLink 2 signing
_PX4_SIGNS: Final = (1, 17)


def _for_signing(vehicle: ExaminingDriver) -> str:
    """The remedy for an unsigned link, for this autopilot's release."""
    risk = "anyone with access to this link can command the vehicle"
    make = "`rtshcua keys link` makes a key for MAVLink 2 signing"
    message, px4 = vehicle.latest("AUTOPILOT_VERSION"), vehicle.flavour is not None and vehicle.flavour.name == "px4"
    since = ".".join(map(str, _PX4_SIGNS))
    if not px4:
        return f"{risk}: {make}"
    if message is None:
        return f"{risk}: {make}, which PX4 accepts from {since} on"
    release = tuple(message.flight_sw_version.to_bytes(4)[:2])
    if release >= _PX4_SIGNS:
        return f"{risk}: {make}"
    has = ".".join(map(str, release))
    wire = "use a wire that nobody else has access to"
    return f"{risk}, and PX4 {has} accepts no key: {wire}, or update to PX4 {since} and run `rtshcua keys link`"


def locked(vehicle: ExaminingDriver) -> bool:
    """Whether it signs all its frames and answers no unsigned one."""
    talker = vehicle.talkers[vehicle.system, AUTOPILOT]
    return talker.frames == talker.signed and not _it_answers(vehicle)


def _it_answers(vehicle: ExaminingDriver) -> bool:
    return vehicle.answered or vehicle.source.clock.answered_us is not None


def _answers(vehicle: ExaminingDriver) -> VehicleFinding:
    answers = _it_answers(vehicle)
    found = "it answers requests" if answers else "it answers no request"
    advice = "it may require signed frames (`--signing-key`), or the link may carry nothing to it"
    return _graded("link/answers", found, "answers", advice, stops=not answers)


def _is_vehicle(talker: Talker) -> bool:
    return talker.kind is not None and talker.autopilot is not None and is_another(talker.kind, talker.autopilot)


def _others(vehicle: ExaminingDriver, *, named: bool) -> Iterator[VehicleFinding]:
    stations, crowd = 0, vehicle.link.crowd  # another vehicle: a run would refuse it
    for (system, component), talker in vehicle.talkers.items():
        if (system, component) == (vehicle.system, OURS):
            advice = "stop the other program: two such programs do not see each other's commands"
            yield VehicleFinding("link/component", STOP, f"another component {OURS} sends on this link", "", advice)
        elif talker.kind == GROUND_STATION:
            stations += 1
        elif system != vehicle.system and component == AUTOPILOT and _is_vehicle(talker):
            found, advice = f"another vehicle sends on this link, system {system}", "`--system` selects one"
            yield VehicleFinding("link/other-vehicle", WARN if named else STOP, found, "one vehicle", advice)
            crowd = None
        elif system != vehicle.system:
            yield VehicleFinding(
                "link/other-system", WARN, f"system {system}, component {component} also sends on this link"
            )
    words = "no ground station is heard on this link" if not stations else f"{stations} ground station(s) heard"
    yield VehicleFinding("link/ground-station", OK, words)
    if crowd is not None:
        yield VehicleFinding("link/other-vehicle", STOP, crowd, "one vehicle")


def _round_trip(clock: VehicleClock) -> VehicleFinding:
    slug, median, error = "link/round-trip", clock.round_trip_us, clock.error_us
    if median is None or error is None:
        found = "TIMESYNC is not answered, so the age of the reports is not known"
        return VehicleFinding(slug, STOP, found, "answers", "a router on the link may drop TIMESYNC (111)")
    found = f"{median // 1_000} ms round trip; the vehicle's clock is known to {-(-error // 1_000)} ms"
    return _graded(slug, found, "at most 200 ms", warns=median > _SLOW_US, stops=median > _TOO_SLOW_US)


_FASTER: Final = {
    "px4": "raise the port's `MAV_n_RATE` (octets a second; 1200 as it comes) to what the link carries, or set its "
    "`MAV_n_MODE` to Onboard",
    "ardupilot": "another program may request other rates (REQUEST_DATA_STREAM), or the port is at its limit",
}


def _streams(vehicle: ExaminingDriver, flavour: str) -> VehicleFinding:
    """The required streams, the link's capacity, and the delivered rates."""
    slug, requests = "link/streams", vehicle.stream_requests
    plan = requests.plan
    of = "" if plan.capacity is None else f" of {plan.capacity} that the link carries"
    if plan.shortfall is not None:
        advice = "use a faster link, or longer deadlines and `stale after` times in the policy"
        return VehicleFinding(slug, STOP, plan.shortfall, "room for the needed streams", advice)
    asked = f"{plan.octets} bytes/s requested{of}"
    if requests.measured is None:
        return VehicleFinding(slug, UNKNOWN, f"{asked}; not measured in this time", "", "listen longer (`--seconds`)")
    octets, came = requests.measured
    slow = [
        f"{name} every {came[name] // 1_000} ms instead of {plan.intervals[name] // 1_000}"
        for name in requests.slow
        if name in came
    ]
    found = f"{asked}, {octets} bytes/s received in all" + (f"; {', '.join(slow)}" if slow else "")
    return _graded(slug, found, "what is requested", _FASTER[flavour], warns=bool(slow))


# ---------------------------------------------------------------- the autopilot

#: the versions that the recordings were made with
_TESTED: Final = {"px4": (1, 16), "ardupilot": (4, 7)}
#: MAV_PROTOCOL_CAPABILITY bits that a flight needs or benefits from
_CAPABILITIES: Final = {
    "px4": {0x2000: ("MAVLink 2", STOP), 0x4000: ("a fence by MAVLink", WARN), 0x08: ("COMMAND_INT", STOP)},
    "ardupilot": {0x2000: ("MAVLink 2", STOP), 0x4000: ("a fence by MAVLink", WARN), 0x100: ("position targets", STOP)},
}


def _kind(vehicle: ExaminingDriver) -> VehicleFinding:
    """Whether it is a multirotor: nothing else is flown."""
    if vehicle.other_kind is not None:
        return VehicleFinding("autopilot/kind", STOP, vehicle.other_kind, "a multirotor", "nothing else is flown")
    return VehicleFinding("autopilot/kind", OK, "a multirotor")


def _version(vehicle: ExaminingDriver, flavour: str) -> Iterator[VehicleFinding]:
    message = vehicle.latest("AUTOPILOT_VERSION")
    if message is None:
        yield VehicleFinding("autopilot/version", UNKNOWN, "the vehicle does not report its version")
        return
    tested, version = _TESTED[flavour], tuple(message.flight_sw_version.to_bytes(4)[:3])
    found = f"{flavour} {'.'.join(map(str, version))}"
    needed = f"{flavour} {'.'.join(map(str, tested))}, which this release was tested with"
    advice = "fly this version in simulation first: the adapter was made from recordings of the tested version"
    yield _graded("autopilot/version", found, needed, advice, warns=version[:2] != tested)
    wanted = _CAPABILITIES[flavour]
    missing = [each for bit, each in wanted.items() if not message.capabilities & bit]
    for name, verdict in missing:
        yield VehicleFinding("autopilot/capability", verdict, f"the autopilot reports that it cannot do {name}", name)
    if not missing:
        yield VehicleFinding("autopilot/capability", OK, ", ".join(name for name, _ in wanted.values()))


def _qualification(
    vehicle: ExaminingDriver, flavour: str, qualified: Callable[[Firmware | None, Mapping[str, bytes]], Standing]
) -> VehicleFinding:
    """Whether this autopilot, with its present settings, passed a flight test of what the adapters assume."""
    message = vehicle.latest("AUTOPILOT_VERSION")
    values = {} if vehicle.parameters is None or vehicle.flavour is None else vehicle.parameters.values
    known = {} if vehicle.flavour is None else those_that_matter(vehicle.flavour, values)
    stands = qualified(None if message is None else firmware_of(flavour, message), known)
    advice = "`rtshcua qualify` flies a short test of it, and records the results (docs/flying/qualify.md)"
    return _graded("autopilot/qualified", stands.text, "qualified as it is", advice, warns=not stands.qualified)


# ---------------------------------------------------------------- the vehicle's present state, for any mission

_METRE: Final = 1_000  # mm
_ACCURATE_MM: Final = 5_000


def _readiness(vehicle: ExaminingDriver, policy: Policy) -> Iterator[VehicleFinding]:
    """Sensors, estimator, battery, and whether it would arm."""
    seen = vehicle.seen
    if seen.airborne:
        yield VehicleFinding("vehicle/airborne", STOP, "it is in the air", "on the ground", "somebody else flies it")
    elif seen.armed:
        yield VehicleFinding("vehicle/armed", STOP, "the motors are armed", "disarmed", "somebody else holds it")
    elif not seen.landed_state:
        found = "the vehicle does not report whether it is on the ground (EXTENDED_SYS_STATE)"
        yield VehicleFinding("vehicle/down", UNKNOWN, found, "on the ground, disarmed")
    else:
        yield VehicleFinding("vehicle/down", OK, "on the ground, disarmed")
    unready, astray = seen.unready, seen.estimator.missing(seen.now_us)
    found = unready or "the vehicle reports nothing that prevents arming"
    yield _graded("vehicle/ready", found, "ready to arm", stops=unready is not None)
    for name in seen.unwell:
        yield VehicleFinding("sensor/unwell", STOP, f"{name}: present and enabled, but not healthy", "healthy")
    yield _fix(vehicle)
    found = astray or "the estimator has a position and a height"
    yield _graded("sensor/estimator", found, "a position and a height", stops=astray is not None)
    yield _battery(vehicle, policy)
    yield from _cells(vehicle, policy)
    for text in vehicle.texts:
        yield VehicleFinding("vehicle/said", OK, f"the vehicle's message: {text}")


def _fix(vehicle: ExaminingDriver) -> VehicleFinding:
    message = vehicle.latest("GPS_RAW_INT")
    if message is None:
        return VehicleFinding("sensor/gps", STOP, "no GPS_RAW_INT", "a 3D fix")
    if message.fix_type < 3:
        return VehicleFinding("sensor/gps", STOP, f"fix type {message.fix_type}", "a 3D fix", "wait, or move it")
    accuracy = f", accurate to {display(message.h_acc, Dimension.LENGTH)}" if message.h_acc else ""
    found = f"fix type {message.fix_type}, {message.satellites_visible} satellites{accuracy}"
    needed = f"accurate to {display(_ACCURATE_MM, Dimension.LENGTH)}"
    return _graded("sensor/gps", found, needed, warns=message.h_acc > _ACCURATE_MM)


def settling(vehicle: ExaminingDriver) -> str | None:
    """What may still come by itself on a vehicle that was just switched on, in words."""
    fix = vehicle.latest("GPS_RAW_INT")
    if fix is not None and fix.fix_type < 3:
        return f"a 3D fix (its receiver has fix type {fix.fix_type})"
    if fix is not None and fix.h_acc > _ACCURATE_MM:
        least = display(_ACCURATE_MM, Dimension.LENGTH)
        return f"a fix accurate to {least} (its receiver reports {display(fix.h_acc, Dimension.LENGTH)})"
    if fix is None:
        return None  # there may be no receiver
    return None if vehicle.seen.estimator.missing(vehicle.seen.now_us) is None else "the estimator's position"


def settled(what: str, seconds: int, still: str | None) -> VehicleFinding:
    """That the vehicle was waited for, and for how long."""
    if still is None:
        found = f"waited {seconds} s for {what}"
        return VehicleFinding("sensor/settled", OK, found)
    found = f"waited {seconds} s for {still}, which did not arrive"
    return VehicleFinding("sensor/settled", WARN, found, "a settled vehicle", "give it a clear sky, and try again")


#: the voltage of a lithium cell at rest, in mV
_CELL_MV: Final = range(3_000, 4_400)


def _cells(vehicle: ExaminingDriver, policy: Policy) -> Iterator[VehicleFinding]:
    """Whether the battery has the number of cells of the policy's vehicle, judged by the voltage of one cell."""
    for signal in policy.signals:
        value = vehicle.values.get(signal.slot) if signal.name == CELL else None
        if value is None:
            continue
        found = f"{value / 1_000:.2f} V a cell, by the `cells` that the policy's vehicle declares"
        advice = "compare `cells` with the battery: with a wrong number the rule on the voltage means nothing"
        wrong = value not in _CELL_MV
        yield _graded("sensor/cells", found, "3 V to 4.4 V at rest", advice, stops=wrong)


def _battery(vehicle: ExaminingDriver, policy: Policy) -> VehicleFinding:
    """The charge that a run would use, and the batteries that it is from."""
    slot, batteries = policy.vehicle.battery, vehicle.batteries
    message = vehicle.latest("SYS_STATUS")
    if slot >= 0:
        known = vehicle.values.get(slot)
        charge = None if known is None else f"{known // 100} %"
    else:  # without the policy of a flight: the charge of its main battery
        charge = None if message is None or message.battery_remaining < 0 else f"{message.battery_remaining} %"
    each = f": {batteries.summary}" if len(batteries.told) > 1 else ""
    if charge is None:
        advice = "set up the battery monitor: no step is permitted with an unknown charge"
        return VehicleFinding("sensor/battery", STOP, f"the charge is unknown{each}", "a charge in %", advice)
    return VehicleFinding("sensor/battery", OK, f"{charge}{each}")


# ---------------------------------------------------------------- what a bundle needs

#: how often a message should come within the time to stale of its signals
_TIMES: Final = 2
_CLOCK_US: Final = 1_000_000
_ADVICE: Final = "a higher stream rate, or another source for the signal in the policy"


def _signals(
    vehicle: ExaminingDriver, policy: Policy, mission: Mission | None, unheard: frozenset[int]
) -> Iterator[VehicleFinding]:
    """Whether each signal of the policy is known and comes often enough. A fault stops a mission if a step is not
    admitted without the signal, by its contract.
    """
    well_known = policy.vehicle.position, policy.vehicle.position + 1, policy.vehicle.height, policy.vehicle.battery
    wanted = {slot for slot in well_known if slot >= 0}
    for invocation in () if mission is None else mission.invocations:
        wanted.update(needed(policy, invocation))
    for signal in policy.signals:
        slots = signal.slots
        bad = WARN if wanted.isdisjoint(slots) else STOP
        yield _signal(vehicle, policy, signal, slots, bad, signed=unheard.isdisjoint(slots))


def _known_later(signal: Signal, policy: Policy) -> VehicleFinding | None:
    """That a signal is known in the air only; None for another."""
    slug = f"signal/{signal.name}"
    if signal.name == DRAIN:
        declared = f"{drained(policy.vehicle) / 100:.1f} % a minute"
        found = f"`{signal.name}` is measured in the air only; until then the declared {declared} counts"
        return VehicleFinding(slug, UNKNOWN, found, "", "no action needed")
    if not IN_THE_AIR.issuperset(source.message for source in signal.sources):
        return None
    found = f"`{signal.name}` is known in the air only, so it is unknown now"
    return VehicleFinding(slug, UNKNOWN, found, "no rule about a takeoff may depend on it")


def _signal(
    vehicle: ExaminingDriver, policy: Policy, signal: Signal, slots: Sequence[int], bad: MissionVerdict, *, signed: bool
) -> VehicleFinding:
    slug, sources = f"signal/{signal.name}", [source.message for source in signal.sources]
    names = " or ".join(sources)
    if not signed:
        found = f"`{signal.name}` stays unknown: {names} comes unsigned, which this link ignores"
        return VehicleFinding(slug, bad, found, names, "`--unsigned-radio`, here and for `run`")
    heard = next((name for name in sources if name in vehicle.streams), None)
    unknown = any(vehicle.values.get(slot) is None for slot in slots)
    later = _known_later(signal, policy) if unknown and not vehicle.seen.airborne else None
    if later is not None:
        return later
    if heard is None:
        return VehicleFinding(slug, bad, f"`{signal.name}` stays unknown: no {names} arrives", names, _ADVICE)
    if unknown:
        found = f"`{signal.name}` is unknown now: {heard} reports no value, or one that is not confirmed"
        return VehicleFinding(slug, bad, found, "a value")
    told = next((each for slot in slots if (each := vehicle.told.get(slot))), vehicle.streams[heard])
    interval_us, stale_ms = told.interval_us, signal.stale_us // 1_000
    every = "came once" if interval_us is None else f"every {interval_us // 1_000} ms"
    found = f"`{signal.name}`: {heard} {every}, stale after {stale_ms} ms"
    if signal.name == DRAIN:
        found = "; ".join((found, *vehicle.consumption.summary))
    seldom = interval_us is None or interval_us * _TIMES > signal.stale_us
    return _graded(slug, found, f"twice within {stale_ms} ms", _ADVICE, warns=seldom)


def _place(vehicle: ExaminingDriver, policy: Policy) -> VehicleFinding:
    """Differences between this vehicle and the one that a bundle was made for."""
    preflight = vehicle.preflight
    unknown = preflight.unplaced or preflight.unread
    if preflight.astray is not None:
        return VehicleFinding("mission/unready", STOP, preflight.astray, "as in the policy")
    if unknown is not None:
        return VehicleFinding("mission/place", UNKNOWN, unknown, "as in the policy")
    if not policy.vehicle.return_altitude:
        found = "home is as in the policy; its return altitude was not compared: the policy has no `return at`"
        return VehicleFinding("mission/place", OK, found)
    return VehicleFinding("mission/place", OK, "home and return altitude are as in the policy")


_UNSYNCHRONISED: Final = "this machine's clock is not synchronised"
_STATE: Final = "`--utc-error 500ms`, here and for `run`, states the largest error of its time of day"
_STATE_THERE: Final = "`--utc-error US` in the boundary's command line states the largest error of its time of day"


def _clock(vehicle: ExaminingDriver, time: TimeSources) -> VehicleFinding:
    """The time of day that a run would use, by its order of sources."""
    ahead_us = vehicle.ahead_us
    if time.machine_us is None:
        if time.vehicle and ahead_us is not None:
            found = f"{_UNSYNCHRONISED}, so the vehicle's time counts (SYSTEM_TIME)"
            return VehicleFinding("mission/clock", OK, found)
        if time.stated_us is not None:
            found = f"{_UNSYNCHRONISED}; it is off by {time.stated_us / 1_000:g} ms at most, as stated by the operator"
            return VehicleFinding("mission/clock", OK, found)
        why = "the vehicle reports no time of day (SYSTEM_TIME)"
        help = f"synchronise this machine; {_STATE_THERE if time.listens else _STATE}"
        if not time.vehicle:
            why = "a boundary in a separate process accepts the vehicle's time only over a link with a key"
            help += "; or give a key" + ("" if time.listens else " (`--signing-key`)")
        found = f"{_UNSYNCHRONISED}, and {why}: every step would be deferred"
        return VehicleFinding("mission/clock", STOP, found, "the time of day and a bound on its error", help)
    if ahead_us is None:
        return VehicleFinding("mission/clock", UNKNOWN, "the vehicle does not report the time of day (SYSTEM_TIME)")
    if abs(ahead_us) <= _CLOCK_US + time.machine_us:
        return VehicleFinding("mission/clock", OK, "the vehicle's clock agrees with this machine's")
    found = f"the vehicle's clock and this machine's are {abs(ahead_us) // 1_000_000} s apart"
    advice = "one of them is wrong; validity periods and times of day are judged by this machine's clock"
    return VehicleFinding("mission/clock", WARN, found, "the same time", advice)


# ---------------------------------------------------------------- the autopilot's own reactions


def _settings(
    vehicle: ExaminingDriver, flavour: str, policy: Policy, flown: Mission | None
) -> Iterator[VehicleFinding]:
    """A finding for each parameter that the vehicle has."""
    if vehicle.parameters is None:
        return
    seen = vehicle.seen
    reach = FlightReach()
    if flown is not None and seen.located:
        here = project(policy.projection, seen.latitude, seen.longitude)
        reach = reach_of(flown.invocations, policy, here)
    yield from settings_told(flavour, vehicle.parameters.values, policy, reach, vehicle.meant)
    for names in vehicle.preflight.silent if vehicle.parameters.values else ():
        found = f"{names} was not answered: if the vehicle has it, its way home may differ from the proved one"
        yield VehicleFinding("settings/unanswered", UNKNOWN, found, "an answer", "try again, or look at it yourself")


def settings_told(
    flavour: str, values: Mapping[str, float], policy: Policy, reach: FlightReach,
    meant: Mapping[str, float] = MappingProxyType({}),
) -> Iterator[VehicleFinding]:  # fmt: skip
    """A finding for each parameter that was read, for a mission of this reach. `meant` holds values that a run would
    set.
    """
    told = [setting for setting in SETTINGS[flavour] if setting.parameter in values]
    for setting in told:
        name = setting.parameter
        other = meant.get(setting.otherwise, values.get(setting.otherwise))
        alone = setting.battery and not _sees_voltage(policy)
        yield _setting(setting, values[name], setting.needs(policy, reach), meant.get(name), other, alone=alone)
    for name in meant:
        if name not in values:
            found = f"the vehicle does not report `{name}`, which `--set` names: a run would be refused"
            yield VehicleFinding(f"settings/{name.lower()}", STOP, found, "a parameter that it has", "leave it out")
    if not told:
        absent = "none of the requested parameters was reported"
        yield VehicleFinding("settings/unread", UNKNOWN, absent, "the autopilot's own reactions")


def _sees_voltage(policy: Policy) -> bool:
    """Whether the policy uses a voltage: the charge may be measured wrongly."""
    return any(signal.dimension == Dimension.VOLTAGE.value for signal in policy.signals)


def _words(setting: VehicleSetting, value: float) -> str:
    if value == 0 and setting.at_zero:
        return setting.at_zero
    return f"{value * setting.mm / 1_000:g}{setting.unit}" if setting.mm else setting.words.get(value, f"{value:g}")


def _setting(
    setting: VehicleSetting, value: float, need: Need | None, meant: float | None, otherwise: float | None,
    *, alone: bool = False,
) -> VehicleFinding:  # fmt: skip
    """The value of a setting, the value that is needed, and how to change it. Settings with which a mission cannot fly
    are reported as `mission/unready`.

    With `meant`, the value of `--set`, that value is judged. `otherwise` is used in place of 0. `alone`: nothing else
    notices a failing battery, so a warning about this setting stops a mission.
    """
    slug, name = f"settings/{setting.parameter.lower()}", setting.parameter
    found = f"{setting.label}: {_words(setting, value)} ({name} = {value:g})"
    if meant is not None:
        found += f"; for a flight `--set` makes it {_words(setting, meant)} ({meant:g})"
        found += ", which it is" if meant == value else f", and {value:g} again after it"
        value = meant
    wrong = None if setting.limit is None else setting.limit.misfit(value, ONLY_ZERO)
    if wrong is not None:
        proved = f"the proofs about the way home do not cover this setting; set `{name}` to {wrong.accepted}"
        return _graded(slug, found, wrong.accepted, proved, warns=True)
    if setting.warns.get(value):
        return _warned(setting, slug, found, setting.warns[value], alone=alone)
    bound = _broken_bound(setting, otherwise if value == 0 and otherwise is not None else value, need)
    if bound is None:
        return VehicleFinding(slug, OK, found)
    wanted, should = bound
    needed = f"{wanted} {should * setting.mm / _METRE:g}{setting.unit}"
    return _graded(slug, found, needed, f"set `{name}` to {should:.10g}", warns=True)


def _warned(setting: VehicleSetting, slug: str, found: str, why: str, *, alone: bool) -> VehicleFinding:
    better = setting.better
    needed, how = (
        ("", "") if better is None else (setting.words.get(better, ""), f"; set `{setting.parameter}` to {better:g}")
    )
    if alone:
        why += ", and no condition of the policy reads a voltage: nothing would notice a failing battery"
    return _graded(slug, found, needed, why + how, warns=True, stops=alone)


def _broken_bound(setting: VehicleSetting, value: float, need: Need | None) -> tuple[str, float] | None:
    """The bound that a value breaks, in words and in units of the parameter; None for none."""
    if need is None or setting.mm == 0 or (value == 0 and setting.at_zero):
        return None
    has, mm = value * setting.mm, setting.mm
    exact = mm == _METRE and "speed" in setting.about  # a number whose decimals count
    if need.least is not None and has < need.least - SAME_MM:
        return "at least", need.least / _METRE if exact else -(-need.least // mm)
    if need.most is not None and has > need.most + SAME_MM:
        return "at most", need.most / _METRE if exact else need.most // mm
    return None
