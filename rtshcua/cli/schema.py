"""`rtshcua schema`: the JSON Schema of a mission specification, for agents."""

import json

import typer

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.ground.agent.schema import schema as mission_schema

app = typer.Typer(add_completion=False)


@app.command()
def schema() -> ExitCode:
    """Print the JSON Schema (draft 2020-12) of a mission specification, as `rtshcua compile` takes it."""
    print(json.dumps(mission_schema(), indent=2, ensure_ascii=False))
    return ExitCode.OK
