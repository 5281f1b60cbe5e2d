"""Find the configuration for a file: the nearest one upwards, `rtshcua.toml` before `pyproject.toml`."""

from dataclasses import dataclass
from os.path import normpath, relpath
from pathlib import Path

from rtshcua.adapters.store.reading import read_regular
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.project.file_patterns import matches
from rtshcua.ground.project.project_settings import NAMES, SHARED, ProjectSettings, misconfigured, parse_settings

#: the limit for a configuration, which is a page or two
LARGEST = 1 << 20


@dataclass(frozen=True, slots=True)
class Project:
    """Settings, their file (None: the defaults), and the folder that their paths are relative to."""

    settings: ProjectSettings
    root: Path
    file: Path | None = None

    def excludes(self, path: Path, patterns: tuple[str, ...]) -> bool:
        """Whether one of these patterns of the configuration matches a file."""
        return any(self.means(pattern, path) for pattern in patterns)

    def means(self, pattern: str, path: Path) -> bool:
        """Whether a pattern of the configuration matches a file; never one outside of its folder."""
        place = Path(relpath(normpath(path.absolute()), self.root)).as_posix()
        return not place.startswith("../") and matches(pattern, place)


class Projects:
    """The configurations of a run: each file has the nearest one, unless one is set for all (`config`), or none is used
    (`isolated`). Results are cached by folder.
    """

    def __init__(self, config: Path | None = None, *, isolated: bool = False) -> None:
        self._given: Project | Refusal | None = None
        if config is not None:
            self._given = _read(config) or misconfigured(str(config), "no table `[tool.rtshcua]` in it")
        elif isolated:
            self._given = Project(ProjectSettings(), _absolute(Path()))
        self._by_folder: dict[Path, Project | Refusal] = {}

    def of(self, path: Path) -> Project | Refusal:
        """The configuration for a file or a folder."""
        if self._given is not None:
            return self._given
        place = _absolute(path)
        return self._of_folder(place if place.is_dir() else place.parent)

    def _of_folder(self, folder: Path) -> Project | Refusal:
        passed = []
        found: Project | Refusal | None = None
        for each in (folder, *folder.parents):
            found = self._by_folder.get(each) or _standing_in(each)
            passed.append(each)
            if found is not None:
                break
        found = found or Project(ProjectSettings(), _absolute(Path()))
        self._by_folder |= dict.fromkeys(passed, found)
        return found


def _standing_in(folder: Path) -> Project | Refusal | None:
    for name in NAMES:
        file = folder / name
        if file.is_file():
            found = _read(file)
            if found is not None:
                return found
    return None


def _read(file: Path) -> Project | Refusal | None:
    name = _shown(file)
    try:
        data = read_regular(file, LARGEST)
        text = data.decode("utf-8")
    except OSError as error:
        return misconfigured(name, f"cannot be read: {(error.strerror or 'unreadable').lower()}")
    except UnicodeDecodeError as error:
        return misconfigured(name, f"byte {error.start} is not UTF-8 text")
    if len(data) > LARGEST:
        return misconfigured(name, f"larger than {LARGEST >> 20} MiB, the limit for a configuration")
    found = parse_settings(text, name, shared=file.name == SHARED)
    return found if found is None or isinstance(found, Refusal) else Project(found, _absolute(file).parent, file)


def _absolute(path: Path) -> Path:
    return Path(normpath(path.absolute()))


def _shown(file: Path) -> str:
    place, here = _absolute(file), _absolute(Path())
    return (place.relative_to(here) if place.is_relative_to(here) else place).as_posix()
