"""The places of a flight's images as `geo.txt`, which WebODM and OpenDroneMap read beside the images
(https://docs.opendronemap.org/geo/), and as arguments of ExifTool, which writes them into the files.

Angles of `geo.txt` are those of OpenDroneMap: yaw of the image's top from north, pitch 0 straight down and 90 forward.
The attitude of a vehicle, where the camera's is not known, counts as that of a camera that looks down.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from rtshcua.ground.flight.export.exported import (
    DEGREES,
    HEADING,
    METRES,
    FlightExport,
    decimal,
    utc_text,
)
from rtshcua.ground.flight.flight_images import FlightImage, NamedImage

DATUM: Final = "above mean sea level as the camera reported it"
#: longitude before latitude, as the columns x and y
_HEADER: Final = "EPSG:4326"
_COLUMNS: Final = "name longitude latitude height yaw pitch roll horizontal_accuracy vertical_accuracy"
_FULL_TURN, _FORWARD = 36_000, 9_000  # 1/100 degree


def geo_txt(export: FlightExport, images: Sequence[NamedImage], how: str) -> bytes:
    """The file; the first line names the frame of reference, lines with `#` are comments."""
    about = export.description(f"degrees and metres: {_COLUMNS}", f"heights: {DATUM}", f"files matched {how}")
    lines = [_HEADER, *(f"# {each}" for each in about)]
    for name, image in images:
        lines.append(" ".join((name, *_values(image))))
    return "\n".join([*lines, ""]).encode()


def _values(image: FlightImage) -> Iterator[str]:
    detail = image.detail
    yield decimal(detail.longitude or 0, DEGREES)
    yield decimal(detail.latitude or 0, DEGREES)
    yield decimal(detail.above_sea_mm or 0, METRES)
    yield from (decimal(each, HEADING) for each in nadir_angles(image) or (0, 0, 0))
    if detail.horizontal_mm is not None and detail.vertical_mm is not None:
        yield decimal(detail.horizontal_mm, METRES)
        yield decimal(detail.vertical_mm, METRES)


def nadir_angles(image: FlightImage) -> tuple[int, int, int] | None:
    """Yaw, pitch (0 straight down) and roll of an image in 1/100 degree; None if unknown."""
    detail = image.detail
    yaw, pitch, roll = detail.yaw_cd, detail.pitch_cd, detail.roll_cd
    if yaw is None or pitch is None or roll is None:
        return None
    return yaw % _FULL_TURN, pitch + (_FORWARD if detail.attitude == "camera" else 0), roll


def exif_arguments(folder: Path, images: Sequence[NamedImage], origin: str) -> list[str]:
    """The lines of an argument file for ExifTool: for each file its tags and its path, with `-execute` between. XMP
    names the record of the image in the log of this `origin`. ExifTool keeps each original as `NAME_original`.
    """
    lines: list[str] = []
    for name, image in images:
        lines += ["-execute"] if lines else []
        lines += [f"-{tag}={value}" for tag, value in _tags(image)]
        lines += [f"-XMP-dc:Source={origin} record {image.seq}", str(folder / name)]
    return lines


def _tags(image: FlightImage) -> Iterator[tuple[str, str]]:
    detail = image.detail
    latitude, longitude, height = detail.latitude or 0, detail.longitude or 0, detail.above_sea_mm or 0
    yield "EXIF:GPSLatitude", decimal(abs(latitude), DEGREES)
    yield "EXIF:GPSLatitudeRef", "S" if latitude < 0 else "N"
    yield "EXIF:GPSLongitude", decimal(abs(longitude), DEGREES)
    yield "EXIF:GPSLongitudeRef", "W" if longitude < 0 else "E"
    yield "EXIF:GPSAltitude", decimal(abs(height), METRES)
    yield "EXIF:GPSAltitudeRef#", "1" if height < 0 else "0"
    yield "EXIF:GPSMapDatum", "WGS-84"
    if detail.utc_us is not None:
        day, _, clock = utc_text(detail.utc_us).rstrip("Z").partition("T")
        yield "EXIF:GPSDateStamp", day.replace("-", ":")
        yield "EXIF:GPSTimeStamp", clock
    if detail.horizontal_mm is not None:
        yield "EXIF:GPSHPositioningError", decimal(detail.horizontal_mm, METRES)
    if detail.attitude == "camera" and detail.yaw_cd is not None and detail.pitch_cd is not None:
        yield "EXIF:GPSImgDirection", decimal(detail.yaw_cd % _FULL_TURN, HEADING)
        yield "EXIF:GPSImgDirectionRef", "T"
        yield "EXIF:CameraElevationAngle", decimal(detail.pitch_cd, HEADING)
