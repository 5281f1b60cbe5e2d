"""The entry point of `rtshcua`: from the start, Ctrl-C ends the process by the signal itself, without output.

Python would raise KeyboardInterrupt at any point, also during imports or in C code that does not expect it. Commands
are safe to kill, so the default action of SIGINT is enough, and a shell reports it as 130. A command that must clean up
checks a flag that the signal sets (`front/cli/interrupts.py`, `app/fly/stop_wishes.py`), or enables the exception
(`stop_wishes.breakable`). This module must import nothing slow.
"""

import signal


def main() -> int:
    """Run the command in `sys.argv` and return its exit code."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # otherwise the parent process ignores SIGINT
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from rtshcua.front.cli.app import main as run

    return run()
