"""Qualification records: the results of flying an autopilot to test the assumptions of its adapter.

A record is about one vehicle in one state: its autopilot, the version, and the relevant parameters. The log key
signs it, as it signs the other observations of this vehicle's runtime (docs/adr/0043). It permits nothing.
"""

from collections.abc import Mapping
from enum import IntEnum
from typing import Final

from rtshcua.model.flat.struct import Flat
from rtshcua.wire import artefact, cbor, cose, digest, names
from rtshcua.wire.bundle import open_envelope, parse
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import TrustRoot, key_refusal
from rtshcua.wire.untrusted import Untrusted

#: a larger record is refused unread, in bytes
MAX_QUALIFICATION: Final = 1 << 18


class QualificationError(Untrusted):
    """A qualification record that is refused: `too-large`, `malformed`, `wrong-vehicle`, `key-expired`."""


class CheckOutcome(IntEnum):
    """The outcome of one check."""

    HELD = 0
    FAILED = 1  # the assumption of the adapter is wrong
    TOLD = 2  # not as expected, but the adapter does not rely on it
    UNCHECKED = 3  # not flown, or not observed


class QualificationCheck(Flat, frozen=True):
    """One check: a stable slug, its `CheckOutcome`, the expected and the measured value as text, and both as numbers
    of a `unit` (`us`, `mm`, `mm/s`) if there are any. `advice` says what to do about it.
    """

    slug: str
    outcome: int
    expected: str
    measured: str
    limit: int | None = None
    found: int | None = None
    unit: str = ""
    advice: str = ""


class Firmware(Flat, frozen=True):
    """The identification that an autopilot reports: its flavour, `flight_sw_version` and `flight_custom_version`."""

    flavour: str
    version: int
    build: bytes

    @property
    def text(self) -> str:
        """For a person: `px4 1.16.0 (build 0a1b2c3d)`."""
        number = ".".join(map(str, self.version.to_bytes(4)[:3]))
        build = self.build.rstrip(b"\0").hex()
        return f"{self.flavour} {number}" + (f" (build {build})" if build else "")


class Qualification(Flat, frozen=True):
    """A record. `parameters` are the relevant ones, by name in ascending order, each as the eight octets of its value
    as a double (big-endian); `digest` is over them. `policy` is the digest of the policy that bounded the flights.

    `pilot` is the person who consented, empty for a simulation. `logs` are the final hashes of the flights' logs.
    `flown_us` is the time in the air; `issued_at_us` is UTC.
    """

    vehicle: str
    firmware: Firmware
    parameters: tuple[tuple[str, bytes], ...]
    digest: bytes
    policy: bytes
    pilot: str
    release: str
    issued_at_us: int
    flown_us: int
    logs: tuple[str, ...]
    checks: tuple[QualificationCheck, ...]

    @property
    def failed(self) -> tuple[QualificationCheck, ...]:
        """The checks that failed."""
        return tuple(each for each in self.checks if each.outcome == CheckOutcome.FAILED)

    @property
    def qualifies(self) -> bool:
        """Whether at least one check was made and all made checks passed."""
        return not self.failed and any(each.outcome == CheckOutcome.HELD for each in self.checks)

    def changes(self, firmware: Firmware | None, parameters: Mapping[str, bytes]) -> tuple[str, ...]:
        """The differences from the present vehicle, as text; unknown parameters do not count."""
        changes = []
        if firmware is not None and firmware != self.firmware:
            changes.append(f"its firmware is {firmware.text}, and was {self.firmware.text}")
        before = dict(self.parameters)
        others = sorted(name for name, value in parameters.items() if before.get(name) != value)
        if others:
            changes.append(f"parameters {', '.join(f'`{name}`' for name in others)}")
        return tuple(changes)


#: the calendar ends here
_YEAR_10000_US: Final = 253_402_300_800_000_000


def parameters_digest(parameters: tuple[tuple[str, bytes], ...]) -> bytes:
    """The name of a set of parameters and their values."""
    return digest.digest(digest.PARAMETERS, cbor.encode(parameters))


def sign_qualification(record: Qualification, key: SigningKey) -> bytes:
    """The signed record. Raises `WrongDuty` for a key of another duty."""
    payload = artefact.pack(names.QUALIFICATION, record)
    return cose.sign1(payload, key=key, duty=Duty.LOG, content_type=names.QUALIFICATION.content_type)


def open_qualification(document: bytes, *, root: TrustRoot, vehicle: str, now_us: int) -> Qualification:
    """A record of this vehicle, signed by a log key of the root that was authorised then and is authorised now.

    `now_us` is UTC. An expired key could have signed any time of issue, so nothing that it signed is accepted.

    Raises `QualificationError`, `EnvelopeError`, `BundleError` and `ArtefactError`.
    """
    if len(document) > MAX_QUALIFICATION:
        raise QualificationError("too-large", f"the record is {len(document)} bytes; the limit is {MAX_QUALIFICATION}")
    opened = open_envelope(document, root, Duty.LOG, names.QUALIFICATION, MAX_QUALIFICATION)
    record = read_qualification(opened.payload)
    if record.vehicle != vehicle:
        raise QualificationError(
            "wrong-vehicle", f"the record is for `{record.vehicle[:80]}`; this vehicle is `{vehicle}`"
        )
    for when, at_us in (("was not authorised", record.issued_at_us), ("is no longer authorised", now_us)):
        refusal = key_refusal(opened.key, vehicle=vehicle, now_us=at_us)
        if refusal is not None:
            raise QualificationError(refusal, f"key {opened.key.kid.hex()} {when} for `{vehicle}`")
    return record


def read_qualification(payload: bytes) -> Qualification:
    """The record in an unverified payload. Raises `QualificationError`, `BundleError` and `ArtefactError`."""
    record = parse(names.QUALIFICATION, payload, Qualification)
    outcomes = {int(each) for each in CheckOutcome}
    makes_sense = (
        record.digest == parameters_digest(record.parameters)
        and 0 <= record.firmware.version < 1 << 32
        and 0 <= record.issued_at_us < _YEAR_10000_US
        and all(each.outcome in outcomes for each in record.checks)
    )
    if not makes_sense:
        raise QualificationError("malformed", "the record contradicts itself")
    return record
