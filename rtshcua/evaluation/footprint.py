"""X7: the onboard components of the paper in this project: code lines, artifact, peak memory in a flight, and state.

On the companion computer memory is what `tracemalloc` finds allocated by a component's files, at the greatest of
samples throughout one flight of the standard mission, in octets. In a secure world it is what the program has in
memory: its data, its stack and its heap, by its ELF sections and header. The tables of a process are sized for the
largest bundle, and so count as far as the mission's bundle fills them: its greatest resident memory. As in the paper,
components share nothing; sums are those of the rows.
"""

import ast
import re
import tracemalloc
from collections.abc import Callable, Iterator, Sequence
from io import BytesIO
from pathlib import Path
from struct import Struct
from tempfile import TemporaryDirectory
from tokenize import COMMENT, DEDENT, ENCODING, ENDMARKER, INDENT, NEWLINE, NL, tokenize
from typing import Final, NamedTuple

from rtshcua.adapters.boundary import process
from rtshcua.adapters.store.evidence_file import EvidenceFile, EvidenceWriter
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evaluation.case_flights import simulated
from rtshcua.evaluation.design import EvaluationPlan, EvaluationPoint, WorkUnit
from rtshcua.evaluation.results import ComponentSize, Result
from rtshcua.evaluation.worlds import RECEIVED, FlatProgram, pinned, program_at, root_of
from rtshcua.onboard.enforcement.isolated import Caller
from rtshcua.onboard.ports import Ending
from rtshcua.virtual import development_keys
from rtshcua.virtual.flight import VirtualFlight
from rtshcua.wire.keys import Duty

NAME: Final = "X7"
PACKAGE: Final = Path(__file__).resolve().parents[1]
CHECKOUT: Final = PACKAGE.parent
#: programs of a checkout, or of a wheel
BUILT: Final = CHECKOUT / "build" / "boundary"
#: the deadline of the steps of the mission that is flown, in us
_DEADLINE_US: Final = 1_000_000
_TICK_US: Final = 50_000
#: us of the flight between two samples of memory
SAMPLE_US: Final = 10_000_000


class Component(NamedTuple):
    """A component of the paper, as patterns of its files below the package; those of `without` are others'."""

    name: str
    files: tuple[str, ...]
    without: tuple[str, ...] = ()
    state: str = "none"


_QUEUE, _MONITOR = "onboard/runtime/admission.py", ("onboard/runtime/monitor.py", "onboard/runtime/supervisor.py")
_EXECUTOR: Final = "onboard/enforcement/executor.py"
#: those on the companion computer, with the names of the paper
COMPANION: Final = (
    Component(
        "runtime dispatcher", ("onboard/runtime/*.py", "adapters/loop.py"), (_QUEUE, *_MONITOR),
        "the command that flies",
    ),
    Component("invocation queue", (_QUEUE,), (), "the current step, its release, the last answers"),
    Component("state monitor", _MONITOR, (), "a snapshot of the vehicle's state, with ages"),
    Component("skill executor", (_EXECUTOR,), (), "serials of permits that were used"),
    Component("skill executor: MAVLink manoeuvres", ("adapters/vehicle/**/*.py",), (), "the manoeuvre that flies"),
    Component(
        "enforcement client", ("onboard/enforcement/*.py", "adapters/boundary/*.py"), (_EXECUTOR,),
        "the bundle in force, used ids",
    ),
    Component("enforcement: decision", ("decision/*.py", "decision/*/*.py"), (), "the prepared policy and mission"),
    Component(
        "evidence logger", ("evidence/**/*.py", "adapters/store/evidence_file.py"), (), "chain and tree of the log"
    ),
    Component("wire: keys, COSE, CBOR", ("wire/*.py",), (), "none"),
    Component("model: flat form, situation, outcome", ("model/*.py", "model/flat/*.py"), (), "none"),
)  # fmt: skip


class SecureHome(NamedTuple):
    """A home of the boundary in C: its program, its sources below `boundary`, its domain, and whether its resident
    memory counts.
    """

    name: str
    program: Path
    sources: tuple[str, ...]
    domain: str
    resident: bool = False


_C: Final = ("decision", "enforcement", "wire", "evidence", "crypto")
HOMES: Final = (
    SecureHome("trusted enforcement: process", BUILT / "rtshcua-boundary", (*_C, "home/process*"), "companion", True),
    SecureHome(
        "trusted enforcement: trustzone-m",
        BUILT / "trustzone_m" / "secure.elf",
        (*_C, "home/trustzone_m"),
        "secure-world",
    ),
    SecureHome("trusted enforcement: optee", BUILT / "optee" / "application.elf", (*_C, "home/optee"), "secure-world"),
)


