"""`python -m rtshcua.front.cli.render.live STYLE`: draw the messages from standard input until it ends."""

import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator

import msgspec

from rtshcua.app.fly.story import Happened, Message
from rtshcua.front.cli.render.live.lines import as_json, plain
from rtshcua.front.cli.width import fitted

EXIT_OK, EXIT_GONE = 0, 1


def messages() -> Iterator[Message]:
    """Yield the messages of the flying process."""
    decode = msgspec.json.Decoder(Message).decode
    for line in sys.stdin.buffer:
        yield decode(line)


def main() -> int:
    """Draw until the input ends; return 1 if standard output is closed."""
    if sys.stdout is None:
        return EXIT_GONE
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the view ends with the flight
    try:
        if sys.argv[1] == "screen":
            from rtshcua.front.cli.render.live.screen import draw

            draw(messages())
        else:
            structured = sys.argv[1] == "json"
            _print(as_json if structured else plain, bell=not structured and sys.stdout.isatty())
        sys.stdout.flush()
    except OSError:  # closed pipe or full disk
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # otherwise the exit would fail on it again
        return EXIT_GONE
    return EXIT_OK


def _print(style: Callable[[Message], Iterable[str]], *, bell: bool) -> None:
    rung: set[int] = set()
    for message in messages():
        if bell and isinstance(message, Happened) and message.what.asks is not None and message.what.step not in rung:
            rung.add(message.what.step)
            print(end="\a")
        for line in style(message):
            for each in [line] if style is as_json else fitted(line):
                print(each, flush=True)


if __name__ == "__main__":
    sys.exit(main())
