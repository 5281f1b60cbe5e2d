"""`run --mode process` and `--boundary-socket`: the boundary is a process of its own, and takes the bundle over."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from msgspec.structs import replace

from rtshcua.adapters.boundary_process import BoundaryError, BoundaryProcess, ListeningBoundary
from rtshcua.app.fly.refused import Refused
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.executor import Commands
from rtshcua.onboard.enforcement.isolated import Caller, IsolatedExecutor, IsolatedGate, OwnTime
from rtshcua.onboard.enforcement.load import SESSION_KEY_BYTES, EnforcementMode, Loaded, load
from rtshcua.onboard.enforcement.preparation import SETTABLE, Owed
from rtshcua.wire import cose
from rtshcua.wire.document import FLIGHT_BYTES
from rtshcua.wire.keys import SigningKey
from rtshcua.wire.preparation import ParameterWrite, Preparation, encode
from rtshcua.wire.trust import MAX_ROOT, TrustRoot

#: why nothing begins where another run has the boundary of the vehicle
IN_USE: Final = "boundary-in-use"

#: how a run ends, by why its boundary does not begin or take the bundle; REFUSED where none is named
CODES: Final = {
    "in-use": ExitCode.REFUSED,
    "damaged": ExitCode.INPUT,
    "not-kept": ExitCode.FULL,
    "untrusted": ExitCode.UNTRUSTED,
}


def _refused(error: BoundaryError) -> Refused:
    return Refused(CODES.get(error.slug, ExitCode.REFUSED), f"boundary-{error.slug}", str(error), error.help)


def started(
    vehicle: str, signed_root: bytes, state: Path, *,
    link_key: Path | None, own_key: SigningKey | None, log_key: SigningKey,
    user: tuple[int, int] | None, paced: bool, settings: Mapping[str, int], owed: Mapping[str, Owed],
    utc_error_us: int | None = None,
) -> BoundaryProcess:  # fmt: skip
    """A boundary that is started for one run, until `close`. Raises `Refused`, and OSError."""
    pinned = cose.unverified(signed_root, limit=MAX_ROOT).kid
    try:
        return BoundaryProcess(
            signed_root, pinned, vehicle, state, link_key=link_key, user=user, paced=paced,
            own_seed=None if own_key is None else own_key.private.private_bytes_raw(),
            log_seed=log_key.private.private_bytes_raw(),
            settings=_listed({name: Owed(0, value) for name, value in settings.items()}), owed=_listed(owed),
            utc_error_us=utc_error_us,
        )  # fmt: skip
    except BoundaryError as error:
        raise _refused(error) from None


def connected(path: Path, *, paced: bool) -> ListeningBoundary:
    """A boundary that listens, until `close`. `paced`: the run's time is not the machine's. Raises `Refused`."""
    try:
        found = ListeningBoundary(path)
    except BoundaryError as error:
        raise _refused(error) from None
    if paced and found.own_clock:
        found.close()
        text = f"the boundary at `{path}` decides by its own clock, and `--speed` is another"
        raise Refused(ExitCode.REFUSED, "boundary-not-begun", text, "without `--speed`")
    return found


class Apart:
    """The boundary of one run that runs apart: what this end has of it, under one trust root."""

    def __init__(
        self, process: BoundaryProcess | ListeningBoundary, vehicle: str, root: TrustRoot, settings: Mapping[str, int]
    ) -> None:
        self.process = process
        self._vehicle, self._root, self._settings = vehicle, root, settings
        self._caller = Caller(process.call, signs=process.link_name is not None)

    @property
    def root(self) -> TrustRoot:
        """What it trusts."""
        return self._root

    def flight(self) -> bytes:
        """The id of the flight that begins next."""
        answer = self._caller.flight()
        self.expect()
        assert isinstance(answer, bytes)
        return answer

    def time(self, settle: bool) -> OwnTime | None:
        """What its own clock says; None of one that is gone. `settle`: no more is waited for."""
        answer = self._caller.time(settle=settle)
        return None if isinstance(answer, Refusal) else answer

    def sign_log(self, checkpoint: bytes) -> bytes | Refusal:
        """The signature of the log's key under the checkpoint that begins the log of the flight, once."""
        return self._caller.sign_log(checkpoint)

    def waiting(self, base: Loaded) -> Loaded:
        """What is waited with, in this process: what leaves meanwhile, leaves by the boundary."""
        commands = Commands(base.bundle.policy, base.bundle.mission)
        executor = IsolatedExecutor(self._caller, commands, IsolatedGate(self._caller, commands))
        return replace(base, executor=executor, mode=EnforcementMode.PROCESS)

    def load(self, bundle: bytes, now: Now) -> Loaded | Refusal:
        """Have it open a bundle, in place of the one before."""
        loaded = load(
            bundle, root=self._root, vehicle=self._vehicle, now=now, mode=EnforcementMode.PROCESS,
            session_key=bytes(SESSION_KEY_BYTES), flight=bytes(FLIGHT_BYTES), peer_is_own_simulator=False,
            settings=self._settings, caller=self._caller,
        )  # fmt: skip
        if isinstance(loaded, Refusal):
            text = f"the boundary's process refuses the bundle: {loaded.text} ({loaded.slug})"
            return Refusal(f"boundary-{loaded.slug}", text, loaded.help)
        return loaded

    def admit(self, bundle: bytes, now: Now) -> Loaded | Refusal:
        """Have it open a bundle that nothing flies of yet, in place of the one before."""
        loaded = self.load(bundle, now)
        if not isinstance(loaded, Refusal) and self._caller.reopened:
            text = f"the boundary's process opened this bundle before on `{self._vehicle}`: a bundle flies once"
            return Refusal("boundary-replayed", text, "compile the mission again, which issues it anew")
        return loaded

    def expect(self) -> None:
        """Raises `Refused` once it is gone: nothing more leaves then."""
        if self._caller.lost:
            raise Refused(ExitCode.REFUSED, "boundary-lost", "the boundary's process is gone: nothing more is sent")


def _listed(parameters: Mapping[str, Owed]) -> bytes | None:
    """Parameters as a boundary is given them when it begins; None where there are none that may be set."""
    writes = tuple(ParameterWrite(name, *each) for name, each in parameters.items() if name in SETTABLE)
    return encode(Preparation(0, False, 0, writes)) if writes else None