def units(plan: EvaluationPlan) -> list[WorkUnit]:
    """One unit with all components, and the mission that is flown: as published, or a shorter one."""
    return [WorkUnit(NAME, ("components", "short" if plan.quick else "standard"))]


def run(unit: WorkUnit) -> Sequence[Result]:
    """The size of every component."""
    program = program_at(EvaluationPoint(str(unit.key[1]), _DEADLINE_US))
    peaks = _peaks(program)
    companion = [_companion(each, peaks[each.name]) for each in COMPANION]
    return [*companion, *(_home(each, _resident(program) if each.resident else None) for each in HOMES)]


def files_of(component: Component) -> list[Path]:
    """The files of a component, in order."""
    left_out = {PACKAGE / each for each in component.without}
    return sorted({found for each in component.files for found in PACKAGE.glob(each)} - left_out)


def _companion(component: Component, memory: int) -> ComponentSize:
    files = files_of(component)
    return ComponentSize(
        component=component.name, domain="companion", files=tuple(str(each.relative_to(PACKAGE)) for each in files),
        code_lines=sum(code_lines(each.read_bytes()) for each in files),
        artifact=sum(each.stat().st_size for each in files), memory=memory, state=component.state,
    )  # fmt: skip


# ---------------------------------------------------------------- code lines

_IDLE: Final = frozenset({COMMENT, DEDENT, ENCODING, ENDMARKER, INDENT, NEWLINE, NL})


def code_lines(source: bytes) -> int:
    """How many lines of a Python module hold code: no blanks, comments and docstrings."""
    tokens = tokenize(BytesIO(source).readline)
    lines = {line for each in tokens if each.type not in _IDLE for line in range(each.start[0], each.end[0] + 1)}
    return len(lines.difference(*_docstrings(ast.parse(source))))


_STATEMENTS: Final = (ast.stmt, ast.excepthandler, ast.match_case)


def _docstrings(tree: ast.Module) -> Iterator[range]:
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()  # expressions, most of a tree, have none
        waiting += [each for each in ast.iter_child_nodes(node) if isinstance(each, _STATEMENTS)]
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and node.body:
            first = node.body[0]
            if (
                isinstance(first, ast.Expr)
                and isinstance(first.value, ast.Constant)
                and isinstance(first.value.value, str)
            ):
                yield range(first.lineno, (first.end_lineno or first.lineno) + 1)


_C_TOKEN: Final = re.compile(rb'"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])*\'|//[^\n]*|/\*.*?\*/', re.DOTALL)


def c_code_lines(source: bytes) -> int:
    """How many lines of a C source hold code: no blanks and comments."""

    def without(found: "re.Match[bytes]") -> bytes:
        return found[0] if found[0][:1] in b"\"'" else b"\n" * found[0].count(b"\n")

    return sum(bool(line.strip()) for line in _C_TOKEN.sub(without, source).splitlines())


# ---------------------------------------------------------------- programs


class ElfSizes(NamedTuple):
    """Sizes of an ELF program in octets: code and constants, what its file holds of them and its data, data with what
    is zero at first, and the stack where it has a section.
    """

    code: int
    artifact: int
    data: int
    stack: int


_WRITE, _ALLOC, _NOBITS = 1, 2, 8
_ELF32, _ELF64 = Struct("<IIIIIIIIII"), Struct("<IIQQQQIIQQ")
_NAME, _KIND, _FLAGS, _SIZE, _OFFSET = 0, 1, 2, 5, 4


def elf_sizes(program: bytes) -> ElfSizes:
    """The sizes of a little-endian ELF program, by its sections. Raises ValueError for other octets."""
    if program[:4] != b"\x7fELF" or program[5] != 1:
        raise ValueError("not a little-endian ELF program")
    wide = program[4] == 2
    at = int.from_bytes(program[40:48] if wide else program[32:36], "little")
    size, many, names = (int.from_bytes(program[x : x + 2], "little") for x in ((58, 60, 62) if wide else (46, 48, 50)))
    layout = _ELF64 if wide else _ELF32
    sections = [layout.unpack_from(program, at + number * size) for number in range(many)]
    code = artifact = data = stack = 0
    for each in sections:
        start = sections[names][_OFFSET] + each[_NAME]
        name = program[start : program.index(b"\0", start)]
        if not each[_FLAGS] & _ALLOC:
            continue
        artifact += 0 if each[_KIND] == _NOBITS else each[_SIZE]
        if name == b".stack":
            stack += each[_SIZE]
        elif each[_FLAGS] & _WRITE:
            data += each[_SIZE]
        else:
            code += each[_SIZE]
    return ElfSizes(code, artifact, data, stack)


