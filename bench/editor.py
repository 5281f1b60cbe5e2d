"""The language server over its standard streams: from a keystroke to its diagnostics, in a file of 2,000 lines.

A test client sends `textDocument/didChange` and waits for the `textDocument/publishDiagnostics` of that version, often
enough for a 95th percentile of each kind of edit; the file has zones, skills, policies and missions. Printed are
milliseconds, and multiples of a plain Lark parse of the text in this run; also the time from the last keystroke to the
whole check with proofs and lint. On a busy machine the server's processor time is more meaningful (Linux). Exits with 1
when the 95th percentile of an edit is above its limit, unless the machine was slow: then the median must be below the
limit in terms of Lark parses.
"""

import json
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from os import sysconf
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter, sleep
from typing import Any

from rtshcua.ground.language.generate import GRAMMAR, lark

CHECKOUT = Path(__file__).resolve().parents[1]
LINES = 2_000
LIMIT_MS = 100
RATIO = 0.6  # multiples of a plain Lark parse of the text in this run, which takes about 170 ms
ROUNDS = 40
PAUSE = 0.12  # seconds between keystrokes, as a person types

IMPORTED = "policies/site skills/takeoff skills/hover skills/goto skills/return_home skills/emergency_land"
HEAD = "".join(f'import "lib:{file}.rts"\n' for file in IMPORTED.split())
ZONE = """
// Pad {n}, of which the policies keep clear.
zone pad_{n} = circle({lat} N, 8.5456 E, 15 m)
  floor 0 m  ceiling 60 m above home
  entry {lat} N, 8.5456 E
"""
SIGNAL = "signal load.s{n} : ratio = SYS_STATUS.battery_remaining  unknown at -1  stale after 5 s\n"
POLICY = """
policy p_{n} version 1 {{
  permit  takeoff, goto, goto_{n} by role operator through agent, operator  when battery > 20 % and load.s7 < 90 %
  permit  hover, return_home, emergency_land by any
  forbid  goto by any when target inside grow(pad_{n}, 20 m)
  airspace inside city outside school
  contingency hover for 10 s, return_home, emergency_land
}}

mission m_{n} under p_{n}@1 on quad {{
  proposed by agent openclaw for role operator
  phase departure  {{ takeoff(altitude = 20 m) }}
  phase inspection {{ goto(pad_{n}.entry, altitude = 20 m) }}
  phase recovery   {{ return_home() }}
}}
"""


def source(lines: int) -> str:
    """Return a text of about that many lines, with zones, signals, skills, policies and missions."""
    skill = (CHECKOUT / "skills" / "goto.rts").read_text(encoding="utf-8").partition("skill goto")[2]
    text, n = HEAD, 0
    while text.count("\n") < lines:
        n += 1
        text += SIGNAL.format(n=n) + ZONE.format(n=n, lat=f"47.{39774 + n % 80:05}")
        if n % 3 == 0:
            text += f"\nskill goto_{n}{skill}"
        if n % 12 == 0:
            text += POLICY.format(n=n)
    return text


class Client:
    """A client of a server that it starts."""

    def __init__(self, folder: str) -> None:
        command = [sys.executable, "-P", "-m", "rtshcua", "lsp"]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=folder)
        self._told: queue.SimpleQueue[tuple[float, dict[str, Any]]] = queue.SimpleQueue()
        self._number = 0
        threading.Thread(target=self._read, daemon=True).start()

    def send(self, method: str, params: Any, *, number: int | None = None) -> None:
        """Send a message; with a number it is a request."""
        message = {"jsonrpc": "2.0", "method": method, "params": params} | ({} if number is None else {"id": number})
        body = json.dumps(message).encode()
        assert self._process.stdin is not None
        self._process.stdin.write(b"Content-Length: %d\r\n\r\n%b" % (len(body), body))
        self._process.stdin.flush()

    def ask(self, method: str, params: Any) -> Any:
        """Send a request and return its answer."""
        self._number += 1
        self.send(method, params, number=self._number)
        return self._until(lambda message: message.get("id") == self._number)[1]

    def told(self, version: int) -> tuple[float, int]:
        """Return when the diagnostics of a version came, and their number."""
        at, message = self._until(lambda message: message.get("params", {}).get("version") == version)
        return at, len(message["params"]["diagnostics"])

    def processor_ms(self) -> float:
        """Return the server's processor time, without the proving process."""
        stat = Path(f"/proc/{self._process.pid}/stat")
        if not stat.exists():
            return 0.0
        fields = stat.read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) * 1000 / sysconf("SC_CLK_TCK")

    def end(self) -> None:
        """End the server."""
        self.ask("shutdown", None)
        self.send("exit", None)
        self._process.wait()

    def _until(self, fits: Callable[[dict[str, Any]], bool]) -> tuple[float, dict[str, Any]]:
        while True:
            at, message = self._told.get(timeout=120)
            if fits(message):
                return at, message

    def _read(self) -> None:
        stream = self._process.stdout
        assert stream is not None
        length = 0
        while line := stream.readline():
            if line.strip():
                name, _, value = line.partition(b":")
                length = int(value) if name.lower() == b"content-length" else length
            else:
                self._told.put((perf_counter(), json.loads(stream.read(length))))


