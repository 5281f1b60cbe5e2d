"""A virtual flight with the tests' keys; the independent verifier must agree about its log."""

from typing import Any

from reference.verifiers import agree
from rtshcua.ground.audit.audit import Audit
from rtshcua.onboard.ports import BoundaryKey
from rtshcua.simulation.config import SimulationConfig
from rtshcua.virtual.flight import FlownFlight, VirtualFlight
from rtshcua.wire.keys import Duty
from virtual import case

#: longer than the default, and so cheaper
TICK_US = 50_000
UTC_US = case.flat.ISSUED + 60 * case.S


class Flown(FlownFlight):
    """The result of a flight."""

    def audit(self) -> Audit:
        found = super().audit()
        agree(b"".join(self.lines), found)
        return found


class Flight(VirtualFlight):
    """One flight under the development root of `case`; `attested`: with a boundary that signs its own evidence."""

    flown = Flown

    def __init__(
        self, bundle: bytes, config: SimulationConfig, *, utc_us: int = UTC_US, tick_us: int = TICK_US,
        attested: bool = True, **more: Any,
    ) -> None:  # fmt: skip
        _, root = case.root(boundary=attested)
        if attested:
            more.setdefault("boundary", BoundaryKey(case.BOUNDARY_KEY, 1, bytes(32)))
        super().__init__(
            bundle, config, root=root, log_key=case.KEYS[Duty.LOG], utc_us=utc_us, tick_us=tick_us, **more,
        )  # fmt: skip
