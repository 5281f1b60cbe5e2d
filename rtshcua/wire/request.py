"""Requests to `enforce` (design section 4.5): below 1 KiB, integers and octets only, the same for every boundary.

The body is one string of octets in a fixed layout, big-endian: kind, step, link, the binding presented, the moment
(monotonic, UTC and its error), the release time, `L_rem` and the phase, then the state's values (8 octets a slot,
`UNKNOWN` for None) and ages (4 octets a slot), and what its temporal monitors say (1 octet each: 1 true, 2 false, 4
unknown). Times are in us. Nothing has a variable width, so one request has one encoding, and a boundary in C reads it
in place, without a parser.

The largest one: 21 octets around the body, 79 before the state, 12 for each of `MAX_SLOTS`, 1 for each of
`MAX_MONITORS`: 21 + 79 + 12 * 72 + 32 = 996.
"""

from functools import cache
from struct import Struct
from typing import Final, NamedTuple

import msgspec

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.limits import MAX_STALE, MAX_VALUE
from rtshcua.model.flat.situation import Now, State
from rtshcua.wire import artefact, names
from rtshcua.wire.digest import DIGEST_BYTES

#: the kinds of requests: a mission step, a link of a step's fallback chain, a link of the contingency
STEP, FALLBACK_LINK, CONTINGENCY_LINK = 0, 1, 2
#: the `link` of the target of a degrade rule
DEGRADE: Final = -1


class Ref(NamedTuple):
    """The subject of a request, a permit, a command or a record: `link` is -1 for a step, `step` -1 for the
    contingency.
    """

    kind: int
    step: int
    link: int


#: belongs to no step and no link
NOTHING: Final = Ref(-1, -1, -1)


#: the largest request in octets
MAX_SIZE: Final = 1023
#: Ages saturate at this value; the stale time of each signal is below it.
MAX_AGE_US: Final = MAX_STALE + 1
UNKNOWN: Final = -(1 << 63)
_TRUTHS: Final = frozenset({1, 2, 4})

_HEAD: Final = f">Bhh{DIGEST_BYTES}s5QH"
_HEAD_FIELDS: Final = 10


class Request(msgspec.Struct, frozen=True):
    """The runtime's request to dispatch a step or a link now.

    `link` is -1 for a step, and `DEGRADE` for the target of a degrade rule (kind `FALLBACK_LINK`); `step` is -1
    for a link of the contingency. `binding` is the invocation's, or for the contingency the policy's digest.
    `released_us`, `phase` and `remaining_us` are those of `Context`.
    """

    kind: int
    step: int
    link: int
    binding: bytes
    now: Now
    state: State
    released_us: int
    phase: int
    remaining_us: int

    @property
    def ref(self) -> Ref:
        """The subject of the request."""
        return Ref(self.kind, self.step, self.link)


def encode(request: Request) -> bytes:
    """The request's octets. Raises `struct.error` for values outside of the fields' ranges."""
    state, now = request.state, request.now
    values = state.values
    prefix, layout = _form(len(values), len(state.monitors))
    return prefix + layout.pack(
        request.kind,
        request.step,
        request.link,
        request.binding,
        now.monotonic_us,
        now.utc_us,
        now.utc_error_us,
        request.released_us,
        request.remaining_us,
        request.phase,
        *([UNKNOWN if value is None else value for value in values] if None in values else values),
        *state.ages,
        *state.monitors,
    )


def decode(data: bytes, slots: int, monitors: int) -> Request | Refusal:
    """Decode a request for a state of so many slots and temporal monitors, or return which rule its octets break.
    Accepts only octets that `encode` produces; raises nothing.
    """
    prefix, layout = _form(slots, monitors)
    if len(data) != len(prefix) + layout.size or not data.startswith(prefix):
        version = names.REQUEST.version
        what = f"not a request of version {version} for a state of {slots} slots and {monitors} monitors"
        return Refusal("malformed", what)
    fields = layout.unpack_from(data, len(prefix))
    kind, step, link, binding, at_us, utc_us, utc_error_us, released_us, remaining_us, phase = fields[:_HEAD_FIELDS]
    if kind > CONTINGENCY_LINK or step < -1 or link < -1:
        return Refusal("malformed", "the kind, step or link is out of range")
    if max(at_us, utc_us, utc_error_us, released_us, remaining_us) > MAX_VALUE:
        return Refusal("malformed", "a time is out of range")
    ages_at = _HEAD_FIELDS + slots
    said_at = ages_at + slots
    known = fields[_HEAD_FIELDS:ages_at]
    values: tuple[int | None, ...] = known
    if UNKNOWN in known:
        values = tuple([None if value == UNKNOWN else value for value in known])
        known = tuple([value for value in known if value != UNKNOWN])
    if known and not -MAX_VALUE <= min(known) <= max(known) <= MAX_VALUE:
        return Refusal("malformed", "a state value is out of range")
    ages, said = fields[ages_at:said_at], fields[said_at:]
    if not _TRUTHS.issuperset(said):
        return Refusal("malformed", "the value of a monitor is not a truth")
    now = Now(at_us, utc_us, utc_error_us)
    return Request(kind, step, link, binding, now, State(values, ages, said), released_us, phase, remaining_us)


@cache
def _form(slots: int, monitors: int) -> tuple[bytes, Struct]:
    """The beginning of every request for a state of this size, and the layout of the rest."""
    layout = Struct(f"{_HEAD}{slots}q{slots}I{monitors}B")
    body = bytes(layout.size)
    return artefact.wrap(names.REQUEST, body)[: -layout.size], layout
