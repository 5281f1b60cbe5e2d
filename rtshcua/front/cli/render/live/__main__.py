"""`python -m rtshcua.front.cli.render.live STYLE`: draws what it is told on its standard input, until that ends."""

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
    """What the flying process tells, one by one."""
    decode = msgspec.json.Decoder(Message).decode
    for line in sys.stdin.buffer:
        yield decode(line)


def main() -> int:
    """Draw until the input ends; 1 when nobody reads any more, or nobody ever did."""
    if sys.stdout is None:
        return EXIT_GONE
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it ends with the flight, not before
    try:
        if sys.argv[1] == "screen":
            from rtshcua.front.cli.render.live.screen import draw

            draw(messages())
        else:
            structured = sys.argv[1] == "json"
            _print(as_json if structured else plain, bell=not structured and sys.stdout.isatty())
        sys.stdout.flush()
    except OSError:  # the reader left, or the disk that the output goes to is full
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or exiting would fail on it again
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
