"""One table of the conflicts between options of the commands that fly."""

from typing import Final, NamedTuple

import typer

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import fail
from rtshcua.front.cli.options.flight_options import OF_SIMULATOR
from rtshcua.onboard.enforcement.load import EnforcementMode


class Conflict(NamedTuple):
    """A conflict: one of the options `given` with one of `among`, or without any of `without`."""

    command: str
    given: tuple[str, ...]
    text: str
    help: str | None = None
    among: tuple[str, ...] = ()
    without: tuple[str, ...] = ()


_CONNECT: Final = ("--connect",)
_LISTENS: Final = ("--boundary-socket",)
_UNKEYED: Final = "`--unsigned-radio` requires `--signing-key`: without a key nothing is signed"
_OWN: Final = "the listening boundary has its own keys, sets no parameters, and supports no dry run"
#: options that a listening boundary takes on its own command line or does not support
_NOT_THERE: Final = {
    "--signing-key": _OWN,
    "--boundary-user": _OWN,
    "--log-key": _OWN,
    "--set": _OWN,
    "--boundary-key": _OWN,
    "--passphrase-file": _OWN,
    "--dry-run": _OWN,
    "--utc-error": "the listening boundary has its own clock; set `--utc-error US` on its command line",
}


def _other_modes(command: str) -> list[Conflict]:
    return [
        Conflict(
            command, _LISTENS, f"`--boundary-socket` requires `--mode process`, not `{mode}`",
            among=(f"--mode {mode}",),
        )
        for mode in EnforcementMode if mode is not EnforcementMode.PROCESS
    ]  # fmt: skip


#: the conflicts of all commands; the first that applies is reported
CONFLICTS: Final = (
    Conflict(
        "run", OF_SIMULATOR, "options of the simulated vehicle cannot be combined with `--connect`",
        "if you connect to `rtshcua sim`, pass them to `rtshcua sim`", among=_CONNECT,
    ),
    Conflict(
        "run", _CONNECT, "`--connect` requires `--vehicle ID`",
        "the vehicle's identity as in its policy; a bundle for another vehicle is refused", without=("--vehicle",),
    ),
    Conflict(
        "run", ("--scenario",), "`--scenario` requires the simulated vehicle and cannot be combined with `--connect`",
        among=_CONNECT,
    ),
    Conflict(
        "run", ("--scenario",), "`--scenario` conflicts with `--battery`, `--wind`, `--fault` and `--dry-run`",
        "the scenario sets the initial state and the faults; `--flavour` and `--seed` are accepted",
        among=("--battery", "--wind", "--fault", "--dry-run"),
    ),
    Conflict("run", ("--wait-for",), "`--wait-for` requires `--wait`", without=("--wait",)),
    Conflict(
        "run", ("--wait",), "`--wait` requires `--agent-socket PATH`, where an agent submits the bundle",
        without=("--agent-socket",),
    ),
    Conflict(
        "run", ("--wait",), "`--wait` conflicts with `--dry-run` and `--scenario`, which need the mission at the start",
        among=("--dry-run", "--scenario"),
    ),
    Conflict("run", ("--idle",), "`--idle` requires `--live`", without=("--live",)),
    Conflict(
        "run", ("--live",), "`--live` requires `--agent-socket PATH`, where replacements are submitted",
        without=("--agent-socket",),
    ),
    Conflict("run", ("--live",), "`--live` conflicts with `--dry-run`, which flies nothing", among=("--dry-run",)),
    Conflict("run", _LISTENS, "`--boundary-socket` requires `--connect`", without=_CONNECT),
    *_other_modes("run"),
    *(
        Conflict("run", (option,), f"`{option}` cannot be combined with `--boundary-socket`: {why}", among=_LISTENS)
        for option, why in _NOT_THERE.items()
    ),
    Conflict(
        "run", ("--system",), "`--system` requires `--connect`: there is only one simulated vehicle", without=_CONNECT
    ),
    Conflict(
        "run", ("--utc-error",), "`--utc-error` requires `--connect`: a simulation uses the time of this machine",
        without=_CONNECT,
    ),
    Conflict(
        "run", ("--fresh-state",), "`--fresh-state` requires the simulated vehicle and conflicts with `--state-dir`",
        among=("--state-dir", "--connect"),
    ),
    Conflict("run", ("--unsigned-radio",), _UNKEYED, without=("--signing-key", "--boundary-socket")),
    Conflict("doctor", ("--unsigned-radio",), _UNKEYED, without=("--signing-key",)),
    Conflict(
        "doctor", ("--utc-error",),
        "`--boundary-socket` excludes `--utc-error`: set it on the boundary's command line",
        among=_LISTENS,
    ),
    *_other_modes("doctor"),
    Conflict(
        "qualify", ("--takeover",), "`--takeover` requires `--pilot`: in a simulation takeovers are always tested",
        among=("--sitl",),
    ),
    Conflict(
        "qualify", ("--unsigned-radio",), "`--unsigned-radio` requires `--signing-key`", without=("--signing-key",)
    ),
    *(
        Conflict(
            "mcp", (option,), "`--http` and `--token-file` require each other",
            "leave out both to use the standard streams", without=(other,),
        )
        for option, other in (("--http", "--token-file"), ("--token-file", "--http"))
    ),
)  # fmt: skip


def conflict_of(context: typer.Context, *, only: tuple[str, ...] = ()) -> ExitCode | None:
    """Report the first conflict between the options of a command line and return its exit code; None if there is none.

    `only`: if not empty, look only at conflicts about these options.
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
