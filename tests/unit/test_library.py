"""Locating the library in every kind of installation."""

import importlib.util
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from rtshcua import library

Installed = Callable[[], Path]


@pytest.fixture
def installed(tmp_path: Path) -> Installed:
    """Load a copy of only `library.py` from `tmp_path/rtshcua`."""
    home = tmp_path / "rtshcua" / "library.py"
    home.parent.mkdir()
    shutil.copy(library.__file__, home)
    spec = importlib.util.spec_from_file_location("installed_library", home)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.root


def lay_out(place: Path, *folders: str) -> None:
    for folder in folders:
        (place / folder).mkdir(parents=True)


def test_checkout_or_editable_install(installed: Installed, tmp_path: Path) -> None:
    lay_out(tmp_path, *library.FOLDERS)
    assert installed() == tmp_path.resolve()


def test_wheel_takes_precedence_over_adjacent_files(installed: Installed, tmp_path: Path) -> None:
    lay_out(tmp_path, *library.FOLDERS)
    lay_out(tmp_path / "rtshcua/_library", *library.FOLDERS)
    assert installed() == (tmp_path / "rtshcua/_library").resolve()


@pytest.mark.parametrize("place", [".", "rtshcua/_library"])
def test_broken_installation_names_the_missing_files(installed: Installed, tmp_path: Path, place: str) -> None:
    lay_out(tmp_path / place, "grammar", "missions")
    with pytest.raises(FileNotFoundError) as caught:
        installed()
    assert "`skills/`, `policies/`" in caught.value.strerror
    assert caught.value.filename == str((tmp_path / place).resolve())


def test_this_installation_is_complete() -> None:
    assert all((library.root() / name).is_dir() for name in library.FOLDERS)
