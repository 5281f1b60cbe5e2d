"""`rtshcua witness`: cosign the checkpoints of logs, away from the vehicle that writes them."""

import json
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.folders import data_folder, state_folder
from rtshcua.adapters.store.keystore import KeyStore, read_root
from rtshcua.adapters.store.witness import Cosigned, FileWitness, NotCosigned, WitnessError, WitnessStore, drop, logs_in
from rtshcua.adapters.vehicle import address
from rtshcua.adapters.vehicle.address import AddressError, LinkCarrier
from rtshcua.adapters.witness_link import WitnessLink
from rtshcua.app.exit_codes import exit_code_of, untrusted
from rtshcua.app.wording import many
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.witnessing.witness import CosignRequest, Declined, WitnessResponse
from rtshcua.front.cli.faults import as_json as saying_json
from rtshcua.front.cli.faults import distrust, fail, misaddressed, refuse
from rtshcua.front.cli.interrupts import Stopped, StopRequest
from rtshcua.front.cli.stdout import out, out_json
from rtshcua.front.cli.unlock import unlock
from rtshcua.wire import cose
from rtshcua.wire.keys import Duty
from rtshcua.wire.trust import MAX_ROOT, TrustRoot, key_refusal, open_root
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)

#: how long it waits at most before it looks whether it is to stop
_SERVE_S = 0.5

Say = Callable[[dict[str, object], str], None]


