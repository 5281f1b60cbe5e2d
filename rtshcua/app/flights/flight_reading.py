"""Read a flight from its log and the telemetry beside it, as one value."""

from base64 import b64decode
from contextlib import suppress
from pathlib import Path

import msgspec

from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.runs import TELEMETRY
from rtshcua.adapters.vehicle.telemetry import Telemetry, UnknownSource
from rtshcua.app.documents import Claimed, PreparedBundle, claimed_and_prepared, replaced
from rtshcua.app.flights.flight_telemetry import read_telemetry
from rtshcua.app.logs import CUT_AT_FIRST
from rtshcua.app.sidecar_files import run_folder
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import AnyRecord, Effect, Genesis
from rtshcua.ground.flight.flown import Flight, FlightTelemetry
from rtshcua.ground.flight.log_times import LogTimes
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.wire.untrusted import Untrusted


class FlightRecords:
    """Collects the records of a log."""

    def __init__(self) -> None:
        self.genesis: Genesis | None = None
        #: the bundle in the first record, or why it cannot be read
        self.bundle: Claimed | Untrusted | None = None
        #: the same as it is prepared on board; None if it cannot be read
        self.prepared: PreparedBundle | None = None
        self._mission: Mission | None = None
        self._steps: list[Invocation] = []  # all that were ever in force
        self._records: list[AnyRecord] = []
        self.times = LogTimes()

    def take(self, record: AnyRecord) -> int:
        """Take the next valid record; return its time since the first one."""
        if isinstance(record, Genesis):
            self.genesis = record
            try:
                self.prepared = _readable(claimed_and_prepared(b64decode(record.bundle)))
                self.bundle = self.prepared.said
                self._mission = self.bundle.mission
                self._steps += self._mission.invocations
            except ValueError as error:  # `Untrusted` too
                self.bundle = error if isinstance(error, Untrusted) else Untrusted("malformed", "it is not base64")
            record = msgspec.structs.replace(record, bundle="", root="")
        elif isinstance(record, Effect) and record.event == "replacement" and self._mission is not None:
            with suppress(Untrusted):  # which verification names
                before = self._mission.invocations
                self._mission = replaced(record.detail, self._mission)
                self._steps += [each for each in self._mission.invocations if each not in before]
        self._records.append(record)
        return self.times.take(record)

    def policy(self) -> Policy | None:
        """The policy of the bundle; None before the first record, or if it cannot be read."""
        return self.bundle.policy if isinstance(self.bundle, Claimed) else None

    def flight(self, log: Path, telemetry: FlightTelemetry | None) -> Flight | Refusal:
        """The flight with its telemetry."""
        genesis, bundle, mission = self.genesis, self.bundle, self._mission
        if genesis is None:
            return Refusal("genesis/missing", f"`{log}`: {CUT_AT_FIRST}", "", ExitCode.EVIDENCE)
        if not isinstance(bundle, Claimed) or mission is None:
            text = f"`{log}`: the bundle in its first record cannot be read: {bundle}"
            return Refusal("genesis/bundle", text, "", ExitCode.EVIDENCE)
        records, times = tuple(self._records), self.times
        return Flight(
            genesis, bundle.policy, mission, records, telemetry, times.segments, times.lasted_us, tuple(self._steps)
        )


def _readable(bundle: PreparedBundle) -> PreparedBundle:
    """A bundle whose signals this program can read. Raises `Untrusted`."""
    try:
        Telemetry(bundle.said.policy)
    except UnknownSource as error:
        raise Untrusted("malformed", str(error)) from None
    return bundle


def telemetry_of(log: Path) -> Path | None:
    """The telemetry beside a log; None if there is none."""
    folder = run_folder(log)
    return folder / TELEMETRY if folder is not None and (folder / TELEMETRY).is_file() else None


def read_flight(log: Path) -> Flight | Refusal:
    """A flight from its log, which is not verified, up to the first line that is not a record, with all of its
    telemetry. Raises OSError.
    """
    records = FlightRecords()
    with open_regular(log) as file:
        for line in lines(file):
            record = read(line)
            if isinstance(record, Flaw):
                break
            records.take(record)
    path, policy = telemetry_of(log), records.policy()
    telemetry = None
    if path is not None and policy is not None and records.genesis is not None:
        telemetry = read_telemetry(path, policy, records.genesis.utc_us, records.times.lasted_us)
    return records.flight(log, telemetry)
