"""Files of elevation: what is read, and the sentence for what is not."""

import re
from pathlib import Path

import numpy as np
import pytest

from dyknow.federation.members.clock import FederationClock
from dyknow.model.errors import WrongCall
from dyknow.runtime.clock import NodeClock
from dyknow.runtime.configuration import elevation_files
from dyknow.runtime.configuration.config import NodeConfig
from dyknow.runtime.configuration.elevation_files import read_elevation
from dyknow.runtime.vehicles import VehiclePorts
from tests.navigation.terrain.ground import tile_bytes

HEADER = "ncols 4\nnrows 3\nxllcorner 13.0\nyllcorner 55.0\ncellsize 0.001\nNODATA_value -9999\n"
ROWS = "1 2 3 4\n5 6 7 8\n9 10 11.5 -9999\n"


def slope(latitudes: np.ndarray, longitudes: np.ndarray) -> np.ndarray:
    return 1200.0 * (latitudes - 55.0) + 240.0 * (longitudes - 13.0)


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


@pytest.mark.parametrize("side", [1201, 3601])
@pytest.mark.parametrize("name", ["N55E013.hgt", "n55e013.HGT", "N55E013.SRTMGL1.hgt"])
def test_a_tile_of_1_or_3_arc_seconds_is_read_by_the_corner_in_its_name(tmp_path: Path, side: int, name: str) -> None:
    (tmp_path / name).write_bytes(tile_bytes(55, 13, slope, side))
    ground = read_elevation(tmp_path / name)
    assert ground.height_m(55.25, 13.5) == pytest.approx(420.0, abs=0.01)
    assert ground.height_m(56.0, 13.0) == 1200.0
    assert ground.height_m(54.99, 13.5) is None


def test_a_directory_of_tiles_is_one_elevation_and_read_again_only_when_it_changes(tmp_path: Path) -> None:
    for south in (55, 56):
        (tmp_path / f"N{south}E013.hgt").write_bytes(tile_bytes(south, 13, slope))
    written(tmp_path / "readme.txt", "no tile")
    ground = read_elevation(tmp_path)
    assert ground.height_m(56.5, 13.0) == 1800.0
    assert "2 tiles with posts 93 m apart" in str(ground)
    assert read_elevation(tmp_path) is ground
    (tmp_path / "N56E013.hgt").unlink()
    assert read_elevation(tmp_path).height_m(56.5, 13.0) is None


@pytest.mark.parametrize(
    "header",
    [
        HEADER,
        HEADER.replace("xllcorner 13.0", "XLLCENTER 13.0005").replace("yllcorner 55.0", "YLLCENTER 55.0005"),
        HEADER.replace("cellsize 0.001", "dx 0.001\ndy 0.001"),
        HEADER.replace("NODATA_value -9999\n", ""),
    ],
)
def test_an_ascii_grid_has_its_heights_in_the_middle_of_cells(tmp_path: Path, header: str) -> None:
    ground = read_elevation(written(tmp_path / "ground.asc", header + ROWS))
    assert ground.height_m(55.0005, 13.0005) == pytest.approx(9.0)
    assert ground.height_m(55.0025, 13.0035) == pytest.approx(4.0)
    assert ground.height_m(55.001, 13.001) == pytest.approx(7.5)
    assert ground.height_m(55.0005, 13.0035) is None
    assert ground.height_m(55.0004, 13.0005) is None


def test_no_data_may_be_no_number_and_rows_may_be_broken_anywhere(tmp_path: Path) -> None:
    text = HEADER.replace("-9999", "nan") + ROWS.replace("-9999", "NaN").replace("\n", " ").replace("5 6", "5\r\n6")
    ground = read_elevation(written(tmp_path / "ground.asc", text))
    assert ground.height_m(55.0005, 13.0035) is None
    assert ground.height_m(55.0005, 13.0005) == pytest.approx(9.0)


def test_a_platform_notes_the_ground_that_its_floor_is_above(tmp_path: Path) -> None:
    config = NodeConfig(unit="1", elevation=written(tmp_path / "ground.asc", HEADER + ROWS), floor_m=15.0)
    notes: list[str] = []
    clock = FederationClock()
    ports = VehiclePorts(config, clock, NodeClock(), lambda _report: None, lambda: None, note=notes.append)
    limits = ports.limits()
    assert limits.floor_m == 15.0
    assert limits.elevation is read_elevation(tmp_path / "ground.asc")
    (note,) = notes
    assert note.startswith("the floor of 15 m is above the ground, too: ")
    assert note.endswith("ground.asc: 1 grid with posts 111 m apart, 55.0005 to 55.0025 N, 13.0005 to 13.0035 E")


