"""A flight as MCAP (https://mcap.dev/spec) with channels in JSON, for Foxglove and PlotJuggler.

Positions are `foxglove.LocationFix` and texts of the vehicle `foxglove.Log` (https://docs.foxglove.dev/docs/sdk/schemas);
the schemas of other channels are in the file, with units and datum. Times are UTC in ns. Needs the extra `export`.
"""

import json
from collections.abc import Iterator, Mapping
from io import BytesIO
from typing import Any, Final, NamedTuple

from mcap.writer import Writer

from rtshcua.ground.flight.export.exported import (
    DEGREES,
    HEADING,
    METRES,
    ExportedRecord,
    FlightExport,
    number,
    shown,
)
from rtshcua.ground.flight.flown import SignalSeries, TrackPoint
from rtshcua.ground.flight.units import unit_of

DATUM: Final = "`foxglove.LocationFix.altitude` is above mean sea level; other heights name their datum"

Schema = dict[str, Any]
_SECOND: Final = 1_000_000_000

_TIME: Final[Schema] = {
    "type": "object",
    "title": "time",
    "properties": {
        "sec": {"type": "integer", "minimum": 0},
        "nsec": {"type": "integer", "minimum": 0, "maximum": _SECOND - 1},
    },
}
_FIX: Final[Schema] = {
    "title": "foxglove.LocationFix",
    "description": "Where the autopilot said that the vehicle is (GLOBAL_POSITION_INT); its covariance is not known",
    "type": "object",
    "properties": {
        "timestamp": _TIME | {"description": "UTC"},
        "frame_id": {"type": "string", "description": "the vehicle"},
        "latitude": {"type": "number", "description": "degrees north, WGS 84"},
        "longitude": {"type": "number", "description": "degrees east, WGS 84"},
        "altitude": {"type": "number", "description": "metres above mean sea level"},
        "position_covariance": {
            "type": "array", "items": {"type": "number"}, "minItems": 9, "maxItems": 9,
            "description": "zero, because it is not known",
        },
        "position_covariance_type": {"type": "integer", "enum": [0, 1, 2, 3], "description": "0: unknown"},
    },
}  # fmt: skip
_LOG: Final[Schema] = {
    "title": "foxglove.Log",
    "description": "A text of the vehicle (STATUSTEXT), which is not to be trusted",
    "type": "object",
    "properties": {
        "timestamp": _TIME | {"description": "UTC"},
        "level": {
            "type": "integer", "enum": [0, 1, 2, 3, 4, 5], "description": "unknown, debug, info, warning, error, fatal"
        },
        "message": {"type": "string"},
        "name": {"type": "string", "description": "the vehicle"},
        "file": {"type": "string"},
        "line": {"type": "integer", "minimum": 0},
    },
}  # fmt: skip
#: the level of `foxglove.Log` by MAV_SEVERITY
_LEVELS: Final = (5, 5, 5, 4, 3, 2, 2, 1)


def _object(title: str, description: str, **fields: str) -> Schema:
    """A schema of fields with descriptions; a field whose name ends in `_` is a text."""
    properties = {
        name.rstrip("_"): {"type": "string" if name.endswith("_") else "number", "description": words}
        for name, words in fields.items()
    }
    return {"title": title, "description": description, "type": "object", "properties": properties}


_STATE: Final = _object(
    "rtshcua.Position",
    "Height and movement as the autopilot said (GLOBAL_POSITION_INT, TERRAIN_REPORT or ALTITUDE)",
    above_sea_m="metres above mean sea level",
    above_home_m="metres above home",
    above_ground_m="metres above ground; absent if not known",
    speed_north_m_s="m/s over ground, to true north",
    speed_east_m_s="m/s over ground, to the east",
    speed_down_m_s="m/s, down",
    heading_true_deg="degrees from true north; absent if not known",
)
_RECORDS: Final = {
    True: _object(
        "rtshcua.Decision",
        "A decision, from the log",
        step_number="number of the step in its mission, from 1; 0: none",
        outcome_="allow, deny, defer or fallback",
        reason_="stable slug",
        words_="the decision in words",
    ),
    False: _object(
        "rtshcua.Event",
        "An event, from the log",
        step_number="number of the step in its mission, from 1; 0: none",
        event_="stable slug",
        words_="the event in words",
    ),
}


class _Message(NamedTuple):
    topic: str
    utc_us: int
    content: Mapping[str, object]


