"""The files of a flight's images, and `geo.txt`, read by a parser that is written from OpenDroneMap's page alone."""

from typing import Any, NamedTuple

import pytest

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.image_records import ImageDetail
from rtshcua.ground.flight.export.geotag import exif_arguments, geo_txt, nadir_angles
from rtshcua.ground.flight.flight_images import FlightImage, NamedImage, named, natural

UTC, S = 1_700_000_000_000_000, 1_000_000


def image(index: int, **changed: Any) -> FlightImage:
    fields = dict[str, Any](
        above_home_mm=20_000, above_sea_mm=508_123, asked=0, attitude="camera", camera=100, file=f"IMG_{index}.JPG",
        horizontal_mm=900, index=index, latitude=473_977_400 + index, longitude=85_455_900, pitch_cd=-9_000, result=1,
        roll_cd=-150, series=0, unit=0, utc_us=UTC + index * S, vertical_mm=1_780, yaw_cd=-9_000,
    )  # fmt: skip
    return FlightImage(10 + index, index * S, ImageDetail(**(fields | changed)))


def nameless(*indices: int, **changed: Any) -> list[FlightImage]:
    return [image(index, file="", **changed) for index in indices]


def pairs(found: object) -> dict[str, int | None]:
    assert not isinstance(found, Refusal), found
    assert isinstance(found, tuple)
    return {name: one.detail.index for name, one in found[0]}


def slug(found: object) -> str:
    assert isinstance(found, Refusal)
    return found.slug


class GeoEntry(NamedTuple):
    """A line of `geo.txt` as OpenDroneMap reads it."""

    x: float
    y: float
    z: float | None
    angles: tuple[float, ...]
    accuracies: tuple[float, ...]


def parsed(data: bytes) -> tuple[str, dict[str, GeoEntry]]:
    header, *lines = data.decode().strip().split("\n")
    entries = {}
    for line in lines:
        if line and not line.startswith("#"):
            name, *numbers = line.split()
            x, y, *rest = map(float, numbers)
            entries[name] = GeoEntry(x, y, rest[0] if rest else None, tuple(rest[1:4]), tuple(rest[4:6]))
    return header, entries


class _Export:
    def description(self, *more: str) -> tuple[str, ...]:
        return ("a mission\u202e".replace("\u202e", ""), *more)


def written(*images: NamedImage) -> tuple[str, dict[str, GeoEntry]]:
    return parsed(geo_txt(_Export(), images, "by hand"))  # type: ignore[arg-type]


def test_geo_txt_has_the_frame_of_reference_and_a_line_for_each_image() -> None:
    header, entries = written(NamedImage("a.jpg", image(0)), NamedImage("b.jpg", image(1, longitude=-85_455_900)))
    assert header == "EPSG:4326"
    assert entries["a.jpg"] == GeoEntry(8.54559, 47.39774, 508.123, (270.0, 0.0, -1.5), (0.9, 1.78))
    assert entries["b.jpg"][:2] == (-8.54559, 47.3977401)


@pytest.mark.parametrize(
    ("changed", "angles", "accuracies"),
    [
        ({"pitch_cd": 0}, (270.0, 90.0, -1.5), (0.9, 1.78)),
        ({"attitude": "vehicle", "pitch_cd": -300}, (270.0, -3.0, -1.5), (0.9, 1.78)),
        ({"yaw_cd": None}, (0.0, 0.0, 0.0), (0.9, 1.78)),
        ({"vertical_mm": None}, (270.0, 0.0, -1.5), ()),
    ],
)
def test_unknown_angles_are_zero_and_unknown_accuracies_are_left_out(
    changed: dict[str, Any], angles: tuple[float, ...], accuracies: tuple[float, ...]
) -> None:
    _, entries = written(NamedImage("a.jpg", image(0, **changed)))
    assert entries["a.jpg"][3:] == (angles, accuracies)
    assert (nadir_angles(image(0, **changed)) is None) == ("yaw_cd" in changed)


def test_names_are_those_in_the_records() -> None:
    images = [image(0), image(1), image(2)]
    assert pairs(named(images, None, {})) == {"IMG_0.JPG": 0, "IMG_1.JPG": 1, "IMG_2.JPG": 2}
    assert pairs(named(images, ["IMG_2.JPG", "IMG_0.JPG", "x.jpg"], {})) == {"IMG_0.JPG": 0, "IMG_2.JPG": 2}
    assert slug(named([image(0), image(1, file="")], None, {})) == "no-file-names"
    assert slug(named([image(0), image(1, file="IMG_0.JPG")], None, {})) == "no-file-names"


