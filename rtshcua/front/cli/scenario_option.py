"""`run --scenario FILE:NAME`: find the scenario."""

from pathlib import Path

from rtshcua.app.exit_codes import exit_code
from rtshcua.app.programs import read_sources
from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.pipeline.suite import scenarios
from rtshcua.ground.testing.scenario_lowering import ScenarioFlight
from rtshcua.mavlink import dialect


def chosen(text: str, issued_at_us: int) -> ScenarioFlight | Refusal:
    """Return the scenario that `FILE` or `FILE:NAME` names. Raises OSError if the file cannot be read."""
    path, name = _split(text)
    program = read_sources([path]).program
    found = scenarios(program, dialect.load(), issued_at_us)
    if has_errors(found.diagnostics):
        code = exit_code(found.diagnostics)
        if code is ExitCode.INPUT:
            return Refusal("input", found.diagnostics[0].message, found.diagnostics[0].help or "", code)
        return Refusal("sources", f"`{path}` has errors", f"run `rtshcua check {path}`", code)
    names = [each.scenario.name for each in found.found]
    fits = [each for each in found.found if name in ("", each.scenario.name)]
    if len(fits) == 1:
        return fits[0]
    listed = ", ".join(f'"{each}"' for each in names) or "none"
    what = f"no scenario `{name}`" if name else "no scenario" if not names else f"{len(names)} scenarios"
    help = f"name one, as in `{path}:NAME`; accepted: {listed}"
    return Refusal("usage", f"`{path}` has {what}", help, ExitCode.USAGE)


def _split(text: str) -> tuple[Path, str]:
    path, _, name = text.partition(".rts:")
    return (Path(path + ".rts"), name) if name else (Path(text), "")
