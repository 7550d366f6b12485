"""ESRI ASCII grids (`.asc`) in degrees: a header of names and numbers, then the heights of all cells from the north-west corner on."""

import re
from io import BytesIO
from math import ceil, isfinite
from typing import Final

import numpy as np

from dyknow.navigation.geodesy import metres_per_degree
from dyknow.navigation.terrain.grid import HIGHEST_M, LOWEST_M, VOID, Floats, HeightGrid, unreadable

MOST_BYTES: Final = 256 * 2**20
FINEST_M: Final = 10.0
"""Of a finer grid the highest heights are kept, at posts so far apart."""
_MOST_CELLS: Final = 100_000_000
_WIDEST_DEG: Final = 0.01
_USUAL_VOID: Final = -9999.0
_KEYS: Final = frozenset(
    {"ncols", "nrows", "xllcorner", "xllcenter", "yllcorner", "yllcenter", "cellsize", "dx", "dy", "nodata_value"}
)
_LONGEST_LINE: Final = 1024
_WANTED: Final = "an ESRI ASCII grid is wanted, as gdal_translate -of AAIGrid writes it"
_AGAIN: Final = "it is cut or damaged; fetch it again"
_DEGREES: Final = "bring it to degrees: gdalwarp -t_srs EPSG:4326 -r bilinear IN OUT.tif && gdal_translate -of AAIGrid OUT.tif OUT.asc"


def read_ascii_grid(data: bytes) -> HeightGrid:
    """The grid of a text; raises DecodeError with cause and remedy."""
    header, at = _header(data)
    columns, rows = _count(header, "ncols"), _count(header, "nrows")
    if columns * rows > _MOST_CELLS:
        raise unreadable(f"it has {columns} x {rows} cells", f"at most {_MOST_CELLS} are read; cut the grid")
    if 2 * columns * rows > len(data) - at + 1:
        raise unreadable(f"its header has {columns} x {rows} cells, and the text is too short for them", _AGAIN)
    wide, high = _size(header, "dx"), _size(header, "dy")
    west, south = _first(header, "x", wide), _first(header, "y", high)
    east, north = west + wide * (columns - 1), south + high * (rows - 1)
    if not (-181.0 <= west <= 181.0 and east <= west + 361.0 and -91.0 <= south <= north <= 91.0):
        raise unreadable(f"x from {west:g} to {east:g}, y from {south:g} to {north:g} are no degrees", _DEGREES)
    heights = _heights(data[at:], rows, columns, header.get("nodata_value", _USUAL_VOID))
    return _coarser(HeightGrid(north, west, high, wide, heights.astype(np.float32)))


def _header(data: bytes) -> tuple[dict[str, float], int]:
    """Names and numbers of the header, and where the heights begin."""
    found: dict[str, float] = {}
    text = BytesIO(data)
    while True:
        begin, (name, *values) = text.tell(), text.readline(_LONGEST_LINE).decode("latin-1").lower().split() or [""]
        if name not in _KEYS:
            return found, begin
        try:
            [found[name]] = map(float, values)
        except ValueError:
            raise unreadable(f"header: {name} is no number", _WANTED) from None
        if name != "nodata_value" and not isfinite(found[name]):
            raise unreadable(f"header: {name} is {found[name]:g}", _WANTED)


def _value(header: dict[str, float], name: str) -> float:
    if name not in header:
        raise unreadable(f"its header has no {name}", _WANTED)
    return header[name]


def _count(header: dict[str, float], name: str) -> int:
    value = _value(header, name)
    if value != int(value) or value < 2:
        raise unreadable(f"header: {name} is {value:g}", "a grid has at least 2 rows and 2 cells in each")
    return int(value)


def _size(header: dict[str, float], name: str) -> float:
    value = header[name] if name in header else _value(header, "cellsize")
    if not 1e-6 <= value <= _WIDEST_DEG:
        raise unreadable(f"header: cells of {value:g} are no degrees from 0.000001 to {_WIDEST_DEG:g}", _DEGREES)
    return value


def _first(header: dict[str, float], axis: str, size: float) -> float:
    """Where the middle of the first cell is."""
    centre = header.get(f"{axis}llcenter")
    return _value(header, f"{axis}llcorner") + size / 2.0 if centre is None else centre


def _heights(body: bytes, rows: int, columns: int, void: float) -> Floats:
    numbers = _numbers(body, rows * columns)
    if len(numbers) != rows * columns:
        at = f"row {len(numbers) // columns + 1}, column {len(numbers) % columns + 1}"
        if len(numbers) > rows * columns:
            raise unreadable(f"it has more than {rows} x {columns} heights", "its header is that of another grid")
        raise unreadable(f"{at}: there is no number", _AGAIN)
    is_void = np.isnan(numbers) if void != void else numbers == np.float64(void)  # noqa: PLR0124  (NaN is not itself)
    wrong = ~is_void & ~((numbers >= LOWEST_M) & (numbers <= HIGHEST_M))
    if wrong.any():
        at_row, at_column = divmod(int(wrong.argmax()), columns)
        number = numbers[at_row * columns + at_column]
        raise unreadable(
            f"row {at_row + 1}, column {at_column + 1}: {number:g} m is no height of ground",
            "heights are metres; name what stands for no height as NODATA_value",
        )
    numbers[is_void] = VOID
    return numbers.reshape(rows, columns)


def _numbers(body: bytes, most: int) -> Floats:
    """The numbers of a text up to the first word that is none, one more than `most` at most."""
    try:
        found: Floats = np.fromstring(body, dtype=np.float64, sep=" ")
    except ValueError:
        return np.zeros(next(at for at, word in enumerate(re.finditer(rb"\S+", body)) if not _is_number(word[0])))
    return found[: most + 1]


def _is_number(word: bytes) -> bool:
    try:
        return bool(len(np.fromstring(word, sep=" ")))
    except ValueError:
        return False


def _coarser(grid: HeightGrid) -> HeightGrid:
    """A grid whose posts are at least some metres apart; each has the highest height of all posts up to the next ones."""
    north_m, east_m = metres_per_degree(grid.north_deg)
    down = max(1, ceil(FINEST_M / (grid.latitude_step_deg * north_m) - 0.5))
    right = max(1, ceil(FINEST_M / (grid.longitude_step_deg * east_m) - 0.5))
    if down == right == 1:
        return grid
    from scipy.ndimage import maximum_filter

    rows, columns = (
        -(-(size - 1) // step) * step + 1 for size, step in zip(grid.heights.shape, (down, right), strict=True)
    )
    padded = np.pad(
        grid.heights, ((0, rows - grid.heights.shape[0]), (0, columns - grid.heights.shape[1])), mode="edge"
    )
    highest = maximum_filter(padded, size=(2 * down + 1, 2 * right + 1), mode="nearest")[::down, ::right]
    return HeightGrid(
        grid.north_deg, grid.west_deg, grid.latitude_step_deg * down, grid.longitude_step_deg * right,
        np.ascontiguousarray(highest),
    )  # fmt: skip
