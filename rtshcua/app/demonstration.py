"""The service `demo`: four refusals and one flight, by commands that a reader may repeat, in a folder of its own."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any, Final, NamedTuple

from rtshcua.adapters.store.reading import read_regular
from rtshcua.adapters.store.writing import make_folder, replace
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.library import root

PARTS: Final = 9
DATA: Final = "keys-and-state"
PAGE: Final = "flight.html"
_MOST: Final = 1 << 20
#: how often as fast as life the simulated vehicle flies
SPEED: Final = 20
_POLICY: Final = ("--policy", "bridge_inspection")
_RTSHCUA: Final = (sys.executable, "-m", "rtshcua")


class PartBegun(NamedTuple):
    """A part that begins: its number, what it is in words, and the command that does it."""

    number: int
    title: str
    words: tuple[str, ...]


class PartSays(NamedTuple):
    """What came of a part, in a line or more."""

    text: str


class DemoBroken(Exception):
    """A command ended otherwise than it should: its exit code, and what it printed."""

    def __init__(self, code: int, said: str) -> None:
        super().__init__(said)
        self.code = code


def demonstrate(folder: Path) -> Iterator[PartBegun | PartSays]:
    """Do each part in `folder`, and tell it. Raises `DemoBroken` and OSError."""
    make_folder(folder)
    commands = _Commands(folder)
    proposal: dict[str, Any] = json.loads(read_regular(root() / "missions/proposal.json", _MOST))
    title = "Make a root of trust, and a key for each duty; an agent's key signs for agents only"
    words: tuple[str, ...] = ("keys", "init", "--if-missing")
    yield PartBegun(1, title, words)
    commands.run(words)
    yield PartSays(f"they are in {DATA}: for testing, and not encrypted")

    high = _changed(proposal, 0, 0, "altitude", "4000 m")
    yield from _refused(
        commands, 2, "An agent proposes to climb to 4,000 m: refused, with what would pass", "high", high
    )
    city = _changed(proposal, 1, 1, "area", "city")
    yield from _refused(commands, 3, "It proposes to look at the city, which no rule permits: refused", "city", city)

    commands.write("bridge.json", proposal)
    words = ("compile", "bridge.json", *_POLICY, "-o", "bridge.bundle")
    yield PartBegun(4, "It proposes what its policy permits: checked, bound and signed", words)
    for line in commands.run(words).splitlines():
        yield PartSays(line)

    commands.alter("bridge.bundle", "altered.bundle")
    yield PartBegun(
        5, "Somebody changes one bit of it on the way: refused", words := ("run", "altered.bundle", "--json")
    )
    yield PartSays(commands.refused(words, ExitCode.UNTRUSTED))

    words = ("run", "bridge.bundle", "--speed", str(SPEED), "--json")
    yield PartBegun(6, f"The simulated vehicle flies it, {SPEED} times as fast as life", words)
    log = ""
    for event in commands.events(words):
        yield from _told(event)
        log = str(event.get("folder", log))

    yield PartBegun(
        7, "The same decision comes again, and is stale: refused", words := ("run", "bridge.bundle", "--json")
    )
    yield PartSays(commands.refused(words, ExitCode.REFUSED))

    words = ("verify-log", "--audit", log)
    yield PartBegun(8, "Verify the log, and decide everything again from it", words)
    verdict = commands.run(words).partition("\n\n")[2].partition("\n\n")[0]
    for line in verdict.splitlines():
        yield PartSays(line.strip())

    words = ("report", log, "-o", PAGE)
    yield PartBegun(9, "Draw the flight as a page that works without a network", words)
    commands.run(words)
    yield PartSays(f"open {folder / PAGE} in a browser")


class _Commands:
    """Runs our own commands in a folder, with keys and state of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._environment = os.environ | {"RTSHCUA_DATA_DIR": str((folder / DATA).resolve())}

    def write(self, name: str, mission: Mapping[str, Any]) -> None:
        replace(self._folder / name, json.dumps(mission, indent=2).encode() + b"\n")

    def alter(self, name: str, altered: str) -> None:
        """Write a copy with one bit changed, in what the mission says."""
        octets = bytearray(read_regular(self._folder / name, _MOST))
        octets[len(octets) * 3 // 4] ^= 1
        replace(self._folder / altered, bytes(octets))

    def run(self, words: Sequence[str], expected: int = 0) -> str:
        """Return what a command prints."""
        done = subprocess.run(
            [*_RTSHCUA, *words], cwd=self._folder, env=self._environment, stdin=subprocess.DEVNULL,
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode != expected:
            raise DemoBroken(done.returncode, done.stdout + done.stderr)
        return done.stdout

    def refused(self, words: Sequence[str], expected: int) -> str:
        """Return why a command refuses."""
        return str(json.loads(self.run(words, expected).splitlines()[-1])["text"])

    def events(self, words: Sequence[str]) -> Iterator[Mapping[str, Any]]:
        """Return the events of a flight as they come."""
        with subprocess.Popen(
            [*_RTSHCUA, *words], cwd=self._folder, env=self._environment, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, text=True,
        ) as flight:  # fmt: skip
            assert flight.stdout is not None
            for line in flight.stdout:
                yield json.loads(line)
        if flight.returncode != 0:
            raise DemoBroken(flight.returncode, "the flight did not end as it should")


def _changed(proposal: dict[str, Any], phase: int, step: int, name: str, value: str) -> dict[str, Any]:
    """Return a proposal with another value of an argument."""
    changed = deepcopy(proposal)
    changed["phases"][phase]["steps"][step]["arguments"][name] = value
    return changed


def _refused(
    commands: _Commands, number: int, title: str, name: str, mission: dict[str, Any]
) -> Iterator[PartBegun | PartSays]:
    """Have the compiler refuse a mission."""
    commands.write(f"{name}.json", mission)
    words = ("compile", f"{name}.json", *_POLICY)
    yield PartBegun(number, title, words)
    (first, *_) = json.loads(commands.run((*words, "--json"), ExitCode.DIAGNOSTICS))["diagnostics"]
    yield PartSays(f"{first['code']}: {first['message']}; {first['help']}")


def _told(event: Mapping[str, Any]) -> Iterator[PartSays]:
    """Tell an event of a flight, if it is more than a matter of course."""
    at = f"{event.get('t_us', 0) / 1e6:5.1f} s  "
    if event["event"] == "succeeded":
        yield PartSays(f"{at}step {event['step_number']} done: {event['subject']}")
    if event["event"] == "summary":
        done = f"{event['steps_done']} of {event['steps']} steps done in {event['flight_us'] // 1_000_000} s"
        yield PartSays(f"{event['ending']}: {done}, {event['records']} records")