def typed(text: str, old: str, new: str) -> Iterator[str]:
    """Yield the text with `old` and with `new` in turns, as keystrokes back and forth would."""
    while True:
        yield text.replace(old, new, 1)
        yield text


def ranged(old: str, new: str) -> dict[str, Any]:
    """Return the change that an editor would send: the differing lines."""
    before, after = old.split("\n"), new.split("\n")
    first = next(n for n in range(len(before)) if before[n : n + 1] != after[n : n + 1])
    last = next(n for n in range(len(before)) if before[-1 - n : len(before) - n] != after[-1 - n : len(after) - n])
    last = min(last, len(before) - first - 1, len(after) - first - 1)
    end = len(before) - last - 1
    put = "\n".join(after[first : len(after) - last])
    return {
        "range": {"start": {"line": first, "character": 0}, "end": {"line": end, "character": len(before[end])}},
        "text": put,
    }


#: the typed text, and the text that it replaces
KINDS = {
    "type in a comment": ("// Pad 60, of which", "// Pad 60, of all which"),
    "change a number": ("47.39785 N, 8.5456 E, 15 m", "47.39785 N, 8.5456 E, 16 m"),
    "put a blank in": ("signal load.s50 : ratio = SYS_STATUS", "signal load.s50  : ratio = SYS_STATUS"),
    "break the syntax": ("policy p_36 version 1 {", "policy p_36 version 1 "),
    "open a comment": ("zone pad_20 =", "/* zone pad_20 ="),
    "rename a signal used everywhere": ("signal load.s7 :", "signal loads.s7 :"),
    "the first line": (HEAD[:7], "imports"),
}  # fmt: skip


def main() -> int:
    """Measure and print; return 1 if the limit is exceeded."""
    text = source(LINES)
    bare = lark(GRAMMAR.read_text(encoding="utf-8"))
    kept = True
    with TemporaryDirectory() as folder:
        client = Client(folder)
        client.ask("initialize", {"processId": None, "rootUri": None, "capabilities": {}})
        client.send("initialized", {})
        uri, version = f"file://{folder}/large.rts", 1
        document = {"uri": uri, "languageId": "rtshcua", "version": version, "text": text}
        start = perf_counter()
        client.send("textDocument/didOpen", {"textDocument": document})
        at, found = client.told(1)
        print(f"editor: {text.count(chr(10))} lines open in {(at - start) * 1000:.0f} ms, {found} findings at once")
        for kind, (old, new) in KINDS.items():
            assert old in text, kind
            start = perf_counter()
            bare.parse(text)
            parse_ms = (perf_counter() - start) * 1000
            last, times, used = text, [], client.processor_ms()
            for now in typed(text, old, new):
                version += 1
                change = ranged(last, now)
                start = perf_counter()
                where = {"uri": uri, "version": version}
                client.send("textDocument/didChange", {"textDocument": where, "contentChanges": [change]})
                at, found = client.told(version)
                times.append((at - start) * 1000)
                last = now
                sleep(PAUSE)
                if len(times) >= ROUNDS and now == text:
                    break
            p50, p95 = median(times), sorted(times)[int(len(times) * 0.95)]
            spent = (client.processor_ms() - used) / len(times)
            kept &= p95 <= LIMIT_MS or p50 <= RATIO * parse_ms
            print(f"editor: {kind}: P50 {p50:.0f} ms, P95 {p95:.0f} ms, limit {LIMIT_MS}; {spent:.0f} ms of processor "
                  f"({p50 / parse_ms:.2f} of a bare Lark parse of the text, {parse_ms:.0f} ms)")  # fmt: skip
        version += 1
        wrong = text.replace("takeoff(altitude = 20 m)", "takeoff(altitude = 20 m) takeoff(altitude = 30 m)", 1)
        client.send("textDocument/didChange", {"textDocument": {"uri": uri, "version": version},
                                               "contentChanges": [ranged(text, wrong)]})  # fmt: skip
        start, found = perf_counter(), 0
        while not found:
            at, found = client.told(version)
        print(f"editor: proofs and lint of the whole file: {(at - start) * 1000:.0f} ms after the last keystroke")
        client.end()
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
