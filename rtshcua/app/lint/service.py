"""A run of lint, from its options to the findings and fixes. This module does not import the parser, to start fast."""

from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.store.git import GitChanges, NoChanges, changed_files
from rtshcua.app.exit_codes import exit_code
from rtshcua.app.files import overwriting_a_source
from rtshcua.app.lint.findings import LintFindings, affected, gather, unused_ignores
from rtshcua.app.lint.fix import FixedFiles, fix
from rtshcua.app.lint.scope import FORMATS, LintOptions, LintScope, scope
from rtshcua.app.lint.session import LintSession
from rtshcua.diagnostics.codes import NO_SUCH_FILE, TOO_LARGE, Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.suggest import listed, nearest
from rtshcua.ground.language.paths import shown
from rtshcua.ground.project.project_settings import LEVELS

_FROM: dict[str, int] = {"error": 1, "warning": 2, "note": 3, "never": 0}
_ORDER = (Severity.ERROR, Severity.WARNING, Severity.NOTE)


class LintRun(NamedTuple):
    """The result of a run: findings, the names of the linted files, fixes, and the errors of files not written."""

    options: LintOptions
    scope: LintScope
    findings: LintFindings
    names: tuple[str, ...]
    fixed: FixedFiles | None
    unwritten: dict[str, OSError]

    def failing(self, found: Diagnostic) -> frozenset[Severity]:
        """Return the severities at which a finding fails the run, by the configuration of its file."""
        levels = {shown(str(path)): project.settings.lint.fail_on for path, project in self.scope.projects.items()}
        default = next(iter(levels.values()), "warning")
        level = self.options.fail_on or levels.get("" if found.span is None else found.span.file) or default
        return frozenset(_ORDER[: _FROM[level]])

    @property
    def code(self) -> ExitCode:
        """The exit code of the run."""
        found = self.findings.found
        if any(each.code in (NO_SUCH_FILE, TOO_LARGE) and each.span is None for each in found):
            return exit_code(found)
        return ExitCode.DIAGNOSTICS if any(each.severity in self.failing(each) for each in found) else ExitCode.OK


def lint(options: LintOptions) -> LintRun | Refusal:
    """Lint files, and apply and write fixes if the options say so. Raises OSError for a file that cannot be read."""
    wrong = _misused(options)
    about = scope(options) if wrong is None else wrong
    if isinstance(about, Refusal):
        return about
    session = LintSession([*about.files, *(each for further in about.further.values() for each in further)])
    changed: GitChanges | None = None
    if options.changed or options.base is not None:
        try:
            changed = changed_files(options.paths, options.base)
        except NoChanges as error:
            return Refusal("changed", str(error), error.help or "")
    found, names = _find(options, about, session, changed)
    read: tuple[Path | str, ...] = (*about.files, *session.names)
    forbidden = None if options.output is None else overwriting_a_source(options.output, read, "a report")
    if forbidden is not None:
        return forbidden
    run = LintRun(options, about, found, names, None, {})
    return _fixed(run, session, changed) if options.fixes else run


def _fixed(run: LintRun, session: LintSession, changed: GitChanges | None) -> LintRun:
    """Apply the fixes of a run, and write them unless the run only shows them."""
    options, about = run.options, run.scope
    fixed = fix(
        session, run.findings, lambda: _find(options, about, session, changed)[0], run.names,
        suggested=options.unsafe_fixes,
    )  # fmt: skip
    unwritten = {} if options.diff else _write(fixed)
    if unwritten:
        for name in unwritten:
            session.put(name, fixed.before[name])
        files = {name: data for name, data in fixed.files.items() if name not in unwritten}
        told, names = _find(options, about, session, changed)
        run, fixed = run._replace(names=names), fixed._replace(files=files, told=told)
    return run._replace(findings=fixed.told, fixed=fixed, unwritten=unwritten)


def _misused(options: LintOptions) -> Refusal | None:
    for name, value, words in (("--format", options.form, FORMATS), ("--fail-on", options.fail_on, LEVELS)):
        if value is not None and value not in words:
            near = nearest(value, words)
            help = f"accepted: {listed(words)}" if near is None else f"did you mean `{near}`?"
            return Refusal("usage", f"`{value}` is not a value of `{name}`", help)
    if options.config is not None and options.isolated:
        return Refusal("usage", "`--config` and `--isolated` cannot be combined", "use one of them")
    return None


def _find(
    options: LintOptions, about: LintScope, session: LintSession, changed: GitChanges | None
) -> tuple[LintFindings, tuple[str, ...]]:
    """Return the findings and the names of the linted files."""
    if not about.files:
        return LintFindings((), (), {}, frozenset(), frozenset()), ()
    programs = session.examine(about.files, about.further, about.caches, about.widths)
    names = {shown(str(path)): path for path in about.files}
    if changed is not None:
        programs = affected(programs, changed)
        kept = {name for program in programs for name in program.members}
        names = {name: path for name, path in names.items() if name in kept}
    laid = {shown(str(path)) for path in about.widths}
    found = gather(programs, session.sources, about.configured(), tuple(names), laid)
    if changed is None and not found.untold:
        projects = {(each.file, each.root): each for each in about.projects.values()}.values()
        more = list(unused_ignores(projects, found.used, options.paths))
        every = (*found.found, *(each for each, _ in more))
        found = found._replace(found=every, sources={**found.sources, **{each.file: each for _, each in more}})
    return found, tuple(names)


def _write(fixed: FixedFiles) -> dict[str, OSError]:
    """Write the changed files. Return the error of each file that could not be written."""
    from rtshcua.adapters.store import writing

    unwritten: dict[str, OSError] = {}
    for name, data in fixed.files.items():
        try:
            writing.rewrite(Path(name), fixed.before[name], data)
        except OSError as error:
            unwritten[name] = error
    return unwritten
