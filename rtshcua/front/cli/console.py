"""The console of a flight started from a terminal: its output, and its passphrase prompts."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec

from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.front.cli import faults
from rtshcua.front.cli.render.live.feed import Feed
from rtshcua.front.cli.render.showing import log
from rtshcua.front.cli.stdout import out_json
from rtshcua.front.cli.unlock import unlock
from rtshcua.wire.keys import Duty, SigningKey


@dataclass(frozen=True)
class TerminalConsole:
    """A terminal or a pipe with one output style. `data`: the folder of the key store."""

    style: Literal["screen", "lines", "json"]
    data: Path
    passphrase_file: Path | None

    @property
    def as_json(self) -> bool:
        """Whether the output is JSON for a program."""
        return self.style == "json"

    @property
    def live(self) -> bool:
        """Whether the view is redrawn continuously."""
        return self.style == "screen"

    def say(self, text: str) -> None:
        """Print a line on standard error."""
        faults.say(text)

    def emit(self, event: Mapping[str, object]) -> None:
        """Print a line of JSON on standard output."""
        out_json(msgspec.json.encode(event).decode(), flush=True)

    def view(self) -> Feed:
        """Start the view in its own process."""
        return Feed(self.style)

    def detail_of(self, event: str, detail: str) -> str:
        """Return the text that `show` and `why` print for this event."""
        return log.detail_of(event, detail)

    def unlock(self, duty: Duty, path: Path | None) -> SigningKey:
        """Return a key from a file or the key store; prompts for the passphrase if the key has one."""
        return unlock(KeyStore(self.data), duty, path=path, passphrase_file=self.passphrase_file)
