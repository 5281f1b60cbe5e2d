"""Find the files that changed according to git: since this branch left another, or since the last commit."""

import os
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

#: seconds for one git command: the index may be a pipe, for which git waits
PATIENCE = 120.0
#: the environment variables of git that are kept: they serve whoever runs the command and start nothing; others select
#: a repository whatever the folder is, or name programs
_KEPT = frozenset(
    {
        "GIT_CEILING_DIRECTORIES",
        "GIT_DISCOVERY_ACROSS_FILESYSTEM",
        "GIT_CONFIG_NOSYSTEM",
        "GIT_CONFIG_GLOBAL",
        "GIT_CONFIG_SYSTEM",
    }
)
#: and those of a hook's repository, where no other is found
_TOLD = ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_PREFIX", "GIT_COMMON_DIR", "GIT_OBJECT_DIRECTORY")
#: The settings of a checkout may name programs. Those that git would run to find changes are off. Filters are found by
#: name and turned off one by one: see `_filters`.
_OFF = {
    "core.fsmonitor": "false",
    "core.hooksPath": os.devnull,
    "core.pager": "cat",
    "core.sshCommand": "false",
    "core.gitProxy": "false",
    "core.askPass": "false",
    "core.untrackedCache": "false",
    "credential.helper": "",
    "diff.external": "",
    "diff.submodule": "short",
    "protocol.allow": "never",
    "submodule.recurse": "false",
    "fetch.recurseSubmodules": "false",
    "gc.auto": "0",
    "maintenance.auto": "false",
    "log.showSignature": "false",
}
_QUIET = {
    "GIT_OPTIONAL_LOCKS": "0", "GIT_TERMINAL_PROMPT": "0", "GIT_NO_LAZY_FETCH": "1", "GIT_NO_REPLACE_OBJECTS": "1",
    "GIT_PAGER": "cat", "GIT_ASKPASS": "false", "LC_ALL": "C",
}  # fmt: skip

#: the settings that turn a filter off
_NO_FILTER = {"required": "false"}

#: environment variables for git
_Around = tuple[tuple[str, str], ...]


class NoChanges(Exception):
    """The changed files cannot be found; `help` says what to do."""

    def __init__(self, message: str, help: str | None = None) -> None:
        super().__init__(message)
        self.help = help


class GitChanges(NamedTuple):
    """The changes in the repositories with the folders `tops`: files, deleted ones included, and whole folders, such as
    submodules and the targets of links to folders. All paths are absolute, with links resolved except in the last part.
    """

    files: frozenset[str]
    folders: tuple[str, ...]
    tops: tuple[str, ...]

    def touch(self, path: str) -> bool | None:
        """Whether a file has changed, under its own name or its target's; None outside of any repository."""
        folder, name = os.path.split(os.path.abspath(path))  # noqa: PTH100  a Path costs as much as the answer
        places = {os.path.join(os.path.realpath(folder), name), os.path.realpath(path)}  # noqa: PTH118
        if any(place in self.files or _is_below(place, self.folders) for place in places):
            return True
        return False if all(_is_below(place, self.tops) for place in places) else None


def changed_files(paths: Iterable[Path], base: str | None = None) -> GitChanges:
    """The changes since `base`, and files unknown to git, in the repositories of `paths`. With a `base`, they count
    from the commit at which this branch left it; without one, from the last commit. Raises NoChanges where there is no
    git, no such base, or a path outside of any repository.
    """
    tops = {top: None for asked in dict.fromkeys(map(_folders, paths)) for top in _tops(asked)}
    files: set[str] = set()
    folders: dict[str, None] = {}
    for top, around in tops:
        for name in _names(top, around, base):
            place = os.path.join(top, name.rstrip("/"))  # noqa: PTH118
            files.add(place)
            if os.path.isdir(place):  # noqa: PTH112
                folders[os.path.realpath(place)] = None
    return GitChanges(frozenset(files), tuple(folders), tuple(top for top, _ in tops))


def _names(top: str, around: _Around, base: str | None) -> list[str]:
    """The names of the changes in one repository, including those in its submodules."""
    since = "HEAD" if base is None else _merge_base(base, top, around)
    if _known(since, top, around):
        words = (
            "diff",
            "--no-ext-diff",
            "--no-textconv",
            "--name-only",
            "--no-renames",
            "--ignore-submodules=none",
            "--no-relative",
            "-z",
            since,
            "--",
        )
        names = _git(*words, folder=top, around=around)
    else:  # before the first commit all files are new
        names = _git("ls-files", "-z", folder=top, around=around)
    names += _git("ls-files", "--others", "--exclude-standard", "-z", folder=top, around=around)
    return [os.fsdecode(name) for name in names.split(b"\0") if name]


