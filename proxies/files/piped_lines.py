"""Lines of a recording or of a pipe as bytes, each as soon as it is there, however long the lines are."""

from collections.abc import Iterator
from typing import BinaryIO


def limited_lines(file: BinaryIO, most: int) -> Iterator[bytes]:
    """The lines; of one that has more than `most` bytes only enough for that to be seen."""
    while line := file.readline(most + 2):
        yield line
        while line and not line.endswith(b"\n"):
            line = file.readline(most)
