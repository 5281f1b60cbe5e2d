"""The options of a lint run, the files that it covers, and the configuration of each file."""

import os
from collections.abc import Mapping, Sequence
from os.path import lexists, normpath
from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.store.checkout import checkout_of, lies_in
from rtshcua.adapters.store.folders import cache_folder
from rtshcua.adapters.store.lint_cache import LintCache
from rtshcua.adapters.store.project import Project, Projects
from rtshcua.app.files import SOURCE, source_files
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.language.paths import shown
from rtshcua.ground.project.project_settings import IgnoredCode, misconfigured

FORMATS = ("human", "json", "sarif", "github", "junit")


class LintOptions(NamedTuple):
    """The options of the command line, explained in `rtshcua/front/cli/commands/lint.py`."""

    paths: tuple[Path, ...]
    format: str = "human"
    output: Path | None = None
    fail_on: str | None = None
    with_: tuple[Path, ...] = ()
    changed: bool = False
    base: str | None = None
    config: Path | None = None
    isolated: bool = False
    fix: bool = False
    unsafe_fixes: bool = False
    diff: bool = False
    no_cache: bool = False
    statistics: bool = False
    json: bool = False

    @property
    def form(self) -> str:
        """The format of the report."""
        return "json" if self.json else self.format

    @property
    def fixes(self) -> bool:
        """Whether fixes are applied or shown."""
        return self.fix or self.unsafe_fixes or self.diff


class LintScope(NamedTuple):
    """The files to lint, each with its project, further sources and cache. `left_out` counts the excluded files."""

    files: tuple[Path, ...]
    projects: Mapping[Path, Project]
    further: Mapping[Path, Sequence[Path]]
    caches: Mapping[Path, LintCache | None]
    left_out: int
    widths: Mapping[Path, int]  # line widths of the files whose layout is checked

    def configured(self) -> dict[str, tuple[IgnoredCode, ...]]:
        """Return for each file name the codes that the configuration ignores in it."""
        return {shown(str(path)): ignored_in(self.projects[path], path) for path in self.files}


def scope(options: LintOptions) -> LintScope | Refusal:
    """Find the files to lint, without those that their configuration excludes. An invalid option is a refusal."""
    files = source_files(options.paths)
    if isinstance(files, Refusal):
        return files
    projects = Projects(options.config, isolated=options.isolated)
    found: dict[Path, Project] = {}
    looked_at: set[tuple[Path | None, Path]] = set()
    for path in files:
        project = projects.of(path)
        if isinstance(project, Refusal):
            return project
        if (project.file, project.root) not in looked_at and not options.with_:
            looked_at.add((project.file, project.root))
            wrong = _no_further(project)
            if wrong is not None:
                return wrong
        if not project.excludes(path, project.settings.lint.exclude):
            found[path] = project
    kept = tuple(found)
    caches = {} if options.no_cache else _caches(tuple(found.items()), fresh=options.fixes)
    return LintScope(
        kept,
        found,
        {path: options.with_ or _further(project) for path, project in found.items()},
        {path: caches.get(path) for path in found},
        len(files) - len(kept),
        {path: project.settings.format.width for path, project in found.items() if _looks_at_layout(project, path)},
    )


def _looks_at_layout(project: Project, path: Path) -> bool:
    settings = project.settings
    return settings.lint.format and path.suffix == SOURCE and not project.excludes(path, settings.format.exclude)


def ignored_in(project: Project, path: Path) -> tuple[IgnoredCode, ...]:
    """Return the codes that the configuration of a project ignores in a file."""
    return tuple(
        each for each in project.settings.lint.ignored if each.pattern is None or project.means(each.pattern, path)
    )


def _further(project: Project) -> tuple[Path, ...]:
    here = Path(normpath(Path().absolute()))
    placed = [Path(normpath(project.root / each)) for each in project.settings.lint.further]
    return tuple(each.relative_to(here) if each.is_relative_to(here) else each for each in placed)


def _no_further(project: Project) -> Refusal | None:
    """Refuse the first further source (`with`) of a configuration that is not a file in the project."""
    for name, place in zip(project.settings.lint.further, _further(project), strict=True):
        edge = os.path.realpath(checkout_of(project.file or project.root) or project.root)
        if not lies_in(os.path.realpath(place), edge):
            help = "`--with` on the command line takes any source"
            return misconfigured(shown(str(project.file)), f"`{name}` in `with` lies outside the project", help)
        if not place.is_file():
            problem = "is a folder" if place.is_dir() else "is not a file" if lexists(place) else "does not exist"
            help = "accepted: a list of sources (.rts)"
            return misconfigured(shown(str(project.file)), f"`{name}` in `with` {problem}", help)
    return None


def _caches(files: Sequence[tuple[Path, Project]], *, fresh: bool) -> dict[Path, LintCache]:
    """Return the cache of each file, one a project, unless the configuration turns the cache off."""
    opened: dict[Path, LintCache] = {}
    found: dict[Path, LintCache] = {}
    user = cache_folder()
    for path, project in files:
        if project.settings.lint.cache:
            if project.root not in opened:
                opened[project.root] = LintCache(user, project.root, fresh=fresh)
            found[path] = opened[project.root]
    return found
