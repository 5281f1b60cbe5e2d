"""The lines of a flight that the server reads, by type: who listens at a socket may say anything.

Each has the fields that something here reads, with their types. What a line has besides is passed on as it came.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Final

import msgspec

from rtshcua.evidence.records import DecisionRecord

_Count = Annotated[int, msgspec.Meta(ge=0, lt=1 << 53)]
_Step = Annotated[int, msgspec.Meta(ge=-1, lt=1 << 31)]
_Octets = Annotated[str, msgspec.Meta(pattern=r"^(?:[0-9a-f]{2})*\Z")]


class _Hello(msgspec.Struct):
    flight: _Octets
    vehicle: str = ""
    mode: str = ""


class _Waiting(msgspec.Struct):
    policy: str = ""


class _Vehicle(msgspec.Struct):
    ready: bool = False
    unready: str | None = None
    armed: bool | None = None
    airborne: bool | None = None
    signals: Any = None


class _Mission(msgspec.Struct):
    digest: _Octets


class _Decided(msgspec.Struct):
    """What is asked of a decision beyond its record's types."""

    binding: _Octets
    invocation: _Octets
    step: _Step


class _Effect(msgspec.Struct):
    seq: _Count
    event: str
    step: _Step = -1
    detail: str = ""


class _Sealing(msgspec.Struct):
    seq: _Count


class _Close(msgspec.Struct):
    seq: _Count
    ending: str


_TYPES: Final[Mapping[str, type[msgspec.Struct]]] = {
    "hello": _Hello,
    "waiting": _Waiting,
    "vehicle": _Vehicle,
    "mission": _Mission,
    "decision": DecisionRecord,
    "effect": _Effect,
    "seal": _Sealing,
    "recover": _Sealing,
    "close": _Close,
}


def understood(told: Any) -> dict[str, Any]:
    """A line that has a type which is read here, else an empty one. Raises msgspec.ValidationError for one whose fields
    are not those of its type.
    """
    found: dict[str, Any] = told if isinstance(told, dict) else {}
    kind = found.get("type")
    fields = _TYPES.get(kind) if isinstance(kind, str) else None
    if fields is None:
        return {}
    msgspec.convert(found, fields)
    if fields is DecisionRecord:
        msgspec.convert(found, _Decided)
    return found
