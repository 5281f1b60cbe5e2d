"""The service `witness`: cosign the checkpoints of logs, from files or at an address."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Final, NamedTuple

from rtshcua.adapters.store.folders import data_folder, state_folder
from rtshcua.adapters.store.keystore import KeyStore, read_root
from rtshcua.adapters.store.witness import Cosigned, FileWitness, NotCosigned, WitnessError, WitnessStore, drop, logs_in
from rtshcua.adapters.vehicle.address import Address
from rtshcua.adapters.witness_link import WitnessLink
from rtshcua.app.exit_codes import exit_code_of, untrusted
from rtshcua.app.wording import many
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.witnessing.witness import CosignRequest, Declined, WitnessResponse
from rtshcua.wire import cose
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import MAX_ROOT, TrustRoot, key_refusal, open_root
from rtshcua.wire.untrusted import Untrusted

#: longest wait between checks of the stop request, s
_SERVE_S: Final = 0.5

#: receives each event, as JSON and as text
Say = Callable[[dict[str, object], str], None]


class WitnessRequest(NamedTuple):
    """What to cosign: logs in paths, checked again every `watch` seconds, or requests at an address; the trust root,
    and the folder of the witness's state.
    """

    paths: list[Path]
    link: Address | None
    watch: float | None
    root: Path | None
    state: Path | None

    @property
    def lasts(self) -> bool:
        """Whether the witness runs until it is stopped."""
        return self.link is not None or self.watch is not None


class WitnessResult(NamedTuple):
    """The most severe result, and the paths without logs."""

    code: ExitCode
    empty: list[Path]


def open_witness(
    request: WitnessRequest, unlock: Callable[[KeyStore], SigningKey], stack: ExitStack
) -> FileWitness | Refusal:
    """Return the witness with its state; the stack closes its store. Raises OSError."""
    for path in request.paths:
        path.stat()  # raise an error for a missing path
    store = KeyStore(data_folder())
    try:
        signed = store.root() if request.root is None else read_root(request.root)
        trust = open_root(signed, pinned=cose.unverified(signed, limit=MAX_ROOT).kid, now_us=_now_us())
        own = unlock(store)
        if own.kid not in trust.keys_for(Duty.WITNESS):
            text = f"witness key {own.kid.hex()} is not in the trust root, so its signatures would not be trusted"
            return Refusal("unknown-key", text, "choose a key of the trust root with `--key`", ExitCode.UNTRUSTED)
        memory = WitnessStore(request.state or state_folder(), own)
    except Untrusted as error:
        return _refused(error)
    stack.callback(memory.close)
    return FileWitness(memory, own, lambda vehicle: _log_keys(trust, vehicle), lambda: _now_us() // 1_000_000)


def attend(
    witness: FileWitness, request: WitnessRequest, say: Say, look_for_stop: Callable[[], None], stack: ExitStack
) -> WitnessResult | Refusal:
    """Cosign: once, or until `look_for_stop` raises. Raises OSError."""
    work = _Witnessing(witness, request, say, look_for_stop)
    try:
        return work.work() if request.link is None else work.serve((request.link.host, request.link.port), stack)
    except Untrusted as error:
        return _refused(error)


def _refused(error: Untrusted) -> Refusal:
    found = untrusted(error)
    if not isinstance(error, WitnessError) or error.slug != "in-use":
        return found
    return found._replace(
        help="stop the other process, or use a different witness key with `--key`", code=ExitCode.REFUSED
    )


class _Witnessing:
    """Cosigns logs in paths and requests from a socket, and reports each event."""

    def __init__(
        self, witness: FileWitness, request: WitnessRequest, say: Say, look_for_stop: Callable[[], None]
    ) -> None:
        self._witness = witness
        self._paths, self._watch = request.paths, request.watch
        self._say, self._look_for_stop = say, look_for_stop
        self._looked: dict[Path, tuple[int, int]] = {}
        self._unread: dict[Path, str] = {}
        self._due_s = 0.0

    def work(self) -> WitnessResult:
        """Check the paths, once or repeatedly."""
        code = self._look()
        if self._watch is None:
            return WitnessResult(code, [path for path in self._paths if not logs_in(path)])
        while True:
            self._rest(self._watch)
            self._look()

    def _rest(self, seconds: float) -> None:
        """Wait in short intervals, because a signal does not interrupt the sleep."""
        while seconds > 0:
            time.sleep(min(seconds, _SERVE_S))
            self._look_for_stop()
            seconds -= _SERVE_S

    def serve(self, at: tuple[str, int], stack: ExitStack) -> Refusal:
        """Answer requests at an address, and check the paths in between."""
        try:
            link = WitnessLink(at, self._consider)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            return Refusal("port", f"cannot listen at udp {at[0]}:{at[1]}: {reason}", "", ExitCode.LINK)
        stack.callback(link.close)
        self._say({"event": "ready", "port": link.port, "key": self._witness.public.hex()}, f"listening at {link.port}")
        self._look()
        while True:
            link.serve(min(_SERVE_S, self._watch or _SERVE_S))
            self._look_for_stop()
            if self._watch is not None and time.monotonic() >= self._due_s:
                self._look()

    def _look(self) -> ExitCode:
        """Check each log that has changed since the last check."""
        code = ExitCode.OK
        self._due_s = time.monotonic() + (self._watch or 0)
        for path in self._paths:
            for log in logs_in(path):
                self._look_for_stop()
                try:
                    found = self._looked_at(log, path)
                except FileNotFoundError:
                    continue  # removed since the folder was listed
                except OSError as error:  # continue with the other logs
                    code = max(code, self._not_read(log, error))
                    continue
                self._unread.pop(log, None)
                code = code if found is None else max(code, self._told(found))
        return code

    def _not_read(self, log: Path, error: OSError) -> ExitCode:
        """Report an unreadable log once; it is tried again at each check."""
        reason = (error.strerror or str(error)).lower()
        if self._unread.get(log) != reason:
            self._unread[log] = reason
            said: dict[str, object] = {"event": "unread", "log": str(log), "slug": "file", "text": reason}
            self._say(said, f"{log}: cannot be read: {reason}")
        return exit_code_of(error)

    def _looked_at(self, log: Path, given: Path) -> Cosigned | NotCosigned | None:
        """Cosign a log; None if it has not changed. Raises OSError."""
        state = log.stat()
        if self._looked.get(log) == (state.st_size, state.st_mtime_ns):
            return None
        found = drop(log, self._witness, None if log == given else given)
        self._looked[log] = (state.st_size, state.st_mtime_ns)
        return found

    def _told(self, found: Cosigned | NotCosigned) -> ExitCode:
        if isinstance(found, Cosigned):
            said: dict[str, object] = {"records": found.records, "anchored": found.anchored, "fresh": found.fresh}
            before = "" if found.fresh else " (unchanged)"
            words = f"cosigned {found.anchored} of {many(found.records, 'record')}{before}"
            self._say({"event": "cosigned", "log": str(found.log), **said}, f"{found.log}: {words}")
            return ExitCode.OK
        self._refused("log", str(found.log), found.slug, found.text, found.contradiction, found.proof)
        return ExitCode.ANCHOR if found.contradiction else ExitCode.EVIDENCE

    def _consider(self, request: CosignRequest) -> WitnessResponse | Declined:
        origin, size = request.note.split("\n", 2)[:2]
        found = self._witness.consider(request)
        if isinstance(found, WitnessResponse):
            said: dict[str, object] = {"event": "cosigned", "origin": origin, "size": int(size)}
            self._say(said, f"{origin}: cosigned {many(int(size) + 1, 'record')}")
            return found
        proof = self._witness.store.contradicted(request.note) if found.contradiction else None
        if found.contradiction or found.size == 0:  # otherwise a normal request for our position after a break
            slug = f"witness/{found.status}"
            self._refused("origin", visible(origin[:200]), slug, visible(found.text[:200]), found.contradiction, proof)
        return found

    def _refused(self, what: str, name: str, slug: str, text: str, contradiction: bool, proof: Path | None) -> None:
        kept = "" if proof is None else f"; proof: {proof}"
        said: dict[str, object] = {"event": "refused", what: name, "slug": slug, "text": text}
        said |= {"contradiction": contradiction, "proof": None if proof is None else str(proof)}
        self._say(said, f"{name}: not cosigned: {text}{kept}")


def _log_keys(trust: TrustRoot, vehicle: str) -> list[bytes]:
    now_us = _now_us()
    keys = trust.keys_for(Duty.LOG).values()
    return [key.public for key in keys if key_refusal(key, vehicle=vehicle, now_us=now_us) is None]


def _now_us() -> int:
    return time.time_ns() // 1000
