"""A log of an hour: some 10,000 records and 5 MB, signed by the keys of the tests."""

from base64 import b64decode
from functools import cache

from reference.forgery import LOG_KEY, flight, read
from reference.seeds import epoch_seeds
from rtshcua.evidence.log_writer import Recorder
from rtshcua.model.flat.situation import Now
from rtshcua.wire.keys import Duty

RECORDS, HOUR_US = 10_000, 3_600_000_000


@cache
def long_log() -> bytes:
    """The octets of the log, sealed each 10 s."""
    first = read(flight()[0])
    recorder = Recorder(lambda text: LOG_KEY.sign(text, duty=Duty.LOG), LOG_KEY.public, epoch_seeds())
    at_us = first["at_us"]

    def now() -> Now:
        return Now(at_us, first["utc_us"] + at_us - first["at_us"], first["utc_error_us"])

    lines = [
        recorder.genesis(
            now(), bundle=b64decode(first["bundle"]), root=b64decode(first["root"]), boot=bytes.fromhex(first["boot"]),
            vehicle=first["vehicle"], mission=first["mission"], mode=first["mode"],
        )
    ]  # fmt: skip
    while len(lines) < RECORDS - 1:
        at_us += HOUR_US // RECORDS
        if recorder.due(now()):
            lines.extend(recorder.sealing(now()))
        lines.append(recorder.effect(now(), "noted", detail="x" * 270, token=len(lines), durability=1))
    return b"".join([*lines, *recorder.closing(now(), ending="completed", tlog=None)])
