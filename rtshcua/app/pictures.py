"""Pictures and pages of checked missions: where they may be written, and writing them."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from rtshcua.app.files import PAGES, PICTURES, overwriting_a_source, overwriting_another
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal

if TYPE_CHECKING:
    from rtshcua.ground.report.mission_maps import CheckedMissions

#: stands for standard output
STANDARD_OUTPUT: Final = Path("-")
_SUFFIX: Final = ".svg"


class DrawnMissions(NamedTuple):
    """A page or a picture: where it is written, its text, and the number of its missions."""

    path: Path
    text: str
    missions: int


def unfit_picture(target: Path, files: Iterable[str | Path], *, as_json: bool) -> Refusal | None:
    """The refusal if no picture can be written to `target`. `as_json` means that standard output has an object."""
    if target == STANDARD_OUTPUT:
        help = "name a file for the picture"
        text = "`--picture -` and `--json` both need standard output"
        return Refusal("usage", text, help) if as_json else None
    if target.suffix.lower() != _SUFFIX:
        help = f"accepted: a file whose name ends in `{_SUFFIX}`, or `-` for standard output"
        return Refusal("usage", f"`{target}` in `--picture` is not the name of an SVG file", help)
    return unfit_place(target, files, "a picture", PICTURES)


def unfit_place(
    target: Path, files: Iterable[str | Path], what: str, begins: tuple[bytes, ...] = PAGES
) -> Refusal | None:
    """The refusal if no page or picture (`what`) can be written to `target`."""
    if not target.parent.is_dir():
        return Refusal("output", f"there is no folder `{target.parent}` to write to", code=ExitCode.INPUT)
    if target.exists() and not target.is_file():
        return Refusal("output", f"`{target}` is not a regular file, and is not overwritten by {what}")
    return overwriting_a_source(target, files, what) or overwriting_another(target, begins, what)


def write_page(target: Path, checked: Sequence["CheckedMissions"], sources: Iterable[str]) -> DrawnMissions | Refusal:
    """Write the page of `--map`, unless that would replace an imported source. Raises OSError."""
    from rtshcua.ground.report.mission_maps import mission_map_page

    return _written(target, mission_map_page(checked), checked, sources, "a page")


def write_picture(
    target: Path, checked: Sequence["CheckedMissions"], sources: Iterable[str]
) -> DrawnMissions | Refusal:
    """Write the picture of `--picture`, unless that would replace an imported source; for standard output make only its
    text. Raises OSError.
    """
    from rtshcua.ground.report.mission_maps import mission_picture

    return _written(target, mission_picture(checked), checked, sources, "a picture")


def _written(
    target: Path, text: str, checked: Sequence["CheckedMissions"], sources: Iterable[str], what: str
) -> DrawnMissions | Refusal:
    if target != STANDARD_OUTPUT:
        from rtshcua.adapters.store.writing import replace_inside  # plain checks start without it

        imported = overwriting_a_source(target, sources, what)
        if imported is not None:
            return imported
        replace_inside(target, text.encode("utf-8"))
    return DrawnMissions(target, text, sum(each.count for each in checked))
