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
    """The hooks of a qualification's sortie: its driver, and actions before and after the flight."""

    def driver(self, policy: Policy, frames: Gate, slack: int, **more: Any) -> Driver:
        """The driver that flies it."""
        ...

    def before(self, vehicle: ConnectedVehicle, clock: LinkClock) -> list[Event] | Refusal:
        """Called when the vehicle is connected and nothing was sent. Return the events meanwhile, or a refusal."""
        ...

    def after(
        self, vehicle: ConnectedVehicle, clock: LinkClock, interrupts: Interrupts, ending: Ending, final_hash: str
    ) -> None:
        """Called after the flight with its ending and the hash of its log's last line."""
        ...


@dataclass(frozen=True, slots=True)
class FlightRequest:
    """A request for a flight: bundle, vehicle and keys. Without a `link`, the simulated vehicle is started with the
    options in `simulator`.

    `roots`: the trust root, after its predecessors since the last accepted one; empty for the key store's. `fence`
    False: do not change the vehicle's fence. `system`: the vehicle's MAVLink id. `utc_error_us`: the greatest error of
    UTC by the operator's statement. `sortie`: the hooks of a qualification. `settings`: parameters that are set before
    the flight and restored after it. `wait_s`: wait so long at most for the bundle that flies; `bundle` only gives the
    policy. `idle_us`: the mission is live, and waits so long in the air for its next step. `boundary_user`: the user
    and group of the boundary process. `unbuilt`: there is no boundary process only because its program is missing.
    `boundary_socket`: the socket of a listening boundary, which has the keys of the log, the link and itself.
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
    idle_us: int | None = None
    boundary_user: tuple[int, int] | None = None
    unbuilt: bool = False
    boundary_key: Path | None = None
    boundary_socket: Path | None = None

    @property
    def kept_in(self) -> Path:
        """The state folder of this vehicle. The simulated vehicle has a folder of its own, so that its flights do not
        use up bundles of the real one.
        """
        return self.state / SIMULATED_FOLDER if self.link is None else self.state


class FrameBuffer:
    """Keeps the raw frames of a link, from the first one, until a file is attached."""

    def __init__(self) -> None:
        self._early: list[tuple[int, bytes]] = []
        self._file: TelemetryFile | None = None

    def keep(self, utc_us: int, frame: bytes) -> None:
        """Keep a valid frame with the UTC time of its reception or sending, in us."""
        if self._file is not None:
            self._file.write(utc_us, frame)
        elif len(self._early) < _MOST_FRAMES:
            self._early.append((utc_us, frame))

    def attach(self, file: TelemetryFile) -> None:
        """Write the kept frames to `file`, and all frames from now on."""
        self._file = file
        for utc_us, frame in self._early:
            file.write(utc_us, frame)
        self._early.clear()


class FlightContext(NamedTuple):
    """What the stages of one flight share. `listening`: the connected listening boundary, or why it cannot be reached;
    None if none was requested. `transport`: a link that is already open. `resources` closes what the stages opened.
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
        """The factor for the vehicle's time limits in the flight's time, at a high `--speed`."""
        return max(1, round(self.request.speed / _UNHURRIED))


def open_context(
    request: FlightRequest, console: Console,
    listening: ListeningBoundary | Refusal | None = None, transport: Transport | None = None,
    clock: LinkClock | None = None,
) -> FlightContext:  # fmt: skip
    """The context of a new flight, with nothing opened yet."""
    clock = clock or (SystemClock() if request.speed == 1 else PacedClock(request.speed))
    return FlightContext(
        request, console, clock, _utc(request, clock), listening, transport, Interrupts(), FrameBuffer(), ExitStack()
    )


def _utc(request: FlightRequest, clock: LinkClock) -> UtcWatch:
    """The source of UTC. A simulation uses the machine's time. A rehearsal is decided in this process, but uses the
    sources that the boundary of a flight would use.
    """
    if request.link is not None and request.speed == 1:
        apart = request.dry_run and request.mode.apart
        counts = vehicle_counts(apart=apart, keyed=request.signing_key is not None)
        return UtcWatch(clock, request.utc_error_us, vehicle=counts)
    return UtcWatch.simulated(clock)
