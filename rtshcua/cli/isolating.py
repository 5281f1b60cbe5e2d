"""`run --mode process`: the boundary begins as a process of its own, and takes the bundle over."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.boundary_process import BoundaryError, BoundaryProcess
from rtshcua.cli.refused import Refused
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.isolated import Caller
from rtshcua.onboard.enforcement.load import SESSION_KEY_BYTES, Loaded, Mode, load
from rtshcua.onboard.enforcement.preparation import SETTABLE, Owed
from rtshcua.wire import cose
from rtshcua.wire.document import FLIGHT_BYTES
from rtshcua.wire.keys import SigningKey
from rtshcua.wire.preparation import ParameterWrite, Preparation, encode
from rtshcua.wire.trust import MAX_ROOT, TrustRoot

_CODES = {"in-use": ExitCode.REFUSED, "damaged": ExitCode.INPUT, "untrusted": ExitCode.UNTRUSTED}


class Isolated(NamedTuple):
    """A bundle in force in a boundary that runs apart, and that process."""

    loaded: Loaded
    process: BoundaryProcess


def isolate(
    bundle: bytes, vehicle: str, root: TrustRoot, signed_root: bytes, state: Path, now: Now, *,
    link_key: Path | None, own_key: SigningKey | None, user: tuple[int, int] | None, paced: bool,
    settings: Mapping[str, int], owed: Mapping[str, Owed],
) -> Isolated:  # fmt: skip
    """Begin a boundary for a vehicle, and have it open the bundle. Raises `Refused`, and OSError."""
    pinned = cose.unverified(signed_root, limit=MAX_ROOT).kid
    try:
        seed = None if own_key is None else own_key.private.private_bytes_raw()
        process = BoundaryProcess(
            signed_root, pinned, vehicle, state, link_key=link_key, own_seed=seed, user=user, paced=paced,
            settings=_listed({name: Owed(0, value) for name, value in settings.items()}), owed=_listed(owed),
        )  # fmt: skip
    except BoundaryError as error:
        code = _CODES.get(error.slug, ExitCode.REFUSED)
        raise Refused(code, f"boundary-{error.slug}", str(error), error.help) from None
    loaded = load(
        bundle, root=root, vehicle=vehicle, now=now, mode=Mode.PROCESS, session_key=bytes(SESSION_KEY_BYTES),
        flight=bytes(FLIGHT_BYTES), peer_is_own_simulator=False, settings=settings,
        caller=Caller(process.call, signs=link_key is not None),
    )  # fmt: skip
    if isinstance(loaded, Refusal):
        process.close()
        text = f"the boundary's process refuses the bundle: {loaded.text} ({loaded.slug})"
        raise Refused(ExitCode.REFUSED, f"boundary-{loaded.slug}", text, loaded.help)
    return Isolated(loaded, process)


def _listed(parameters: Mapping[str, Owed]) -> bytes | None:
    """Parameters as a boundary is given them when it begins; None where there are none that may be set."""
    writes = tuple(ParameterWrite(name, *each) for name, each in parameters.items() if name in SETTABLE)
    return encode(Preparation(0, False, 0, writes)) if writes else None