def mcap_file(export: FlightExport) -> bytes:
    """The file, with messages in the order of their times."""
    output = BytesIO()
    writer = Writer(output)
    writer.start("", export.made_by)
    description = export.description(f"heights: {DATUM}")
    writer.add_metadata("rtshcua", {"description": "\n".join(description), "log": shown(export.log_status)})
    channels = {topic: _channel(writer, topic, schema) for topic, schema in _channels(export).items()}
    for sequence, each in enumerate(sorted(_messages(export), key=lambda each: each.utc_us)):
        data = json.dumps(each.content, separators=(",", ":")).encode()
        time_ns = each.utc_us * 1_000
        writer.add_message(channels[each.topic], time_ns, data, time_ns, sequence)
    writer.finish()  # type: ignore[no-untyped-call]
    return output.getvalue()


def _channel(writer: Writer, topic: str, schema: Schema) -> int:
    number = writer.register_schema(schema["title"], "jsonschema", json.dumps(schema).encode())
    return writer.register_channel(topic, "json", number, {"description": schema["description"]})


def _topic(signal: SignalSeries) -> str:
    return f"/signals/{shown(signal.name).replace('.', '/')}"


def _channels(export: FlightExport) -> dict[str, Schema]:
    telemetry = export.flight.telemetry
    channels = {"/location": _FIX, "/position": _STATE, "/decisions": _RECORDS[True], "/events": _RECORDS[False]}
    channels["/texts"] = _LOG
    for signal in () if telemetry is None else telemetry.signals:
        name, unit = shown(signal.name), unit_of(signal)
        value = unit.suffix or "value"
        fields = {value: f"{name} in {unit.suffix}" if unit.suffix else name}
        if signal.labels:
            fields["label_"] = "the name of the value"
        absent = "; without a value it was reported as unknown"
        channels[_topic(signal)] = _object(f"rtshcua.signal.{name}", f"Signal {name} of the policy{absent}", **fields)
    return channels


def _messages(export: FlightExport) -> Iterator[_Message]:
    flight, telemetry = export.flight, export.flight.telemetry
    vehicle = shown(flight.genesis.vehicle)
    for each in export.told:
        topic = "/decisions" if each.is_decision else "/events"
        yield _Message(topic, flight.utc_of(each.t_us), _record(each))
    if telemetry is None:
        return
    for point in telemetry.track:
        utc_us = flight.utc_of(point.t_us)
        yield _Message("/location", utc_us, _fix(point, utc_us, vehicle))
        yield _Message("/position", utc_us, _state(point))
    for signal in telemetry.signals:
        topic, unit = _topic(signal), unit_of(signal)
        for t_us, value in signal.points:
            content: dict[str, object] = {}
            if value is not None:
                content[unit.suffix or "value"] = number(value, unit.digits)
                if value in signal.labels:
                    content["label"] = shown(signal.labels[value])
            yield _Message(topic, flight.utc_of(t_us), content)
    for text in telemetry.texts:
        utc_us = flight.utc_of(text.t_us)
        level = _LEVELS[text.severity] if 0 <= text.severity < len(_LEVELS) else 0
        says = {"timestamp": _time(utc_us), "level": level, "message": shown(text.text), "name": vehicle}
        yield _Message("/texts", utc_us, says | {"file": "", "line": 0})


def _time(utc_us: int) -> dict[str, int]:
    return {"sec": utc_us // 1_000_000, "nsec": utc_us % 1_000_000 * 1_000}


def _fix(point: TrackPoint, utc_us: int, vehicle: str) -> dict[str, object]:
    return {
        "timestamp": _time(utc_us),
        "frame_id": vehicle,
        "latitude": number(point.latitude, DEGREES),
        "longitude": number(point.longitude, DEGREES),
        "altitude": number(point.above_sea, METRES),
        "position_covariance": [0] * 9,
        "position_covariance_type": 0,
    }


def _state(point: TrackPoint) -> dict[str, object]:
    found: dict[str, object] = {
        "above_sea_m": number(point.above_sea, METRES),
        "above_home_m": number(point.above_home, METRES),
        "speed_north_m_s": number(point.north, METRES),
        "speed_east_m_s": number(point.east, METRES),
        "speed_down_m_s": number(point.down, METRES),
    }
    if point.above_ground is not None:
        found["above_ground_m"] = number(point.above_ground, METRES)
    if point.heading is not None:
        found["heading_true_deg"] = number(point.heading, HEADING)
    return found


def _record(each: ExportedRecord) -> dict[str, object]:
    step = {"step_number": each.step_number or 0}
    if each.is_decision:
        return step | {"outcome": shown(each.name), "reason": shown(each.reason), "words": shown(each.words)}
    return step | {"event": shown(each.name), "words": shown(each.words)}