def rejected(path: Path) -> str:
    with pytest.raises(WrongCall) as wrong:
        read_elevation(path)
    text = str(wrong.value)
    assert text.startswith(f"--elevation: {path}"), text
    assert len(text) < 400
    return text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "its header has no ncols; an ESRI ASCII grid is wanted"),
        (HEADER.replace("cellsize 0.001\n", "") + ROWS, "its header has no cellsize"),
        (HEADER.replace("nrows 3", "nrows x") + ROWS, "header: nrows is no number"),
        (HEADER.replace("nrows 3", "nrows") + ROWS, "header: nrows is no number"),
        (HEADER.replace("nrows 3", "nrows 2.5") + ROWS, "header: nrows is 2.5; a grid has at least 2 rows"),
        (HEADER.replace("nrows 3", "nrows -3") + ROWS, "header: nrows is -3; a grid has"),
        (HEADER.replace("ncols 4", "ncols 1e9") + ROWS, "it has 1000000000 x 3 cells; at most"),
        (HEADER.replace("ncols 4", "ncols 1e400") + ROWS, "header: ncols is inf"),
        (HEADER.replace("ncols 4", "ncols 40000") + ROWS, "the text is too short for them; it is cut"),
        (HEADER.replace("0.001", "nan") + ROWS, "header: cellsize is nan"),
        (HEADER.replace("0.001", "30") + ROWS, "header: cells of 30 are no degrees.* gdalwarp -t_srs EPSG:4326"),
        (HEADER.replace("0.001", "-0.001") + ROWS, "header: cells of -0.001 are no degrees"),
        (HEADER.replace("13.0", "436000") + ROWS, r"x from 436000 to 436000, y from 55.* are no degrees; .*gdalwarp"),
        (HEADER.replace("55.0", "6180000") + ROWS, "are no degrees"),
        (
            HEADER + "100 200 300 400\n500 600 700 800\n900 950",
            "row 3, column 3: there is no number; it is cut or damaged",
        ),
        (HEADER + ROWS.replace("7", "7,5"), "row 2, column 3: there is no number"),
        (HEADER + ROWS.replace("7", "nan"), "row 2, column 3: nan m is no height of ground; .*NODATA_value"),
        (HEADER + ROWS.replace("7", "inf"), "row 2, column 3: inf m is no height"),
        (HEADER + ROWS.replace("7", "65535"), "row 2, column 3: 65535 m is no height"),
        (HEADER + ROWS + "12 13\n", "it has more than 3 x 4 heights; its header is that of another grid"),
    ],
)
def test_a_wrong_ascii_grid_is_an_error_with_place_cause_and_remedy(tmp_path: Path, text: str, words: str) -> None:
    assert re.search(words, rejected(written(tmp_path / "ground.asc", text)))


def test_a_wrong_tile_is_an_error_with_place_cause_and_remedy(tmp_path: Path) -> None:
    good = tile_bytes(55, 13, slope)
    path = tmp_path / "N55E013.hgt"
    for data in (good[:-1], good + b"\0\0", b"", b"\0" * 1000):
        path.write_bytes(data)
        assert "bytes, and this" in rejected(path) or "longer than" in rejected(path)
        assert rejected(path).endswith("fetch it again.")
    path.write_bytes(bytes(30_000_000))
    assert rejected(path).endswith("at most 25934402 are read; cut it to where the vehicle flies.")
    swapped = np.frombuffer(good, ">i2").astype("<i2").tobytes()
    path.write_bytes(swapped)
    assert "is no height of ground" in rejected(path)
    for name in ("tile.hgt", "N95E013.hgt", "N55E213.hgt", "N55E0133.hgt"):
        (tmp_path / name).write_bytes(good)
        assert "its name has no south-west corner" in rejected(tmp_path / name)


def test_what_is_no_elevation_is_named_with_what_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "has no tiles; tiles are files such as N55E013.hgt" in rejected(tmp_path)
    assert "gdal_translate -of AAIGrid IN.tif OUT.asc" in rejected(tmp_path / "ground.tif")
    assert "cannot be read (No such file" in rejected(tmp_path / "N55E013.hgt")
    assert "cannot be read" in rejected(Path("N55\0E013.hgt"))
    for south in (55, 56):
        (tmp_path / f"N{south}E013.hgt").write_bytes(tile_bytes(south, 13, slope))
    monkeypatch.setattr(elevation_files, "MOST_TOGETHER", 5_000_000)
    assert "its 2 tiles have 5 MB, and at most 4 are read" in rejected(tmp_path)
