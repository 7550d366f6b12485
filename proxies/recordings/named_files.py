"""Texts of files from anyone, bounded, and files that a file names, by their path from where it lies."""

from collections.abc import Callable
from pathlib import Path
from stat import S_ISREG
from typing import Final

LONGEST_TEXT: Final = 4 * 2**20
"""Bytes of a text."""


def bounded_text(path: Path, most: int = LONGEST_TEXT) -> str:
    """The text of a file; raises OSError, also where it is longer than `most` bytes, and UnicodeDecodeError."""
    with path.open("rb") as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise OSError(27, f"it is longer than {most >> 10} kB, the most that is read")
    return data.decode("utf-8")


def beside(path: Path) -> Callable[[str], str]:
    """Reads the text of a file named in `path`, from where that lies; that raises OSError and UnicodeDecodeError."""
    return lambda name: named_text(path, name)


def named_text(path: Path, name: str) -> str:
    """The text of the file that `path` names so; raises OSError, also for what is no file of text, and UnicodeDecodeError."""
    if "\0" in name:
        raise OSError(22, "its name is none of a file")
    found = path.parent / name
    if not S_ISREG(found.stat().st_mode):
        raise OSError(22, "it is no file of text")
    return bounded_text(found)
