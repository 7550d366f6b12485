"""Tiles of SRTM and NASADEM, `N55E013.hgt`: a degree each, whose name has the south-west corner, 3601 or 1201 posts a side."""

import re
from typing import Final

import numpy as np

from dyknow.navigation.terrain.grid import HIGHEST_M, LOWEST_M, VOID, HeightGrid, unreadable

SIDES: Final = (3601, 1201)
"""Posts of a side, 1 and 3 arc seconds apart."""
_NAME: Final = re.compile(r"([NS])(\d{2})([EW])(\d{3})(?![0-9A-Za-z])", re.IGNORECASE)


def corner_of(name: str) -> tuple[int, int]:
    """Latitude and longitude of the south-west corner that a file's name has; raises DecodeError."""
    found = _NAME.match(name)
    if found is not None:
        latitude = int(found[2]) * (1 if found[1] in "Nn" else -1)
        longitude = int(found[4]) * (1 if found[3] in "Ee" else -1)
        if -90 <= latitude < 90 and -180 <= longitude < 180:
            return latitude, longitude
    raise unreadable("its name has no south-west corner", "call the tile from 55 to 56 N, 13 to 14 E N55E013.hgt")


def read_tile(name: str, data: bytes) -> HeightGrid:
    """The grid of a tile: big-endian heights, rows from north to south; raises DecodeError with cause and remedy."""
    south, west = corner_of(name)
    side = next((each for each in SIDES if len(data) == 2 * each * each), None)
    if side is None:
        sizes = " or ".join(f"{2 * each * each} ({each} x {each} heights)" for each in SIDES)
        raise unreadable(f"a tile has {sizes} bytes, and this {len(data)}", "it is cut or no tile; fetch it again")
    heights = np.frombuffer(data, ">i2").reshape(side, side).astype(np.int16)
    wrong = (heights > HIGHEST_M) | ((heights < LOWEST_M) & (heights != VOID))
    if wrong.any():
        row, column = np.unravel_index(int(wrong.argmax()), wrong.shape)
        raise unreadable(
            f"row {row + 1}, post {column + 1}: {heights[row, column]} m is no height of ground",
            "its numbers are to be big-endian metres; fetch it again",
        )
    return HeightGrid(south + 1.0, float(west), 1.0 / (side - 1), 1.0 / (side - 1), heights)
