"""Small programs as text, and their findings."""

from collections.abc import Iterable
from pathlib import Path

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program
from rtshcua.mavlink import dialect

CHECKOUT = Path(__file__).resolve().parents[2]
#: the frozen library of the checker's twins
LIBRARY = str(CHECKOUT / "tests" / "golden" / "checker" / "library")
IMPORTS = "".join(
    f'import "lib:{name}.rts"\n'
    for name in (
        "policies/site",
        *(f"skills/{skill}" for skill in ("signals", "takeoff", "hover", "goto", "return_home", "emergency_land")),
    )
)


def findings(text: str) -> tuple[Diagnostic, ...]:
    """Return all findings of a source."""

    def read(path: str) -> bytes:
        return text.encode() if path == "probe.rts" else Path(path).read_bytes()

    return check_program(load(["probe.rts"], read, LIBRARY), dialect.load())


def found(text: str) -> list[tuple[str, str]]:
    """Return codes and messages of all findings of a source."""
    return [(each.code.id, each.message) for each in findings(text)]


def skill(name: str, **parts: str) -> str:
    """Return a skill that holds, with some parts replaced. A part with the value "" is omitted."""
    written = {
        "motion": "hold",
        "class": "tactical",
        "deadline": "5 s",
        "valid": "for 40 min",
        "lasts": "at most 1 min",
        "fallback": "return_home, emergency_land",
        "energy": "at most 9 %",
        **parts,
    }
    return f"skill {name} {{\n" + "".join(f"  {key} {value}\n" for key, value in written.items() if value) + "}\n"


def policy(*rules: str, contingency: str = "return_home, emergency_land") -> str:
    """Return a policy that permits everything, with further rules."""
    lines = ["permit any by any through agent, operator, onboard, reflex", *rules, f"contingency {contingency}"]
    return "policy rules version 1 {\n" + "".join(f"  {line}\n" for line in lines) + "}\n"


def mission(*steps: str, under: str = "rules@1") -> str:
    """Return a mission of one phase, named `departure` because the library's `takeoff` requires it."""
    body = "".join(f"    {step}\n" for step in steps)
    header = f"mission flight under {under} on quad {{\n  proposed by agent openclaw for role operator\n"
    return f"{header}  phase departure {{\n{body}  }}\n}}\n"


#: besides `operator`
ROLES = "role supervisor, rescuer, pilot, trainee, chief"


def program(*parts: str, imports: Iterable[str] = (IMPORTS,)) -> str:
    """Join parts to one source, with their imports and the roles that they may name."""
    return "".join((*imports, *parts, f"{ROLES}\n"))
