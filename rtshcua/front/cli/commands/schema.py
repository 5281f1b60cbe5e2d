"""`rtshcua schema`: print the JSON Schema of a mission specification, or a tool definition for agents."""

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
    form: Annotated[str, typer.Option(help=f"output format: {', '.join(FORMS)}")] = "schema",
    policy: Annotated[
        Path | None, typer.Option(help="a source with one policy: limit the schema to what it permits to an agent")
    ] = None,
    name: Annotated[str | None, typer.Option(help="the policy to use if the source has several")] = None,
) -> ExitCode:
    """Print the JSON Schema (draft 2020-12) of a mission specification for `rtshcua compile`.

    --policy limits it to the skills, zones and ranges that the policy permits to an agent. --form prints a tool
    definition instead: for OpenAI (Responses API, or openai-chat for Chat Completions), Anthropic, or the Model Context
    Protocol; with --policy it is strict. A specification that matches the schema is still checked when it is submitted.
    """
    findings = Findings(json=False)
    if form not in FORMS:
        near = nearest(form, FORMS)
        help = f"did you mean `{near}`?" if near else f"accepted: {', '.join(FORMS)}"
        return findings.refuse(ExitCode.USAGE, "usage", f"unknown form `{form}`", help)
    if policy is None and name is not None:
        return findings.refuse(ExitCode.USAGE, "usage", "`--name` requires `--policy`", "add `--policy SOURCE`")
    if policy is None:
        found: Schema | ExitCode = mission_schema()
    else:
        found = _narrowed(policy, name, findings)
    if isinstance(found, ExitCode):
        return found
    out_json(json.dumps(FORMS[form](found, narrow=policy is not None), indent=2, ensure_ascii=False))
    return ExitCode.OK


def _narrowed(path: Path, name: str | None, findings: Findings) -> Schema | ExitCode:
    """Return the schema limited by the policy of a source, or the exit code of a reported error."""
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
    """Return the `lib:` path by which a specification imports the policy; None if the policy is not in the library."""
    path = program.stable.get(program.units[0].file, "")
    return path if path.startswith("lib:") else None
