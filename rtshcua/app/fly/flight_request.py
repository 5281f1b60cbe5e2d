"""What a flight is asked for, and what all its stages share."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from rtshcua.adapters.boundary.process import ListeningBoundary
from rtshcua.adapters.clock import LinkClock, PacedClock, SystemClock
from rtshcua.adapters.store.telemetry import TelemetryFile
from rtshcua.adapters.store.vehicle_records import SIMULATED_FOLDER
from rtshcua.adapters.utc import UtcWatch, vehicle_counts
from rtshcua.adapters.vehicle.address import Address
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.adapters.vehicle.transport import Transport
from rtshcua.app.fly.stop_wishes import Interrupts
from rtshcua.app.fly.view_ports import Console
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.enforcement.frames import Gate
from rtshcua.onboard.enforcement.load import EnforcementMode
from rtshcua.onboard.ports import Ending, Event

if TYPE_CHECKING:
    from rtshcua.app.fly.incidents import Incidents

#: up to this many times as fast as life, a real vehicle's time limits leave the machine enough
_UNHURRIED = 5
#: frames that are kept until there is a file for them
_MOST_FRAMES = 100_000


class SortieHooks(Protocol):
    """A flight of a qualification: a driver of its own, and what is done before the link is closed."""

    def driver(self, policy: Policy, frames: Gate, slack: int, **more: Any) -> Driver:
        """The driver that flies it."""
        ...

    def before(self, vehicle: ConnectedVehicle, clock: LinkClock) -> list[Event] | Refusal:
        """The vehicle is connected, and nothing sent; what happened meanwhile, or why it is not to be flown."""
        ...

    def after(
        self, vehicle: ConnectedVehicle, clock: LinkClock, interrupts: Interrupts, ending: Ending, final_hash: str
    ) -> None:
        """The flight ended so, and its log ends in the line of this hash."""
        ...


@dataclass(frozen=True, slots=True)
class FlightRequest:
    """What is to fly, on which vehicle, by which keys. `link` None: the simulated vehicle is started with the options
    in `simulator`.

    `roots`: the trust root, and before it those that lead to it from the one that the vehicle accepted last; none for
    the key store's. `fence` False: the vehicle's own fence is left as it is. `system`: its MAVLink id, if it was named.
    `utc_error_us`: what the operator says that UTC is off by at most. `sortie`: it is one of a qualification.
    `settings`: parameters that are set before the flight, by name, and put back after it. `wait_s`: the bundle says the
    policy alone, and for so many seconds at most it waits for the one that flies. `boundary_user`: the user and group
    that a boundary of its own process runs as; `unbuilt`, that there is none only because its program is missing.
    `boundary_socket`: where a boundary listens that has the keys, of the log, of its own and of the link.
    """

    bundle: Path
    link: Address | None
    mode: EnforcementMode
    data: Path
    state: Path
    runs: Path
    simulator: Sequence[str] = ()
    speed: float = 1
    vehicle: str | None = None
    roots: Sequence[Path] = ()
    log_key: Path | None = None
    fence: bool = True
    signing_key: Path | None = None
    unsigned_radio: bool = False
    agent_socket: Path | None = None
    operator_socket: Path | None = None
    agent_group: int | None = None
    dry_run: bool = False
    system: int | None = None
    witnesses: tuple[Address, ...] = ()
    incidents: "Incidents | None" = None
    utc_error_us: int | None = None
    sortie: SortieHooks | None = None
    settings: Mapping[str, int] = field(default_factory=dict)
    wait_s: float | None = None
    boundary_user: tuple[int, int] | None = None
    unbuilt: bool = False
    boundary_key: Path | None = None
    boundary_socket: Path | None = None

    @property
    def kept_in(self) -> Path:
        """Where it is kept what flew, and what the flight before left, of this vehicle or of the simulated one that is
        started: neither uses up a bundle of the other.
        """
        return self.state / SIMULATED_FOLDER if self.link is None else self.state


class FrameBuffer:
    """Takes the raw frames of a link, from the first that was heard, and hands them to a file once it is attached."""

    def __init__(self) -> None:
        self._early: list[tuple[int, bytes]] = []
        self._file: TelemetryFile | None = None

    def keep(self, utc_us: int, frame: bytes) -> None:
        """One good frame, and when it came or went, UTC in us."""
        if self._file is not None:
            self._file.write(utc_us, frame)
        elif len(self._early) < _MOST_FRAMES:
            self._early.append((utc_us, frame))

    def attach(self, file: TelemetryFile) -> None:
        """Write what was kept, and everything from now on."""
        self._file = file
        for utc_us, frame in self._early:
            file.write(utc_us, frame)
        self._early.clear()


class FlightContext(NamedTuple):
    """What the stages of one flight share. `listening`: the boundary that listens once it is connected, or why it is
    not; None where none was asked for. `transport`: the link, where it is open already. `resources` closes what the
    stages opened.
    """

    request: FlightRequest
    console: Console
    clock: LinkClock
    utc: UtcWatch
    listening: ListeningBoundary | Refusal | None
    transport: Transport | None
    interrupts: Interrupts
    frames: FrameBuffer
    resources: ExitStack

    @property
    def slack(self) -> int:
        """How many times longer than life the time limits of the vehicle's are, in the flight's time."""
        return max(1, round(self.request.speed / _UNHURRIED))


def open_context(
    request: FlightRequest, console: Console,
    listening: ListeningBoundary | Refusal | None = None, transport: Transport | None = None,
    clock: LinkClock | None = None,
) -> FlightContext:  # fmt: skip
    """The context of a flight that begins; nothing of it is opened yet."""
    clock = clock or (SystemClock() if request.speed == 1 else PacedClock(request.speed))
    return FlightContext(
        request, console, clock, _utc(request, clock), listening, transport, Interrupts(), FrameBuffer(), ExitStack()
    )


def _utc(request: FlightRequest, clock: LinkClock) -> UtcWatch:
    """Who vouches for UTC; a simulation has that of the machine that it runs on. A rehearsal, which is decided here,
    takes what the boundary of a flight would take.
    """
    if request.link is not None and request.speed == 1:
        apart = request.dry_run and request.mode.apart
        counts = vehicle_counts(apart=apart, keyed=request.signing_key is not None)
        return UtcWatch(clock, request.utc_error_us, vehicle=counts)
    return UtcWatch.simulated(clock)