def test_files_are_matched_by_their_natural_order() -> None:
    files = ["DSC_10.JPG", "DSC_9.JPG", "DSC_100.JPG"]
    assert sorted(files, key=natural) == ["DSC_9.JPG", "DSC_10.JPG", "DSC_100.JPG"]
    assert pairs(named(nameless(0, 1, 4), files, {})) == {"DSC_9.JPG": 0, "DSC_10.JPG": 1, "DSC_100.JPG": 4}
    mixed = [*nameless(0, 1), *nameless(0, camera=101)]
    assert slug(named(mixed, files, {})) == "no-match"


def test_files_are_matched_by_time_with_any_offset_of_the_clock() -> None:
    images = nameless(0, 1, 3, 4, 9)
    ahead = 2 * 3_600 * S + 345_678
    times = {f"DSC_{n}.JPG": UTC + at * S + ahead for n, at in enumerate((0, 3, 9))}
    assert pairs(named(images, list(times), times)) == {"DSC_0.JPG": 0, "DSC_1.JPG": 3, "DSC_2.JPG": 9}
    assert slug(named(images, list(times), {})) == "no-match"
    whole = {name: at // S * S for name, at in times.items()}
    assert slug(named(images, list(whole), whole)) == "no-match", "whole seconds fit one later too"
    rare = [image(index, file="", utc_us=UTC + at * S) for index, at in enumerate((0, 5, 20, 40, 70))]
    found = {f"DSC_{n}.JPG": (UTC + at * S + ahead) // S * S for n, at in enumerate((0, 20, 70))}
    assert pairs(named(rare, list(found), found)) == {"DSC_0.JPG": 0, "DSC_1.JPG": 2, "DSC_2.JPG": 4}
    assert slug(named(images, [*times, "more.jpg"], times)) == "no-match", "a file has no time"


def test_times_that_fit_in_several_ways_match_nothing() -> None:
    images = nameless(*range(10))
    times = {f"DSC_{n}.JPG": UTC + n * S for n in range(8)}
    assert slug(named(images, list(times), times)) == "no-match"
    apart = nameless(0, 10, 20, 30)
    assert slug(named(apart, ["a.jpg", "b.jpg"], {"a.jpg": UTC, "b.jpg": UTC + 10 * S})) == "no-match"
    one = {"a.jpg": UTC, "b.jpg": UTC + 7 * S}
    assert slug(named(apart, list(one), one)) == "no-match", "they fit nowhere"


@pytest.mark.parametrize("name", ["a b.jpg", "#a.jpg", "a\tb.jpg", "a\nb.jpg", "a\udcff.jpg"])
def test_a_file_name_that_readers_would_misread_is_refused(name: str) -> None:
    assert slug(named(nameless(0), [name], {})) == "odd-name"


def test_exif_arguments_are_one_in_a_line(tmp_path: Any) -> None:
    south = image(1, latitude=-1, longitude=-85_455_900, above_sea_mm=-1_500, attitude="vehicle", utc_us=None)
    lines = exif_arguments(tmp_path, [NamedImage("a.jpg", image(0)), NamedImage("-b.jpg", south)], "origin")
    first, second = lines[: lines.index("-execute")], lines[lines.index("-execute") + 1 :]
    assert lines.count("-execute") == 1
    assert first[-1] == str(tmp_path / "a.jpg")
    assert second[-1] == str(tmp_path / "-b.jpg")
    assert all(each.startswith("/") for each in (first[-1], second[-1])), "no file looks like an option"
    assert {
        "-EXIF:GPSLatitude=47.3977400", "-EXIF:GPSLatitudeRef=N", "-EXIF:GPSLongitude=8.5455900",
        "-EXIF:GPSLongitudeRef=E", "-EXIF:GPSAltitude=508.123", "-EXIF:GPSAltitudeRef#=0",
        "-EXIF:GPSDateStamp=2023:11:14", "-EXIF:GPSTimeStamp=22:13:20.000000", "-EXIF:GPSImgDirection=270.00",
        "-EXIF:CameraElevationAngle=-90.00", "-EXIF:GPSHPositioningError=0.900", "-XMP-dc:Source=origin record 10",
    } <= set(first)  # fmt: skip
    assert {
        "-EXIF:GPSLatitude=0.0000001", "-EXIF:GPSLatitudeRef=S", "-EXIF:GPSLongitudeRef=W", "-EXIF:GPSAltitude=1.500",
        "-EXIF:GPSAltitudeRef#=1",
    } <= set(second)  # fmt: skip
    assert not any("Direction" in each or "Stamp" in each for each in second)
