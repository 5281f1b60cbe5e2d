"""What the doctor finds about the vehicle itself: sensors, estimator, battery, and whether it would arm."""

from collections.abc import Iterator
from typing import Final

from rtshcua.adapters.doctor.examination import Examination
from rtshcua.adapters.doctor.finding import Finding, Verdict

_ACCURATE_MM: Final = 5_000


def readiness(vehicle: Examination) -> Iterator[Finding]:
    """Of the vehicle as it stands, whatever it is to fly."""
    seen, facts = vehicle.seen, vehicle.facts
    if seen.airborne:
        yield Finding("vehicle/airborne", Verdict.STOP, "it is in the air", "on the ground", "somebody else flies it")
    elif seen.armed:
        yield Finding("vehicle/armed", Verdict.STOP, "its motors are armed", "disarmed", "somebody else holds it")
    elif not seen.landed_state:
        found = "it does not say whether it is on the ground (EXTENDED_SYS_STATE)"
        yield Finding("vehicle/down", Verdict.UNKNOWN, found, "on the ground, disarmed")
    else:
        yield Finding("vehicle/down", Verdict.OK, "on the ground, disarmed")
    if seen.unready is None:
        yield Finding("vehicle/ready", Verdict.OK, "nothing that it tells of stands against arming")
    else:
        yield Finding("vehicle/ready", Verdict.STOP, seen.unready, "ready to arm")
    for name in seen.unwell:
        yield Finding("sensor/unwell", Verdict.STOP, f"{name}: there and in use, and not healthy", "healthy")
    yield _fix(vehicle)
    astray = seen.estimator.missing(seen.now_us)
    if astray is None:
        yield Finding("sensor/estimator", Verdict.OK, "its estimator knows place and height")
    else:
        yield Finding("sensor/estimator", Verdict.STOP, astray, "a place and a height")
    yield _battery(vehicle)
    for text in facts.texts:
        yield Finding("vehicle/said", Verdict.OK, f"it said, for what that is worth: {text}")


def _fix(vehicle: Examination) -> Finding:
    message = vehicle.facts.latest("GPS_RAW_INT")
    if message is None:
        return Finding("sensor/gps", Verdict.STOP, "no GPS_RAW_INT", "a 3D fix")
    if message.fix_type < 3:
        return Finding("sensor/gps", Verdict.STOP, f"fix type {message.fix_type}", "a 3D fix", "wait, or move it")
    accuracy = f", to {message.h_acc} mm" if message.h_acc else ""
    found = f"fix type {message.fix_type}, {message.satellites_visible} satellites{accuracy}"
    if message.h_acc <= _ACCURATE_MM:
        return Finding("sensor/gps", Verdict.OK, found)
    return Finding("sensor/gps", Verdict.WARN, found, f"to {_ACCURATE_MM} mm")


def _battery(vehicle: Examination) -> Finding:
    message = vehicle.facts.latest("BATTERY_STATUS") or vehicle.facts.latest("SYS_STATUS")
    if message is None or message.battery_remaining < 0:
        advice = "set up its battery monitor: an unknown charge permits nothing"
        return Finding("sensor/battery", Verdict.STOP, "it does not know its charge", "a charge in %", advice)
    return Finding("sensor/battery", Verdict.OK, f"{message.battery_remaining} %")
