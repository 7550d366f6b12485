"""Files of elevation, as options and settings name them: a tile, a directory of tiles, or an ASCII grid."""

from functools import lru_cache
from pathlib import Path
from typing import Final

from dyknow.model.errors import DecodeError, WrongCall
from dyknow.navigation.terrain.ascii_grid import MOST_BYTES, read_ascii_grid
from dyknow.navigation.terrain.elevation import Elevation
from dyknow.navigation.terrain.grid import HeightGrid
from dyknow.navigation.terrain.tiles import SIDES, read_tile
from dyknow.proxies.files.named_files import bounded_bytes

MOST_TOGETHER: Final = 512 * 2**20
"""Bytes of all tiles of a directory: they are kept in memory."""
_TILE, _GRID = ".hgt", ".asc"


def read_elevation(path: Path) -> Elevation:
    """The elevation in a file or directory; the same one for an unchanged file. Raises WrongCall."""
    try:
        files = _files(path)
        states = tuple((file, (state := file.stat()).st_mtime_ns, state.st_size) for file in files)
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None
    together = sum(size for *_, size in states)
    if len(files) > 1 and together > MOST_TOGETHER:
        raise WrongCall(
            f"--elevation: {path}: its {len(files)} tiles have {together >> 20} MB, and at most {MOST_TOGETHER >> 20} are read; "
            "keep those of where the vehicle flies in a directory of their own."
        )
    return _read(str(path), states)


@lru_cache(maxsize=2)
def _read(name: str, states: tuple[tuple[Path, int, int], ...]) -> Elevation:
    return Elevation([_grid(file, size) for file, _, size in states], name)


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        found = sorted(file for file in path.iterdir() if file.suffix.lower() == _TILE)
        if not found:
            raise WrongCall(
                f"--elevation: {path} has no tiles; tiles are files such as N55E013.hgt. Name an ASCII grid (.asc) itself."
            )
        return found
    if path.suffix.lower() not in {_TILE, _GRID}:
        raise WrongCall(
            f"--elevation: {path} is no elevation that is read; tiles (.hgt), a directory of them and ESRI ASCII grids "
            "(.asc) are. A GeoTIFF becomes one by gdal_translate -of AAIGrid IN.tif OUT.asc."
        )
    return [path]


def _grid(file: Path, size: int) -> HeightGrid:
    """Raises WrongCall."""
    is_tile = file.suffix.lower() == _TILE
    most = 2 * max(SIDES) ** 2 if is_tile else MOST_BYTES
    if size > most:
        raise WrongCall(
            f"--elevation: {file} has {size} bytes, and at most {most} are read; cut it to where the vehicle flies."
        )
    try:
        data = bounded_bytes(file, most)
        return read_tile(file.name, data) if is_tile else read_ascii_grid(data)
    except OSError as error:
        raise _unreadable(file, error) from None
    except DecodeError as wrong:
        raise WrongCall(f"--elevation: {file}: {wrong}.") from None


def _unreadable(path: Path, error: OSError | ValueError) -> WrongCall:
    return WrongCall(
        f"--elevation: {path} cannot be read ({getattr(error, 'strerror', error)}); it is a tile such as N55E013.hgt, a directory of them, "
        "or an ESRI ASCII grid (.asc)."
    )
