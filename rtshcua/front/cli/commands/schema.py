"""`rtshcua schema`: the JSON Schema of a mission specification, and tools for agents that are made of it."""

import json
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.app.exit_codes import exit_code
from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.suggest import nearest
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.stdout import out_json
from rtshcua.ground.agent.specification_schema import schema as mission_schema
from rtshcua.ground.agent.tool_forms import FORMS, Schema
from rtshcua.ground.language.load import Program

app = typer.Typer(add_completion=False)


@app.command()
def schema(
    form: Annotated[str, typer.Option(help=f"what is made of it: {', '.join(FORMS)}")] = "schema",
    policy: Annotated[
        Path | None, typer.Option(help="a source with one policy: only what an agent may be permitted under it fits")
    ] = None,
    name: Annotated[str | None, typer.Option(help="which policy, where the source has several")] = None,
) -> ExitCode:
    """Print the JSON Schema (draft 2020-12) of a mission specification, as `rtshcua compile` takes it.

    With --policy it is narrowed to the skills, zones and ranges that the policy permits to an agent. With --form it is
    the definition of a tool: for OpenAI (Responses API, or openai-chat for Chat Completions), for Anthropic, or for the
    Model Context Protocol; strict, where a policy narrows it. What fits a schema is still checked when it is handed in.
    """
    findings = Findings(json=False)
    if form not in FORMS:
        near = nearest(form, FORMS)
        help = f"did you mean `{near}`?" if near else f"accepted: {', '.join(FORMS)}"
        return findings.refuse(ExitCode.USAGE, "usage", f"there is no form `{form}`", help)
    if policy is None and name is not None:
        return findings.refuse(
            ExitCode.USAGE, "usage", "`--name` is not used without `--policy`", "name its source too"
        )
    if policy is None:
        found: Schema | ExitCode = mission_schema()
    else:
        found = _narrowed(policy, name, findings)
    if isinstance(found, ExitCode):
        return found
    out_json(json.dumps(FORMS[form](found, narrow=policy is not None), indent=2, ensure_ascii=False))
    return ExitCode.OK


def _narrowed(path: Path, name: str | None, findings: Findings) -> Schema | ExitCode:
    """The schema under the policy of a source; or how the command ends without one."""
    from rtshcua.app.programs import examine, read_sources
    from rtshcua.ground.agent.narrowed_schema import narrowed

    reading = read_sources([path])
    program = reading.program
    checked = examine(reading)
    if has_errors(checked.diagnostics):
        findings.report(checked.diagnostics, program.sources)
        return exit_code(checked.diagnostics)
    own = [declared.name.text for declared in (program.units[0].policies if program.units else ())]
    wanted = [each for each in own if name in (None, each)]
    if len(wanted) != 1:
        help = f"its policies are {', '.join(f'`{each}`' for each in own)}" if own else "name the source of a policy"
        what = f"no policy `{name}`" if name is not None else "no policy" if not own else "several policies"
        return findings.refuse(ExitCode.INPUT, "no-policy", f"`{path}` has {what}", help)
    lowered = next((each for each in checked.policies if each.policy.name == wanted[0]), None)
    if lowered is None:
        return findings.refuse(ExitCode.INPUT, "no-vehicle", f"`{wanted[0]}` has no vehicle", "import one")
    return narrowed(lowered, program.units, _shipped(program))


def _shipped(program: Program) -> str | None:
    """What a specification imports to have the policy; None where the policy is named on the command line."""
    path = program.stable.get(program.units[0].file, "")
    return path if path.startswith("lib:") else None
