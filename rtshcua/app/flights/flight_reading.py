"""Read a flight from its log and the telemetry beside it, as one value."""

from base64 import b64decode
from contextlib import suppress
from pathlib import Path

import msgspec

from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.runs import TELEMETRY
from rtshcua.app.documents import Claimed, claimed, replaced
from rtshcua.app.flights.flight_telemetry import THINNED_US, read_telemetry
from rtshcua.app.logs import CUT_AT_FIRST
from rtshcua.app.sidecar_files import run_folder
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import AnyRecord, Effect, Genesis
from rtshcua.ground.flight.flown import Flight
from rtshcua.model.flat.mission import Mission
from rtshcua.wire.untrusted import Untrusted

#: of each kind of message, at most this many are read for a page
_MOST_OF_A_KIND = 4_000


class FlightRecords:
    """Collects the records of a log."""

    def __init__(self) -> None:
        self.genesis: Genesis | None = None
        self._bundle: Claimed | Untrusted | None = None
        self._mission: Mission | None = None
        self._records: list[AnyRecord] = []

    def take(self, record: AnyRecord) -> None:
        """Take the next valid record."""
        if isinstance(record, Genesis):
            self.genesis = record
            try:
                self._bundle = claimed(b64decode(record.bundle))
                self._mission = self._bundle.mission
            except ValueError as error:  # `Untrusted` too
                self._bundle = error if isinstance(error, Untrusted) else Untrusted("malformed", "it is not base64")
            record = msgspec.structs.replace(record, bundle="", root="")
        elif isinstance(record, Effect) and record.event == "replacement" and self._mission is not None:
            with suppress(Untrusted):  # which verification names
                self._mission = replaced(record.detail, self._mission)
        self._records.append(record)

    def flight(self, log: Path, *, thinned: bool) -> Flight | Refusal:
        """The flight, with its telemetry, of which a part is read if `thinned`. Raises OSError."""
        genesis, bundle, mission = self.genesis, self._bundle, self._mission
        if genesis is None:
            return Refusal("genesis/missing", f"`{log}`: {CUT_AT_FIRST}", "", ExitCode.EVIDENCE)
        if not isinstance(bundle, Claimed) or mission is None:
            return Refusal(
                "genesis/bundle",
                f"`{log}`: the bundle in its first record cannot be read: {bundle}",
                "",
                ExitCode.EVIDENCE,
            )
        folder = run_folder(log)
        telemetry = None
        if folder is not None and (folder / TELEMETRY).is_file():
            lasted_us = self._records[-1].at_us - genesis.at_us
            every_us = max(THINNED_US, lasted_us // _MOST_OF_A_KIND) if thinned else 0
            telemetry = read_telemetry(folder / TELEMETRY, bundle.policy, genesis.utc_us, every_us)
        return Flight(genesis, bundle.policy, mission, tuple(self._records), telemetry)


def read_flight(log: Path, *, thinned: bool = False) -> Flight | Refusal:
    """A flight from its log, which is not verified, up to the first line that is not a record. Raises OSError."""
    records = FlightRecords()
    with open_regular(log) as file:
        for line in lines(file):
            record = read(line)
            if isinstance(record, Flaw):
                break
            records.take(record)
    return records.flight(log, thinned=thinned)
