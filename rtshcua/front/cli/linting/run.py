"""A run of `rtshcua lint`, from its options to its exit code."""

from collections.abc import Callable
from pathlib import Path

from rtshcua.adapters.store.git import GitChanges, NoChanges, changed_files
from rtshcua.app.exit_codes import exit_code, exit_code_of, words_of
from rtshcua.app.files import overwriting_a_source
from rtshcua.diagnostics.codes import NO_SUCH_FILE, TOO_LARGE, Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.suggest import listed, nearest
from rtshcua.front.cli.faults import say, tell
from rtshcua.front.cli.findings import Findings
from rtshcua.front.cli.linting.fixing import Fixed, fix
from rtshcua.front.cli.linting.gathered import Gathered, gathered
from rtshcua.front.cli.linting.idle import idle
from rtshcua.front.cli.linting.options import FORMATS, Options
from rtshcua.front.cli.linting.report import statistics, summary, written
from rtshcua.front.cli.linting.scope import Scope, scope
from rtshcua.front.cli.linting.session import Session
from rtshcua.front.cli.linting.touched import touched
from rtshcua.front.cli.stdout import out, out_json, out_rendered
from rtshcua.ground.language.paths import shown
from rtshcua.ground.project.settings import LEVELS

_WORSE: dict[str, int] = {"error": 1, "warning": 2, "note": 3, "never": 0}
_ORDER = (Severity.ERROR, Severity.WARNING, Severity.NOTE)


def run(options: Options) -> ExitCode:
    """Lint, and fix where that is asked for."""
    form = "json" if options.json else options.format
    findings = Findings(json=form == "json" and options.output is None)
    wrong = _misused(options, form)
    if wrong is not None:
        return findings.end(wrong)
    about = scope(options)
    if isinstance(about, Refusal):
        return findings.end(about)
    session = Session([*about.files, *(each for further in about.further.values() for each in further)])
    changed: GitChanges | None = None
    if options.changed or options.base is not None:
        try:
            changed = changed_files(options.paths, options.base)
        except NoChanges as error:
            return findings.refuse(ExitCode.INPUT, "changed", str(error), error.help)
    told, names = _told(options, about, session, changed)
    read: tuple[Path | str, ...] = (*about.files, *session.names)
    forbidden = None if options.output is None else overwriting_a_source(options.output, read, "a report")
    if forbidden is not None:
        return findings.end(forbidden)
    mended: Fixed | None = None
    if options.fixes:
        mended = fix(
            session, told, lambda: _told(options, about, session, changed)[0], names, suggested=options.unsafe_fixes
        )
        told = mended.told
    if mended is not None and options.diff:
        return _diffed(mended)
    unwritten = {} if mended is None else _write(mended)
    if mended is not None and unwritten:
        for name in unwritten:
            session.put(name, mended.before[name])
        told, names = _told(options, about, session, changed)
        mended = mended._replace(files={name: data for name, data in mended.files.items() if name not in unwritten})
    code = _code(options, about, told)
    for name, why in unwritten.items():
        code = exit_code_of(why)
        tell(code, f"cannot write `{name}`: {words_of(why)}")
    return _report(options, form, told, names, about, code, mended)


def _misused(options: Options, form: str) -> Refusal | None:
    for name, value, words in (("--format", form, FORMATS), ("--fail-on", options.fail_on, LEVELS)):
        if value is not None and value not in words:
            near = nearest(value, words)
            help = f"accepted: {listed(words)}" if near is None else f"did you mean `{near}`?"
            return Refusal("usage", f"`{value}` is nothing that `{name}` can be", help)
    if options.config is not None and options.isolated:
        return Refusal("usage", "`--config` and `--isolated` exclude each other")
    return None


def _told(
    options: Options, about: Scope, session: Session, changed: GitChanges | None
) -> tuple[Gathered, tuple[str, ...]]:
    """The findings, and the names of the files that were looked at."""
    if not about.files:
        return Gathered((), (), {}, frozenset(), frozenset()), ()
    programs = session.examine(about.files, about.further, about.caches, about.widths)
    names = {shown(str(path)): path for path in about.files}
    if changed is not None:
        programs = touched(programs, changed)
        kept = {name for program in programs for name in program.members}
        names = {name: path for name, path in names.items() if name in kept}
    laid = {shown(str(path)) for path in about.widths}
    told = gathered(programs, session.sources, about.configured(), tuple(names), laid)
    if changed is None:
        projects = {(each.file, each.root): each for each in about.projects.values()}.values()
        more = list(idle(projects, told.used, options.paths)) if not told.untold else []
        found = (*told.found, *(each for each, _ in more))
        told = told._replace(found=found, sources={**told.sources, **{each.file: each for _, each in more}})
    return told, tuple(names)


def _code(options: Options, about: Scope, told: Gathered) -> ExitCode:
    """How the run ends, by the level from which each file's findings fail."""
    if any(each.code in (NO_SUCH_FILE, TOO_LARGE) and each.span is None for each in told.found):
        return exit_code(told.found)
    fails = _failing(options, about)
    return ExitCode.DIAGNOSTICS if any(each.severity in fails(each) for each in told.found) else ExitCode.OK


def _failing(options: Options, about: Scope) -> Callable[[Diagnostic], frozenset[Severity]]:
    levels = {shown(str(path)): project.settings.lint.fail_on for path, project in about.projects.items()}
    default = next(iter(levels.values()), "warning")

    def fails(found: Diagnostic) -> frozenset[Severity]:
        level = options.fail_on or levels.get("" if found.span is None else found.span.file) or default
        return frozenset(_ORDER[: _WORSE[level]])

    return fails


def _diffed(mended: Fixed) -> ExitCode:
    """Print what fixes would change; 1 where that is anything, as for a file that is not formatted."""
    from rtshcua.front.cli.formatting.shown import unified

    for name, data in mended.files.items():
        out_rendered("".join(unified(name, mended.before[name], data)), end="")
    return ExitCode.DIAGNOSTICS if mended.files else ExitCode.OK


def _write(mended: Fixed) -> dict[str, OSError]:
    """Put the new texts in place; those that could not be, and why."""
    from rtshcua.adapters.store import writing

    unwritten: dict[str, OSError] = {}
    for name, data in mended.files.items():
        try:
            writing.rewrite(Path(name), mended.before[name], data)
        except OSError as error:
            unwritten[name] = error
    return unwritten


def _report(
    options: Options,
    form: str,
    told: Gathered,
    names: tuple[str, ...],
    about: Scope,
    code: ExitCode,
    mended: Fixed | None,
) -> ExitCode:
    files = 0 if mended is None else len(mended.files)
    if form != "human" or options.output is not None:
        some = _failing(options, about)
        failing = frozenset[Severity]().union(*(some(each) for each in told.found))
        text = written(form, told, names, code, failing)
        if options.output is None:
            out_json(text, end="") if form in ("json", "sarif") else out_rendered(text, end="")
            return code
        from rtshcua.adapters.store.writing import write_out

        write_out(options.output, text.encode("utf-8"))
    for name in () if mended is None else mended.refused:
        say(f"note: the fixes of `{name}` would bring an error, so they were not made")
    Findings(json=False).report(told.found, told.sources)
    if files:
        out(f"fixed {files} file{'s' * (files != 1)}")
    if options.statistics and (told.found or told.ignored):
        out(*statistics(told).split("\n"))
    if not told.found:
        out(summary(told, len(names), about.left_out))
    elif told.ignored:
        say(f"{len(told.ignored)} more {'is' if len(told.ignored) == 1 else 'are'} ignored")
    return code
