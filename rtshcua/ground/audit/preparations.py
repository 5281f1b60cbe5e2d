"""Checks the records about the autopilot's parameters that are set before a flight and restored after it.

A record `preparation` lists parameters with their previous and new values. Only these may be written until the next
such record or the next command. A record must not list a parameter that may not be set, restore another value than the
previous one, or come while a command is running.
"""

import re
from typing import Final, NamedTuple

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.records import Effect
from rtshcua.ground.audit.dispatches import DISPATCHED
from rtshcua.mavlink.parameters import bits_of

PREPARATION: Final = "preparation"
#: the event of the boundary's permit for a preparation
PERMITTED: Final = "permitted"
_DONE: Final = frozenset({"prepared", "not-prepared", DISPATCHED})
#: the allowed values of parameters,
_VALUES: Final = {
    "FENCE_ENABLE": frozenset({1.0}),
    "FENCE_TYPE": frozenset(float(kinds) for kinds in (4, 5, 6, 7, 12, 13, 14, 15)),
    "GF_ACTION": frozenset({2.0, 3.0, 5.0}),
}
#: and the allowed ranges of others
_RANGES: Final = {
    "FENCE_RADIUS": (30, 10_000), "FENCE_ALT_MAX": (10, 1_000), "FENCE_ALT_MIN": (-100, 100), "FENCE_MARGIN": (1, 10),
    "RTL_ALT": (30, 300_000), "RTL_ALT_M": (1, 3_000), "RTL_RETURN_ALT": (1, 3_000), "GF_MAX_HOR_DIST": (0, 10_000),
    "GF_MAX_VER_DIST": (0, 10_000),
}  # fmt: skip
_LISTED: Final = re.compile(r"(?P<what>set|restore) (?P<writes>[^,]++(?:, [^,]++){0,99})")
_WRITE: Final = re.compile(r"(?P<name>[A-Z0-9_]{1,16}) from (?P<before>\S+) to (?P<value>\S+)", re.ASCII)


class Listed(NamedTuple):
    """One parameter of a preparation."""

    name: str
    before: float
    value: float


class ListedParameters:
    """Checks the preparations of one log. `listed` are the parameters that may be written now."""

    def __init__(self) -> None:
        self.listed: tuple[Listed, ...] = ()
        #: the number of listed parameters, to be set and to be restored
        self.count = 0
        self._before: dict[str, float] = {}
        self._running: int | None = None
        self._requested = ""  # the list of the last preparation

    def check(self, record: Effect) -> Flaw | None:
        """Return a flaw if an effect is a preparation that is not allowed, else None."""
        if record.event in _DONE:
            self.listed = ()
        if record.event == DISPATCHED:
            self._running = record.token
        elif record.token == self._running:
            self._running = None
        if record.event == PERMITTED and record.detail != self._requested:
            text = "the boundary permitted other parameters than the preceding record lists"
            return Flaw("preparation/other-permit", text, record.detail, self._requested)
        if record.event != PREPARATION:
            return None
        self._requested = record.detail
        if self._running is not None:
            text = "parameters were listed to be set while a command was running"
            return Flaw("preparation/in-flight", text, record.detail)
        restoring, writes = _listed_writes(record.detail)
        if not writes:
            return Flaw("preparation/malformed", "the list of parameters is malformed", record.detail)
        flaw = next(filter(None, (self._flaw(each, restoring=restoring) for each in writes)), None)
        if flaw is not None:
            return flaw
        self.listed = writes
        self.count += len(writes)
        if not restoring:
            self._before = {each.name: each.before for each in writes} | self._before
        return None

    def _flaw(self, write: Listed, *, restoring: bool) -> Flaw | None:
        name, _, value = write
        if name not in _RANGES and name not in _VALUES:
            return Flaw("preparation/parameter", "this parameter may not be set", name)
        if restoring:
            before = self._before.get(name, value)
            text = "the value to restore is not the previous value of the parameter"
            return None if before == value else Flaw("preparation/other-value", text, _shown(value), _shown(before))
        low, high = _RANGES.get(name, (value, value))
        if low <= value <= high and value in _VALUES.get(name, (value,)):
            return None
        return Flaw("preparation/value", "this value is not allowed for the parameter", f"{name} {value:g}")


def _listed_writes(detail: str) -> tuple[bool, tuple[Listed, ...]]:
    found = _LISTED.fullmatch(detail)
    if found is None:
        return False, ()
    writes = []
    for text in found["writes"].split(", "):
        write = _WRITE.fullmatch(text)
        try:
            values = (0.0, float("nan")) if write is None else (float(write["before"]), float(write["value"]))
        except ValueError:
            return False, ()
        if write is None or any(bits_of(value) is None for value in values):
            return False, ()
        writes.append(Listed(write["name"], *values))
    return found["what"] == "restore", tuple(writes)


def _shown(value: float) -> str:
    return f"{value:.9g}"
