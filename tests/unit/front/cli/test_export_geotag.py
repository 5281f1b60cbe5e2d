"""`rtshcua export --to geotag`: names of files, ExifTool and its absence, refusals."""

import json
import os
import shutil
import subprocess
from base64 import b64decode
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from reference.forgery import read
from reference.imaged_flight import MISSING, flown, run_in
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app

#: a JPEG image of one pixel
JPEG = b64decode(
    "/9j/4AAQSkZJRgABAQEASABIAAD/2wBDAP//////////////////////////////////////////////////////////////////////////////"
    "////////wgALCAABAAEBAREA/8QAFBABAAAAAAAAAAAAAAAAAAAAAP/aAAgBAQABPxA="
)
FAKE = """#!/bin/sh
printf '%s\\n' "$#" "$@" > "$RECORD/argv"
cat > "$RECORD/arguments"
for each in $(grep -c '^/' "$RECORD/arguments"); do
  n=0; while [ "$n" -lt "$each" ]; do echo "    1 image files updated"; n=$((n + 1)); done
done
exit "${ENDS:-0}"
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", "/nowhere")
    run_in(Path("runs", "imaged"))
    return tmp_path


def export(*words: object) -> int:
    return app.main(["export", "runs/imaged", "--to", "geotag", *map(str, words)])


def images() -> list[dict[str, Any]]:
    records = [read(line) for line in flown()]
    found = [json.loads(each["detail"]) for each in records if each.get("event") == "image"]
    return sorted((each for each in found if each["index"] is not None), key=lambda each: each["index"])


def folder(*, without: int = 0, name: str = "DSC_{}.JPG") -> Path:
    made = Path("pictures")
    made.mkdir()
    for each in images()[: len(images()) - without]:
        (made / name.format(each["index"])).write_bytes(JPEG)
    (made / "notes.md").write_text("no image")
    return made


@pytest.fixture
def fake(here: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A program of ExifTool's name that records how it was called."""
    program = here / "bin" / "exiftool"
    program.parent.mkdir()
    program.write_text(FAKE)
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}/usr/bin{os.pathsep}/bin")
    monkeypatch.setenv("RECORD", str(here))
    return here


def test_geo_txt_names_the_recorded_files_and_what_is_missing(capsys: pytest.CaptureFixture[str]) -> None:
    assert export("-o", "geo.txt") == ExitCode.OK
    said = capsys.readouterr()
    lines = Path("geo.txt").read_text().splitlines()
    assert lines[0] == "EPSG:4326"
    entries = {line.split()[0]: line.split()[1:] for line in lines[1:] if not line.startswith("#")}
    assert list(entries) == [each["file"] for each in images()]
    first = images()[0]
    assert [float(each) for each in entries[first["file"]][:3]] == [
        first["longitude"] / 1e7, first["latitude"] / 1e7, first["above_sea_mm"] / 1e3
    ]  # fmt: skip
    assert f"wrote `geo.txt`: {len(images())} images" in said.out
    assert "warning: 1 image of the flight missing" in said.err
    assert "failed" in said.err
    assert MISSING not in {each["index"] for each in images()}


