"""Qualification records: what was found when an autopilot was flown against what its adapter takes for granted.

A record is about one vehicle as it then was: its autopilot, the version, and the parameters that matter. The log key
signs it, as it signs what else this vehicle's runtime saw (docs/adr/0043). It permits nothing.
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

#: a record larger than this is refused unread, in bytes
MAX_QUALIFICATION: Final = 1 << 18


class QualificationError(Untrusted):
    """A qualification record that is refused: `too-large`, `malformed`, `wrong-vehicle`, `key-expired`."""


class CheckOutcome(IntEnum):
    """What became of one check."""

    HELD = 0
    FAILED = 1  # what the adapter takes for granted is not so
    TOLD = 2  # nothing rests on it, and somebody should know
    UNCHECKED = 3  # it was not flown, or not seen


class QualificationCheck(Flat, frozen=True):
    """One check: a stable slug, its `CheckOutcome`, what was expected and what was measured in words, and both as
    numbers of a `unit` (`us`, `mm`, `mm/s`) where there are any. `advice` says what to do about it.
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
    """What an autopilot says that it is: its flavour, `flight_sw_version` and `flight_custom_version`."""

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
    """A record. `parameters` are those that matter, by name in ascending order, each the eight octets of its value as
    a double (big-endian); `digest` is over them. `policy` is the digest of the policy that bounded the flights.

    `pilot` is who consented, empty for a simulation. `logs` are the final hashes of the flights' logs. `flown_us` is
    how long it was in the air; `issued_at_us` is UTC.
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
        """What does not hold."""
        return tuple(each for each in self.checks if each.outcome == CheckOutcome.FAILED)

    @property
    def qualifies(self) -> bool:
        """Whether something was checked, and all that was holds."""
        return not self.failed and any(each.outcome == CheckOutcome.HELD for each in self.checks)

    def changes(self, firmware: Firmware | None, parameters: Mapping[str, bytes]) -> tuple[str, ...]:
        """What is otherwise now, in words; parameters that are not known now are not held against it."""
        changes = []
        if firmware is not None and firmware != self.firmware:
            changes.append(f"its firmware is {firmware.text}, and was {self.firmware.text}")
        before = dict(self.parameters)
        others = sorted(name for name, value in parameters.items() if before.get(name) != value)
        if others:
            changes.append(f"parameters {', '.join(f'`{name}`' for name in others)}")
        return tuple(changes)


#: no calendar has a name for a later time
_YEAR_10000_US: Final = 253_402_300_800_000_000


def parameters_digest(parameters: tuple[tuple[str, bytes], ...]) -> bytes:
    """The name of a set of parameters and their values."""
    return digest.digest(digest.PARAMETERS, cbor.encode(parameters))


def sign_qualification(record: Qualification, key: SigningKey) -> bytes:
    """The signed record. Raises `WrongDuty` for a key of another duty."""
    payload = artefact.pack(names.QUALIFICATION, record)
    return cose.sign1(payload, key=key, duty=Duty.LOG, content_type=names.QUALIFICATION.content_type)


def open_qualification(document: bytes, *, root: TrustRoot, vehicle: str, now_us: int) -> Qualification:
    """A record of this vehicle that a log key of the root signed, which could speak for it when it did and can now.

    `now_us` is UTC. Whoever has a key that expired may write any time of issue, so nothing that it signed counts now.

    Raises `QualificationError`, `EnvelopeError`, `BundleError` and `ArtefactError`.
    """
    if len(document) > MAX_QUALIFICATION:
        raise QualificationError("too-large", f"a record of {len(document)} bytes is not read")
    opened = open_envelope(document, root, Duty.LOG, names.QUALIFICATION, MAX_QUALIFICATION)
    record = read_qualification(opened.payload)
    if record.vehicle != vehicle:
        raise QualificationError("wrong-vehicle", f"it is about `{record.vehicle[:80]}`, this vehicle is `{vehicle}`")
    for when, at_us in (("could not speak", record.issued_at_us), ("may not speak any more", now_us)):
        refusal = key_refusal(opened.key, vehicle=vehicle, now_us=at_us)
        if refusal is not None:
            raise QualificationError(refusal, f"key {opened.key.kid.hex()} {when} for `{vehicle}`")
    return record


def read_qualification(payload: bytes) -> Qualification:
    """The record in a payload, whoever signed it. Raises `QualificationError`, `BundleError` and `ArtefactError`."""
    record = parse(names.QUALIFICATION, payload, Qualification)
    outcomes = {int(each) for each in CheckOutcome}
    makes_sense = (
        record.digest == parameters_digest(record.parameters)
        and 0 <= record.firmware.version < 1 << 32
        and 0 <= record.issued_at_us < _YEAR_10000_US
        and all(each.outcome in outcomes for each in record.checks)
    )
    if not makes_sense:
        raise QualificationError("malformed", "it contradicts itself")
    return record
