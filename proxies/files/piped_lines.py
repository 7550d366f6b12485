"""Lines of a recording or of a pipe as bytes, each as soon as it is there, however long the lines are."""

from collections.abc import Iterator
from typing import BinaryIO


def limited_lines(file: BinaryIO, most: int) -> Iterator[bytes]:
    """The lines; a line of more than `most` bytes is cut just behind them."""
    while line := file.readline(most + 2):
        yield line
        while line and not line.endswith(b"\n"):
            line = file.readline(most)
