"""What a log says of the autopilot's parameters: which were set before the flight, to what, and to what put back.

A record `preparation` lists each with the value that it had and the one that it gets; until the next record about that,
or the next command, just these may be written. No log may list a parameter that is never set, put one back to another
value than it had, or list any while a command is under way.
"""

import re
from typing import Final, NamedTuple

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.records import Effect
from rtshcua.ground.audit.dispatches import DISPATCHED
from rtshcua.mavlink.parameters import bits_of

PREPARATION: Final = "preparation"
#: what the boundary permitted of it
PERMITTED: Final = "permitted"
_DONE: Final = frozenset({"prepared", "not-prepared", DISPATCHED})
#: what is set of an autopilot: to one of these values,
_VALUES: Final = {
    "FENCE_ENABLE": frozenset({1.0}),
    "FENCE_TYPE": frozenset(float(kinds) for kinds in (4, 5, 6, 7, 12, 13, 14, 15)),
    "GF_ACTION": frozenset({2.0, 3.0, 5.0}),
}
#: or to one from the first to the second
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
    """Follows one log; what it keeps is bounded by the parameters that may be set. `listed` may be written now."""

    def __init__(self) -> None:
        self.listed: tuple[Listed, ...] = ()
        #: how many parameters were listed, to be set and to be put back
        self.count = 0
        self._before: dict[str, float] = {}
        self._running: int | None = None
        self._asked = ""  # what the last preparation listed

    def check(self, record: Effect) -> Flaw | None:
        """What is wrong with an effect, or None."""
        if record.event in _DONE:
            self.listed = ()
        if record.event == DISPATCHED:
            self._running = record.token
        elif record.token == self._running:
            self._running = None
        if record.event == PERMITTED and record.detail != self._asked:
            text = "the boundary permitted other parameters than the record before it lists"
            return Flaw("preparation/other-permit", text, record.detail, self._asked)
        if record.event != PREPARATION:
            return None
        self._asked = record.detail
        if self._running is not None:
            text = "parameters were to be set while a command was under way"
            return Flaw("preparation/in-flight", text, record.detail)
        restoring, writes = _listed_writes(record.detail)
        if not writes:
            return Flaw("preparation/malformed", "it lists no parameters as such a record does", record.detail)
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
            return Flaw("preparation/parameter", "it lists a parameter that is never set", name)
        if restoring:
            before = self._before.get(name, value)
            text = "a parameter was to be put back to another value than it had"
            return None if before == value else Flaw("preparation/other-value", text, _shown(value), _shown(before))
        low, high = _RANGES.get(name, (value, value))
        if low <= value <= high and value in _VALUES.get(name, (value,)):
            return None
        return Flaw("preparation/value", "a parameter was to be set to what it is never set to", f"{name} {value:g}")


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
