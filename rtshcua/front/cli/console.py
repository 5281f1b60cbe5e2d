"""The console of a flight started from a terminal: its output, and its passphrase prompts."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec

from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.app.exit_codes import code_of
from rtshcua.app.telling.record_prose import detail_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli import faults
from rtshcua.front.cli.faults import error_object, fail, tell
from rtshcua.front.cli.render.live.feed import Feed
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
        return detail_of(event, detail)

    def unlock(self, duty: Duty, path: Path | None) -> SigningKey:
        """Return a key from a file or the key store; prompts for the passphrase if the key has one."""
        return unlock(KeyStore(self.data), duty, path=path, passphrase_file=self.passphrase_file)


def say_refused(refusal: Refusal, *, as_json: bool) -> ExitCode:
    """Print a refusal and return its exit code; with `as_json` print it also as a JSON event."""
    slug, text, help, code = refusal
    code = code or code_of(slug)
    if not as_json:
        return fail(code, text, help, slug=slug)
    event: dict[str, object] = {"event": "refused", "slug": slug, "text": text, "help": help or None}
    out_json(json.dumps(event | error_object(code, text, help, slug=slug), ensure_ascii=False))
    return tell(code, text, help, slug=slug)
