"""How `rtshcua` is started: from the first moment Ctrl-C ends the process by the signal itself, in silence.

Python makes an exception of it, wherever it comes: amid imports, or in code of C that does not expect one. A process
that dies of SIGINT loses nothing that one loses which is killed, and a shell counts it as 130. A command that has
something to put in order looks at a flag that the signal sets (`front/cli/interrupts.py`, `app/fly/stop_wishes.py`), or
asks for the exception (`stop_wishes.breakable`). Nothing may be imported here that takes time.
"""

import signal


def main() -> int:
    """Runs the command of the process's own command line, and gives its exit code back, for `sys.exit`."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else whoever started us has it ignored
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from rtshcua.front.cli.app import main as run

    return run()
