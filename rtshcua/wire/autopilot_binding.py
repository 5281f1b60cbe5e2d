"""Autopilot bindings: signed statements that an autopilot's own log belongs to an evidence log, and how far they agree.

A binding names both by digests, and states the result of comparing their tracks. The log key signs it, like the other
observations about its vehicle (docs/adr/0091). It permits nothing, and has nothing to do with the binding of an
invocation (`rtshcua/wire/binding.py`).
"""

from typing import Final, Literal

from rtshcua.model.flat.limits import MAX_VALUE
from rtshcua.model.flat.struct import Flat
from rtshcua.wire import artefact, cose, names
from rtshcua.wire.bundle import open_envelope, parse
from rtshcua.wire.digest import DIGEST_BYTES
from rtshcua.wire.document import FLIGHT_BYTES
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import TrustRoot, key_refusal
from rtshcua.wire.untrusted import Untrusted

#: a larger binding is refused unread, in bytes
MAX_AUTOPILOT_BINDING: Final = 1 << 16
#: the most deviations in a binding
MAX_DEVIATIONS: Final = 256
#: the longest name of a file, in characters
MAX_NAME: Final = 255


class AutopilotBindingError(Untrusted):
    """An autopilot binding that is refused: `malformed`, `wrong-vehicle`, `key-expired`."""


class BoundDeviation(Flat, frozen=True):
    """A time in which the tracks do not agree: from and to in us since the evidence log's first record, the number of
    points, and the largest horizontal and vertical deviation in mm.
    """

    from_us: int
    to_us: int
    points: int
    horizontal: int
    vertical: int


class AutopilotBinding(Flat, frozen=True):
    """A binding. The evidence log is named by its `flight` (`boot` of its genesis), the leaf of its first line, the
    number of its records and the root of their tree; the autopilot's log by its SHA-256 and size. `file` is a name.

    `source` is the message of its track, `clock` the origin of the offset between the two clocks: a time since the
    evidence log's first record is `offset_us` and the time since the autopilot's boot. `utc_apart_us` is how far the
    autopilot's UTC was ahead; None if unknown. Of the `points` of the telemetry's track, `compared` are in the time
    that the autopilot's log covers, and `agreed` agree; `horizontal` and `vertical` are the largest deviations in mm.
    `deviations` are the largest ones in order of time, `others` the number of the rest. `issued_at_us` is UTC.
    """

    vehicle: str
    flight: bytes
    genesis: bytes
    records: int
    root: bytes
    closed: bool
    file: str
    digest: bytes
    size: int
    kind: Literal["ulog", "dataflash"]
    condition: Literal["whole", "cut", "damaged"]
    source: str
    clock: Literal["telemetry", "gps"]
    offset_us: int
    error_us: int
    utc_apart_us: int | None
    points: int
    compared: int
    agreed: int
    horizontal: int
    vertical: int
    flown_us: int
    covered_us: int
    deviations: tuple[BoundDeviation, ...]
    others: int
    release: str
    issued_at_us: int


def sign_autopilot_binding(binding: AutopilotBinding, key: SigningKey) -> bytes:
    """The signed binding. Raises `WrongDuty` for a key of another duty."""
    payload = artefact.pack(names.AUTOPILOT_BINDING, binding)
    return cose.sign1(payload, key=key, duty=Duty.LOG, content_type=names.AUTOPILOT_BINDING.content_type)


def open_autopilot_binding(document: bytes, *, root: TrustRoot, vehicle: str) -> AutopilotBinding:
    """A binding of a log of this vehicle, signed by a log key of the root that was authorised at its time of issue.

    Raises `AutopilotBindingError`, `EnvelopeError`, `BundleError` and `ArtefactError`.
    """
    opened = open_envelope(document, root, Duty.LOG, names.AUTOPILOT_BINDING, MAX_AUTOPILOT_BINDING)
    binding = read_autopilot_binding(opened.payload)
    if binding.vehicle != vehicle:
        text = f"the binding is for `{binding.vehicle[:80]}`, the log is of `{vehicle}`"
        raise AutopilotBindingError("wrong-vehicle", text)
    refusal = key_refusal(opened.key, vehicle=vehicle, now_us=binding.issued_at_us)
    if refusal is not None:
        raise AutopilotBindingError(refusal, f"key {opened.key.kid.hex()} was not authorised for `{vehicle}`")
    return binding


def read_autopilot_binding(payload: bytes) -> AutopilotBinding:
    """The binding in an unverified payload. Raises `AutopilotBindingError`, `BundleError` and `ArtefactError`."""
    binding = parse(names.AUTOPILOT_BINDING, payload, AutopilotBinding)
    counts = (
        binding.records, binding.size, binding.error_us, binding.horizontal, binding.vertical, binding.others,
        binding.issued_at_us,
    )  # fmt: skip
    makes_sense = (
        len(binding.flight) == FLIGHT_BYTES
        and {len(binding.genesis), len(binding.root), len(binding.digest)} == {DIGEST_BYTES}
        and all(0 <= each <= MAX_VALUE for each in counts)
        and max(abs(binding.offset_us), abs(binding.utc_apart_us or 0)) <= MAX_VALUE
        and 0 <= binding.agreed <= binding.compared <= binding.points <= MAX_VALUE
        and 0 <= binding.covered_us <= binding.flown_us <= MAX_VALUE
        and 0 < len(binding.file) <= MAX_NAME
        and "/" not in binding.file
        and binding.file.isprintable()
        and len(binding.deviations) <= MAX_DEVIATIONS
        and all(0 <= each.from_us <= each.to_us <= MAX_VALUE for each in binding.deviations)
    )
    if not makes_sense:
        raise AutopilotBindingError("malformed", "the binding contradicts itself")
    return binding
