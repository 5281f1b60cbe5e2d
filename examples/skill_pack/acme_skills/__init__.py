"""A pack of skills for rtshcua: its folder is what `acme:` in an import stands for."""

from pathlib import Path


def folder() -> Path:
    """Return the folder of the sources."""
    return Path(__file__).with_name("sources")
