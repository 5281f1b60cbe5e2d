"""Write PX4 logs (ULog, docs.px4.io/main/en/dev_log/ulog_file_format): header, flags, formats, subscriptions, data."""

from collections.abc import Iterable, Mapping, Sequence
from struct import pack

_CODES = {"uint64_t": "Q", "int32_t": "i", "uint32_t": "I", "uint8_t": "B", "bool": "?", "float": "f", "double": "d"}

#: fields of PX4's messages, in parts, as releases have them
POSITION = {
    "old": ("uint64_t timestamp", "double lat", "double lon", "float alt", "float eph"),
    "new": (
        "uint64_t timestamp", "uint64_t timestamp_sample", "double lat", "double lon", "float alt",
        "bool lat_lon_valid", "bool alt_valid",
    ),
}  # fmt: skip
RECEIVER = {
    "vehicle_gps_position": (
        "uint64_t timestamp", "uint64_t time_utc_usec", "int32_t lat", "int32_t lon", "int32_t alt",
        "int32_t timestamp_time_relative", "uint8_t fix_type",
    ),
    "sensor_gps": (
        "uint64_t timestamp", "double latitude_deg", "double longitude_deg", "double altitude_msl_m",
        "uint64_t time_utc_usec", "int32_t timestamp_time_relative", "uint8_t fix_type",
    ),
    "vehicle_gnss": (
        "uint64_t timestamp", "double latitude", "double longitude", "double altitude_msl", "uint64_t time_utc_usec",
        "int32_t timestamp_time_relative", "uint8_t fix_type",
    ),
}  # fmt: skip


def message(kind: str, body: bytes) -> bytes:
    """A message with its header."""
    return pack("<HB", len(body), ord(kind)) + body


def ulog(formats: Mapping[str, Sequence[str]], data: Iterable[tuple[str, Sequence[float]]], start_us: int = 0) -> bytes:
    """A log with these messages, each topic once subscribed. `data` are names and values in the order of the fields."""
    numbers = {name: number for number, name in enumerate(formats)}
    parts = [b"ULog\x01\x12\x35\x01" + pack("<Q", start_us), message("B", bytes(40))]
    parts += [message("F", f"{name}:{';'.join(fields)};".encode()) for name, fields in formats.items()]
    system = b"char[3] sys_name"
    parts.append(message("I", bytes([len(system)]) + system + b"PX4"))
    parts += [message("A", pack("<BH", 0, number) + name.encode()) for name, number in numbers.items()]
    for name, values in data:
        layout = "<H" + "".join(_CODES[field.split()[0]] for field in formats[name])
        parts.append(message("D", pack(layout, numbers[name], *values)))
    return b"".join(parts)
