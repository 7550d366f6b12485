"""Files from anyone: opened only where they are files, texts bounded, and files that a file names, by their path from where it lies."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from stat import S_ISREG
from typing import BinaryIO, Final

from dyknow.proxies.files.piped_lines import limited_lines

LONGEST_TEXT: Final = 4 * 2**20
"""Bytes of a text."""
_NO_FILE, _TOO_LARGE, _NO_TEXT = 22, 27, 84


def opened_file(path: Path) -> BinaryIO:
    """A file, to be read; raises OSError for anything else: a pipe would block, a device would never end."""
    if "\0" in str(path):
        raise OSError(_NO_FILE, "its name is none of a file")
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    if not S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(_NO_FILE, "it is no file but a directory, pipe or device")
    return os.fdopen(descriptor, "rb")


def bounded_bytes(path: Path, most: int = LONGEST_TEXT) -> bytes:
    """The contents of a file; raises OSError, also where it is longer than `most` bytes."""
    with opened_file(path) as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise OSError(_TOO_LARGE, f"it is longer than {most >> 10} kB, the most that is read")
    return data


def bounded_text(path: Path, most: int = LONGEST_TEXT) -> str:
    """The text of a file; raises OSError, also where it is longer than `most` bytes, or no UTF-8."""
    try:
        return bounded_bytes(path, most).decode("utf-8")
    except UnicodeDecodeError as wrong:
        raise OSError(_NO_TEXT, f"byte {wrong.start} is no UTF-8 text") from None


def text_lines(file: BinaryIO, most: int) -> Iterator[str]:
    """The lines of a text; a line of more than `most` bytes is cut just behind them. Raises OSError for no UTF-8."""
    for number, line in enumerate(limited_lines(file, most), 1):
        try:
            yield line.decode("utf-8", "strict" if len(line) <= most else "replace")
        except UnicodeDecodeError:
            raise OSError(_NO_TEXT, f"line {number} is no UTF-8 text") from None


def beside(path: Path) -> Callable[[str], str]:
    """Reads the text of a file named in `path`, from where that lies; that raises OSError."""
    return lambda name: named_text(path, name)


def named_text(path: Path, name: str) -> str:
    """The text of the file with that name next to `path`; raises OSError, also where it is no file of text."""
    return bounded_text(path.parent / name)
