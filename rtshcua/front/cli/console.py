"""What a flight tells whoever started it in a terminal, and what it asks there."""

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
    """A terminal or a pipe, in one style. `data`: where the key store is."""

    style: Literal["screen", "lines", "json"]
    data: Path
    passphrase_file: Path | None

    @property
    def as_json(self) -> bool:
        """A program reads what is told."""
        return self.style == "json"

    @property
    def live(self) -> bool:
        """The view is drawn anew all the time."""
        return self.style == "screen"

    def say(self, text: str) -> None:
        """A line on the standard error."""
        faults.say(text)

    def emit(self, event: Mapping[str, object]) -> None:
        """A line of JSON on the standard output."""
        out_json(msgspec.json.encode(event).decode(), flush=True)

    def view(self) -> Feed:
        """The view, in a process of its own."""
        return Feed(self.style)

    def detail_of(self, event: str, detail: str) -> str:
        """As `show` and `why` word it."""
        return log.detail_of(event, detail)

    def unlock(self, duty: Duty, path: Path | None) -> SigningKey:
        """From a file or the key store; the passphrase is asked for where one is needed."""
        return unlock(KeyStore(self.data), duty, path=path, passphrase_file=self.passphrase_file)
