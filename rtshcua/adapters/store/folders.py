"""Where this program keeps what belongs to its user."""

import os
from pathlib import Path

import platformdirs


def data_folder() -> Path:
    """The user's data folder; RTSHCUA_DATA_DIR overrides it."""
    chosen = os.environ.get("RTSHCUA_DATA_DIR")
    return Path(chosen) if chosen else platformdirs.user_data_path("rtshcua", appauthor=False)


def cache_folder() -> Path:
    """The user's cache folder (on Linux below XDG_CACHE_HOME), for what may be deleted at any time."""
    chosen = os.environ.get("RTSHCUA_DATA_DIR")
    return Path(chosen) / "cache" if chosen else platformdirs.user_cache_path("rtshcua", appauthor=False)


def state_folder() -> Path:
    """Where the replay state is kept, unless `--state-dir` says otherwise."""
    return data_folder() / "state"