def test_files_of_a_folder_are_matched_by_order(capsys: pytest.CaptureFixture[str]) -> None:
    folder()
    assert export("--images", "pictures", "-o", "geo.txt", "--json") == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["points"] == len(images())
    names = [line.split()[0] for line in Path("geo.txt").read_text().splitlines()[1:] if not line.startswith("#")]
    assert names == [f"DSC_{each['index']}.JPG" for each in images()]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--tag"], "`--tag` needs the files"),
        (["--images", "nowhere"], "`nowhere` is not a folder"),
        (["--images", "pictures", "--tag"], "needs ExifTool, which is not installed"),
        (["--images", "few"], "the folder has 1 image and the log"),
        (["--images", "odd"], "the folder has 0 images"),
    ],
)
def test_refusals(words: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    folder()
    Path("few").mkdir()
    Path("few", "a.jpg").write_bytes(JPEG)
    Path("odd").mkdir()
    Path("odd", "a.jpg").symlink_to(Path("few", "a.jpg").absolute())
    assert export(*words, "-o", "geo.txt") in (ExitCode.USAGE, ExitCode.INPUT)
    said = capsys.readouterr().err
    assert says in " ".join(said.split())
    assert not Path("geo.txt").exists()


def test_options_of_geotag_are_refused_for_another_format(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["export", "runs/imaged", "--to", "plan", "--tag", "-o", "x.plan"]) == ExitCode.USAGE
    assert "are for `--to geotag`" in capsys.readouterr().err


def test_exiftool_is_called_without_a_shell_and_without_configuration(fake: Path) -> None:
    folder(name="$(touch x){}.JPG".replace(" ", "_"))
    assert export("--images", "pictures", "--tag", "-o", "geo.txt") == ExitCode.OK
    count, *argv = (fake / "argv").read_text().split("\n")[:-1]
    assert (count, argv) == ("4", ["-config", "", "-@", "-"])
    lines = (fake / "arguments").read_text().splitlines()
    files = [line for line in lines if line.startswith("/")]
    assert files == [str(fake / "pictures" / f"$(touch_x){each['index']}.JPG") for each in images()]
    assert lines.count("-execute") == len(files) - 1


@pytest.mark.parametrize("without", [0, 1])
def test_names_that_are_not_utf_8_are_refused(
    without: int, fake: Path, capsys: pytest.CaptureFixture[str]
) -> None:  # fmt: skip
    folder(without=without, name=os.fsdecode(b"\xff{}.JPG"))
    assert export("--images", "pictures", "--tag", "-o", "geo.txt") == ExitCode.INPUT
    said = " ".join(capsys.readouterr().err.split())
    assert "is not UTF-8" in said or "neither names nor times tell" in said
    assert not Path("geo.txt").exists()


def test_a_failure_of_exiftool_is_told(
    fake: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder()
    monkeypatch.setenv("ENDS", "1")
    assert export("--images", "pictures", "--tag", "-o", "geo.txt") == ExitCode.INPUT
    assert "ExifTool failed" in capsys.readouterr().err
    assert not Path("geo.txt").exists()


@pytest.mark.clients
@pytest.mark.skipif(shutil.which("exiftool", path=os.defpath) is None, reason="ExifTool is not installed")
def test_exiftool_writes_what_it_reads_back(monkeypatch: pytest.MonkeyPatch) -> None:
    program = shutil.which("exiftool", path=os.defpath)
    assert program is not None
    monkeypatch.setenv("PATH", os.defpath)
    made = folder()
    assert export("--images", "pictures", "--tag", "-o", "geo.txt") == ExitCode.OK
    files = sorted(made.glob("*.JPG"), key=lambda each: int(each.stem.split("_")[1]))
    told = json.loads(subprocess.run([program, "-n", "-j", *files], capture_output=True, check=True).stdout)
    for one, image in zip(told, images(), strict=True):
        assert one["GPSLatitude"] == pytest.approx(image["latitude"] / 1e7, abs=1e-7)
        assert one["GPSLongitude"] == pytest.approx(image["longitude"] / 1e7, abs=1e-7)
        assert one["GPSAltitude"] == pytest.approx(image["above_sea_mm"] / 1e3, abs=1e-3)
        assert one["GPSImgDirection"] == pytest.approx(image["yaw_cd"] / 100 % 360, abs=0.01)
        assert one["CameraElevationAngle"] == pytest.approx(image["pitch_cd"] / 100, abs=0.01)
        assert "record" in one["Source"]
    assert len(list(made.glob("*_original"))) == len(images())


@pytest.mark.clients
@pytest.mark.skipif(shutil.which("exiftool", path=os.defpath) is None, reason="ExifTool is not installed")
def test_exiftool_reads_the_times_that_tell_which_files_are_there(monkeypatch: pytest.MonkeyPatch) -> None:
    program = shutil.which("exiftool", path=os.defpath)
    assert program is not None
    monkeypatch.setenv("PATH", os.defpath)
    made, kept = folder(name="DSC_{}.JPG"), [each["index"] for each in images() if each["index"] not in (6, 20)]
    lines: list[str] = []
    for each in images():
        file = made / f"DSC_{each['index']}.JPG"
        if each["index"] not in kept:
            file.unlink()
            continue
        moment = datetime.fromtimestamp(each["utc_us"] / 1e6 + 7_200, UTC)
        lines += [f"-DateTimeOriginal={moment:%Y:%m:%d %H:%M:%S}", f"-SubSecTimeOriginal={moment:%f}"]
        lines += ["-overwrite_original", str(file), "-execute"]
    subprocess.run([program, "-@", "-"], input="\n".join(lines[:-1]).encode(), capture_output=True, check=True)
    assert export("--images", "pictures", "-o", "geo.txt") == ExitCode.OK
    lines = [line.split() for line in Path("geo.txt").read_text().splitlines() if line.startswith("DSC_")]
    assert [line[0] for line in lines] == [f"DSC_{index}.JPG" for index in kept]
    places = {each["index"]: each["longitude"] for each in images()}
    assert [round(float(line[1]) * 1e7) for line in lines] == [places[index] for index in kept]