def checkout_commit(folder: Path) -> str | None:
    """The commit of a checkout, `-dirty` appended if it has changes; None where the folder is no checkout's top, or git
    cannot tell.
    """
    try:
        top, around = _top(os.path.realpath(folder))
        if top != os.path.realpath(folder):
            return None
        said = _git("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*", folder=top, around=around)
    except NoChanges:
        return None
    return said.decode().strip()


def _folders(path: Path) -> tuple[str, ...]:
    """The folders to ask about a path: itself or its nearest existing parent, and the same for its target."""
    found: dict[str, None] = {}
    for place in (Path(os.path.realpath(path.parent), path.name), Path(os.path.realpath(path))):
        above = next(each for each in (place, *place.parents) if each.is_dir())
        found[os.path.realpath(above)] = None
    return tuple(found)


def _tops(folders: tuple[str, ...]) -> list[tuple[str, _Around]]:
    """The repositories of a path's folders. Raises NoChanges where there is none."""
    found, missing = [], None
    for folder in folders:
        try:
            found.append(_top(folder))
        except NoChanges as error:
            missing = missing or error
    if missing is not None and not found:
        raise missing
    return found


def _top(folder: str) -> tuple[str, _Around]:
    """The top of a folder's repository, and the environment for git in it."""
    above = [Path(folder), *Path(folder).parents]
    here = any((each / ".git").exists() for each in above)
    kept = _KEPT if here else _KEPT.union(_TOLD)
    around = tuple((name, value) for name, value in os.environ.items() if not name.startswith("GIT_") or name in kept)
    said = _git("rev-parse", "--show-toplevel", folder=folder, around=around)
    around = (*around, *_filters(folder, around))
    return os.path.realpath(os.fsdecode(said.removesuffix(b"\n"))), around


def _filters(folder: str, around: _Around) -> _Around:
    """Turn off a repository's content filters, by settings in the environment."""
    try:
        named = _git("config", "--null", "--name-only", "--get-regexp", r"^filter\..*", folder=folder, around=around)
    except NoChanges:  # there are none
        return ()
    off = [(os.fsdecode(name), _NO_FILTER.get(os.fsdecode(name).rpartition(".")[2], "")) for name in named.split(b"\0")]
    off = [(name, value) for name, value in off if name]
    numbered = [(number, *each) for number, each in enumerate(off)]
    keys = [(f"GIT_CONFIG_KEY_{number}", name) for number, name, _ in numbered]
    values = [(f"GIT_CONFIG_VALUE_{number}", value) for number, _, value in numbered]
    return (("GIT_CONFIG_COUNT", str(len(off))), *keys, *values)


def _is_below(place: str, folders: tuple[str, ...]) -> bool:
    return any(place.startswith(f"{folder.rstrip(os.sep)}{os.sep}") for folder in folders)


def _merge_base(base: str, top: str, around: _Around) -> str:
    if base.startswith("-") or not _known(base, top, around):
        raise NoChanges(f"git does not know `{base}`", "fetch it first: a shallow clone has only the last commit")
    try:
        return os.fsdecode(_git("merge-base", base, "HEAD", folder=top, around=around).strip())
    except NoChanges:
        raise NoChanges(
            f"`{base}` and the current commit have no common ancestor",
            "fetch the history in between: a shallow clone has only the last commit",
        ) from None


def _known(name: str, top: str, around: _Around) -> bool:
    try:
        _git("rev-parse", "--verify", "--quiet", "--end-of-options", f"{name}^{{commit}}", folder=top, around=around)
    except NoChanges:
        return False
    return True


def _git(*words: str, folder: str, around: _Around) -> bytes:
    settings = [word for name, value in _OFF.items() for word in ("-c", f"{name}={value}")]
    command = ["git", *settings, "-C", folder, *words]
    env = {**dict(around), **_QUIET}
    try:
        done = subprocess.run(
            command, capture_output=True, check=False, stdin=subprocess.DEVNULL, env=env, timeout=PATIENCE
        )
    except subprocess.TimeoutExpired:
        raise NoChanges(f"git was silent about `{folder}` for {PATIENCE:g} s", "name the files instead") from None
    except FileNotFoundError:
        raise NoChanges("`git`, which knows the changes, is not installed", "install it, or name the files") from None
    except OSError as error:
        raise NoChanges(f"git cannot be started: {(error.strerror or str(error)).lower()}") from None
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        words_ = said[-1].removeprefix("fatal: ") if said else "it gave no reason"
        if "dubious ownership" in done.stderr.decode(errors="replace"):
            raise NoChanges(
                f"`{folder}` is in a git repository of another user, which git refuses to read",
                "name the files instead; for a repository that you trust, set git's `safe.directory`",
            )
        if "not a git repository" in words_:
            raise NoChanges(
                f"`{folder}` is not in a git repository, so the changed files are not known",
                "name the files instead",
            )
        raise NoChanges(f"git could not list the changed files: {words_}")
    return done.stdout