@app.command()
def witness(
    paths: Annotated[list[Path] | None, typer.Argument(metavar="[LOG|FOLDER]...", help="logs, or folders with logs")]
    = None,
    connect: Annotated[
        str | None, typer.Option(metavar="udpin:HOST:PORT", help="answer `rtshcua run --witness` at this address")
    ] = None,
    watch: Annotated[
        float | None, typer.Option(metavar="SECONDS", min=0.1, help="look at the paths again, every so often")
    ] = None,
    key: Annotated[Path | None, typer.Option(help="the witness key (the key store's)")] = None,
    passphrase_file: Annotated[Path | None, typer.Option(help="a file with that key's passphrase")] = None,
    root: Annotated[Path | None, typer.Option(help="the signed trust root (the key store's)")] = None,
    state_dir: Annotated[Path | None, typer.Option(help="where it is kept what was cosigned (the data folder)")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object for each thing that happens")] = False,
) -> ExitCode:  # fmt: skip
    """Cosign the checkpoints of logs. It never cosigns two that contradict each other, and says so when it is asked to.

    Logs that are handed over as files get their anchors in a file beside them. With --connect or --watch it goes on
    until Ctrl-C or SIGTERM, which end it with 0.
    """
    if not paths and connect is None:
        return fail(ExitCode.USAGE, "nothing to witness", "give logs, folders, or `--connect udpin:HOST:PORT`")
    if watch is not None and not paths:
        return fail(ExitCode.USAGE, "`--watch` goes with a folder")
    try:
        link = None if connect is None else address.parse(connect, (LinkCarrier.UDP_IN,))
    except AddressError as error:
        return misaddressed("--connect", error)
    for path in paths or ():
        path.stat()  # so that what is missing is told as such
    store = KeyStore(data_folder())
    with ExitStack() as stack:
        stack.enter_context(saying_json(wanted=as_json))
        try:
            signed = store.root() if root is None else read_root(root)
            trust = open_root(signed, pinned=cose.unverified(signed, limit=MAX_ROOT).kid, now_us=_now_us())
            own = unlock(store, Duty.WITNESS, path=key, passphrase_file=passphrase_file)
            if own.kid not in trust.keys_for(Duty.WITNESS):
                text = f"the trust root names no witness key {own.kid.hex()}: nobody would believe it"
                return fail(ExitCode.UNTRUSTED, text, "`--key` gives one that it names", slug="unknown-key")
            memory = WitnessStore(state_dir or state_folder(), own)
            stack.callback(memory.close)
            made = FileWitness(memory, own, lambda vehicle: _log_keys(trust, vehicle), lambda: _now_us() // 1_000_000)
            stop = StopRequest()
            if link is not None or watch is not None:  # else a signal ends it at once: what it has written is whole
                stack.enter_context(stop)
            desk = _Desk(made, paths or [], watch, _saying(as_json=as_json), stop)
            return desk.work() if link is None else desk.serve((link.host, link.port), stack)
        except WitnessError as error:
            if error.slug != "in-use":
                return distrust(error)
            return fail(
                ExitCode.REFUSED, str(error), "end that one, or give another witness key with `--key`", slug="in-use"
            )
        except Untrusted as error:
            return refuse(untrusted(error))
        except Stopped:
            return ExitCode.OK


class _Desk:
    """What a witness is asked, and what it tells. `code` is the gravest that happened."""

    def __init__(
        self, witness: FileWitness, paths: list[Path], watch: float | None, say: Say, stop: StopRequest
    ) -> None:
        self._witness = witness
        self._paths = paths
        self._watch = watch
        self._say = say
        self._stop = stop
        self._looked: dict[Path, tuple[int, int]] = {}
        self._unread: dict[Path, str] = {}
        self._due_s = 0.0

    def work(self) -> ExitCode:
        """Look at the paths, once or again and again."""
        code = self._look()
        if self._watch is None:
            return max([code, *(self._none_in(path) for path in self._paths)])
        while True:
            self._rest(self._watch)
            self._look()

    def _rest(self, seconds: float) -> None:
        """Wait, in short parts, for a signal cuts none short."""
        while seconds > 0:
            time.sleep(min(seconds, _SERVE_S))
            self._stop.look()
            seconds -= _SERVE_S

    def _none_in(self, path: Path) -> ExitCode:
        """Whether there was anything to look at."""
        return ExitCode.OK if logs_in(path) else fail(ExitCode.INPUT, f"there are no logs in `{path}` or below it")

    def serve(self, at: tuple[str, int], stack: ExitStack) -> ExitCode:
        """Answer at an address, and look at the paths meanwhile."""
        try:
            link = WitnessLink(at, self._consider)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            return fail(ExitCode.LINK, f"cannot listen at udp {at[0]}:{at[1]}: {reason}", slug="port")
        stack.callback(link.close)
        self._say({"event": "ready", "port": link.port, "key": self._witness.public.hex()}, f"listening at {link.port}")
        self._look()
        while True:
            link.serve(min(_SERVE_S, self._watch or _SERVE_S))
            self._stop.look()
            if self._watch is not None and time.monotonic() >= self._due_s:
                self._look()

    def _look(self) -> ExitCode:
        """Look at each log that has changed since it was looked at last."""
        code = ExitCode.OK
        self._due_s = time.monotonic() + (self._watch or 0)
        for path in self._paths:
            for log in logs_in(path):
                self._stop.look()
                try:
                    found = self._looked_at(log, path)
                except FileNotFoundError:
                    continue  # taken away again since the folder was listed
                except OSError as error:  # one log that cannot be read, or its anchors written, keeps no other waiting
                    code = max(code, self._not_read(log, error))
                    continue
                self._unread.pop(log, None)
                code = code if found is None else max(code, self._told(found))
        return code

    def _not_read(self, log: Path, error: OSError) -> ExitCode:
        """Told once; it is tried again whenever the paths are looked at."""
        reason = (error.strerror or str(error)).lower()
        if self._unread.get(log) != reason:
            self._unread[log] = reason
            said: dict[str, object] = {"event": "unread", "log": str(log), "slug": "file", "text": reason}
            self._say(said, f"{log}: not looked at: {reason}")
        return exit_code_of(error)

    def _looked_at(self, log: Path, given: Path) -> Cosigned | NotCosigned | None:
        """What became of a log; None where it is as it was. Raises OSError."""
        state = log.stat()
        if self._looked.get(log) == (state.st_size, state.st_mtime_ns):
            return None
        found = drop(log, self._witness, None if log == given else given)
        self._looked[log] = (state.st_size, state.st_mtime_ns)
        return found

    def _told(self, found: Cosigned | NotCosigned) -> ExitCode:
        if isinstance(found, Cosigned):
            said: dict[str, object] = {"records": found.records, "anchored": found.anchored, "fresh": found.fresh}
            before = "" if found.fresh else " as before"
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
        if found.contradiction or found.size == 0:  # else it asks where we stand, as whoever was away does
            slug = f"witness/{found.status}"
            self._refused("origin", visible(origin[:200]), slug, visible(found.text[:200]), found.contradiction, proof)
        return found

    def _refused(self, what: str, name: str, slug: str, text: str, contradiction: bool, proof: Path | None) -> None:
        kept = "" if proof is None else f"; the note that shows it: {proof}"
        said: dict[str, object] = {"event": "refused", what: name, "slug": slug, "text": text}
        said |= {"contradiction": contradiction, "proof": None if proof is None else str(proof)}
        self._say(said, f"{name}: not cosigned: {text}{kept}")


def _log_keys(trust: TrustRoot, vehicle: str) -> list[bytes]:
    now_us = _now_us()
    keys = trust.keys_for(Duty.LOG).values()
    return [key.public for key in keys if key_refusal(key, vehicle=vehicle, now_us=now_us) is None]


def _saying(*, as_json: bool) -> Say:
    def say(said: dict[str, object], words: str) -> None:
        if as_json:
            out_json(json.dumps(said, ensure_ascii=False), flush=True)
        else:
            out(words, flush=True)

    return say


def _now_us() -> int:
    return time.time_ns() // 1000
