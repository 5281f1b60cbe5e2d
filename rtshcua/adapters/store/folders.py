"""The folders in which this program keeps its user's files."""

import os
from pathlib import Path

import platformdirs


def data_folder() -> Path:
    """The user's data folder; RTSHCUA_DATA_DIR overrides it."""
    chosen = os.environ.get("RTSHCUA_DATA_DIR")
    return Path(chosen) if chosen else platformdirs.user_data_path("rtshcua", appauthor=False)


def cache_folder() -> Path:
    """The user's cache folder (on Linux below XDG_CACHE_HOME), for files that may be deleted at any time."""
    chosen = os.environ.get("RTSHCUA_DATA_DIR")
    return Path(chosen) / "cache" if chosen else platformdirs.user_cache_path("rtshcua", appauthor=False)


def state_folder() -> Path:
    """The folder of the replay state, unless `--state-dir` sets another."""
    return data_folder() / "state"
