"""Options that make no sense together, of the commands that fly, as one table."""

from typing import Final, NamedTuple

import typer

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import fail
from rtshcua.front.cli.options.flight_options import OF_SIMULATOR
from rtshcua.onboard.enforcement.load import EnforcementMode


class Conflict(NamedTuple):
    """Options of a command of which one is given, together with one of `among`, or without all of `without`."""

    command: str
    given: tuple[str, ...]
    text: str
    help: str | None = None
    among: tuple[str, ...] = ()
    without: tuple[str, ...] = ()


_CONNECT: Final = ("--connect",)
_LISTENS: Final = ("--boundary-socket",)
_UNKEYED: Final = "`--unsigned-radio` goes with `--signing-key`: without a key nothing is signed"
_OWN: Final = "the boundary there has keys of its own, sets no parameters, and rehearses nothing"
#: what a boundary that listens is told in its own command line, or does not do
_NOT_THERE: Final = {
    "--signing-key": _OWN,
    "--boundary-user": _OWN,
    "--log-key": _OWN,
    "--set": _OWN,
    "--boundary-key": _OWN,
    "--passphrase-file": _OWN,
    "--dry-run": _OWN,
    "--utc-error": "the boundary there tells the time itself; it is told in its own command line, `--utc-error US`",
}


def _other_modes(command: str) -> list[Conflict]:
    return [
        Conflict(
            command, _LISTENS, f"`--boundary-socket` goes with `--mode process`, not with `{mode}`",
            among=(f"--mode {mode}",),
        )
        for mode in EnforcementMode if mode is not EnforcementMode.PROCESS
    ]  # fmt: skip


#: of each command, in the order in which they are looked for
CONFLICTS: Final = (
    Conflict(
        "run", OF_SIMULATOR, "options of the simulated vehicle do not go with `--connect`",
        "`rtshcua sim` takes them, where it is the vehicle that you connect to", among=_CONNECT,
    ),
    Conflict(
        "run", _CONNECT, "`--connect` needs `--vehicle`: which vehicle is it?",
        "its identity, as its policy says it: a bundle for another vehicle is refused then", without=("--vehicle",),
    ),
    Conflict(
        "run", ("--scenario",), "`--scenario` is for the simulated vehicle, and does not go with `--connect`",
        among=_CONNECT,
    ),
    Conflict(
        "run", ("--scenario",), "`--scenario` says how the vehicle starts and what goes wrong",
        "with it go `--flavour` and `--seed`; `--battery`, `--wind`, `--fault` and `--dry-run` do not",
        among=("--battery", "--wind", "--fault", "--dry-run"),
    ),
    Conflict("run", ("--wait-for",), "`--wait-for` goes with `--wait`", without=("--wait",)),
    Conflict(
        "run", ("--wait",), "`--wait` needs `--agent-socket`: where is the bundle handed in?",
        without=("--agent-socket",),
    ),
    Conflict(
        "run", ("--wait",), "`--wait` does not go with `--dry-run` and `--scenario`, which know the mission before",
        among=("--dry-run", "--scenario"),
    ),
    Conflict("run", _LISTENS, "`--boundary-socket` goes with `--connect`", without=_CONNECT),
    *_other_modes("run"),
    *(
        Conflict("run", (option,), f"`{option}` does not go with `--boundary-socket`: {why}", among=_LISTENS)
        for option, why in _NOT_THERE.items()
    ),
    Conflict(
        "run", ("--system",), "`--system` goes with `--connect`: the simulated vehicle is alone", without=_CONNECT
    ),
    Conflict(
        "run", ("--utc-error",), "`--utc-error` goes with `--connect`: a simulation has this machine's time",
        without=_CONNECT,
    ),
    Conflict(
        "run", ("--fresh-state",), "`--fresh-state` is for the simulated vehicle, and without `--state-dir`",
        among=("--state-dir", "--connect"),
    ),
    Conflict("run", ("--unsigned-radio",), _UNKEYED, without=("--signing-key", "--boundary-socket")),
    Conflict("doctor", ("--unsigned-radio",), _UNKEYED, without=("--signing-key",)),
    Conflict(
        "doctor", ("--utc-error",),
        "`--utc-error` does not go with `--boundary-socket`: the boundary there is told in its own command line",
        among=_LISTENS,
    ),
    *_other_modes("doctor"),
    Conflict(
        "qualify", ("--takeover",), "`--takeover` requires `--pilot`: in a simulation takeovers are always tried",
        among=("--sitl",),
    ),
    Conflict(
        "qualify", ("--unsigned-radio",), "`--unsigned-radio` requires `--signing-key`", without=("--signing-key",)
    ),
    *(
        Conflict(
            "mcp", (option,), "`--http` and `--token-file` go together", "or neither: the standard streams",
            without=(other,),
        )
        for option, other in (("--http", "--token-file"), ("--token-file", "--http"))
    ),
)  # fmt: skip


def conflict_of(context: typer.Context, *, only: tuple[str, ...] = ()) -> ExitCode | None:
    """Fails for the first conflict between the options of a command line, of those about one of `only`, if any is
    named; None where there is none.
    """
    given = {
        f"--mode {context.params['mode']}" if option == "--mode" else option
        for parameter in context.command.params
        if _is_given(context, parameter.name or "")
        for option in parameter.opts
    }
    for each in CONFLICTS:
        if each.command != context.command.name or (only and not {*only} & {*each.given}):
            continue
        clashes = given.intersection(each.among) or (each.without and given.isdisjoint(each.without))
        if clashes and not given.isdisjoint(each.given):
            return fail(ExitCode.USAGE, each.text, each.help)
    return None


def _is_given(context: typer.Context, name: str) -> bool:
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"