#: what the header of OP-TEE's application asks for: its loader gives that, and no section has it
_ASKED: Final = re.compile(r"TA_STACK_SIZE \((\d+) \* 1024\)")


def stack_of(home: SecureHome, sizes: ElfSizes) -> int:
    """The stack of a home, which for OP-TEE is in no section of its file, in octets."""
    header = CHECKOUT / "boundary" / "home" / "optee" / "user_ta_header_defines.h"
    if sizes.stack or not home.name.endswith("optee") or not header.is_file():
        return sizes.stack
    return sum(int(found) << 10 for found in _ASKED.findall(header.read_text()))


def _home(home: SecureHome, resident: int | None) -> ComponentSize:
    boundary = CHECKOUT / "boundary"
    folders = [found for each in home.sources for found in boundary.glob(each)]
    files = sorted(each for folder in folders for each in ([folder] if folder.is_file() else folder.rglob("*.[ch]")))
    sizes = elf_sizes(home.program.read_bytes()) if home.program.is_file() else None
    return ComponentSize(
        component=home.name, domain=home.domain, files=tuple(str(each.relative_to(CHECKOUT)) for each in files),
        code_lines=sum(c_code_lines(each.read_bytes()) for each in files) or None,
        artifact=None if sizes is None else sizes.artifact,
        memory=None if sizes is None else resident or sizes.data + stack_of(home, sizes),
        state="keys, opened missions, used ids, evidence chain" if sizes else "not built here",
    )  # fmt: skip


# ---------------------------------------------------------------- memory


def _resident(program: FlatProgram) -> int | None:
    """The greatest resident memory of the boundary's process with the bundle in force; None where it was not built."""
    if process.program() is None:
        return None
    root, vehicle = root_of(program.policy), program.policy.vehicle.identity
    with TemporaryDirectory() as folder:
        home = process.BoundaryProcess(root, pinned(), vehicle, Path(folder), paced=True)
        try:
            if isinstance(Caller(home.call).load(development_keys.seal(*program), RECEIVED), Refusal):
                return None
            status = Path(f"/proc/{home.pid}/status").read_text()
        finally:
            home.close()
    return int(status.partition("VmHWM:")[2].split()[0]) << 10


class _FileSink(EvidenceWriter):
    """Evidence in a file, as on board: nothing of it stays in memory."""

    @property
    def lines(self) -> list[bytes]:
        """The lines of the file."""
        return self.path.read_bytes().splitlines(keepends=True)

    path: Path


def _peaks(program: FlatProgram) -> dict[str, int]:
    """The greatest memory of each component among samples of one flight, from the loading of the bundle on."""
    owners = {str(file): each.name for each in COMPANION for file in files_of(each)}
    peaks = dict.fromkeys((each.name for each in COMPANION), 0)
    bundle, keys = development_keys.seal(*program), development_keys.keys()

    def look() -> None:
        found = dict.fromkeys(peaks, 0)
        for each in tracemalloc.take_snapshot().statistics("filename"):
            owner = owners.get(each.traceback[0].filename)
            if owner is not None:
                found[owner] += each.size
        for name, size in found.items():
            peaks[name] = max(peaks[name], size)

    with TemporaryDirectory() as folder:
        sink = _sink(Path(folder) / "log.jsonl")
        tracemalloc.start()
        try:
            flight = VirtualFlight(
                bundle, lambda _: simulated(program), root=root_of(program.policy),
                log_key=keys[Duty.LOG], sink=sink, boundary=keys[Duty.BOUNDARY], tick_us=_TICK_US,
            )  # fmt: skip
            _fly(flight, look)
        finally:
            tracemalloc.stop()
    return peaks


def _sink(path: Path) -> Callable[[object], _FileSink]:
    def made(_: object) -> _FileSink:
        sink = _FileSink(EvidenceFile(path))
        sink.path = path
        return sink

    return made


def _fly(flight: VirtualFlight, look: Callable[[], None]) -> None:
    due_us, ending = 0, flight.prepare()
    while ending is None:
        ending = flight.turn()
        flight.events.clear()  # kept for tests only
        if flight.clock.elapsed_us >= due_us:
            look()
            due_us += SAMPLE_US
    if ending is not Ending.COMPLETED:
        raise RuntimeError(f"the flight ended: {ending}")
    flight.close(ending)


def total(sizes: Sequence[ComponentSize]) -> tuple[int, int, int]:
    """The sums of the rows: code lines, artifacts, memory; what is not known counts nothing."""
    return (
        sum(each.code_lines or 0 for each in sizes), sum(each.artifact or 0 for each in sizes),
        sum(each.memory or 0 for each in sizes),
    )  # fmt: skip
