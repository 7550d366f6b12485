"""Files that a file names, by their path from where it lies."""

from collections.abc import Callable
from pathlib import Path


def beside(path: Path) -> Callable[[str], str]:
    """Reads the text of a file named in `path`; that raises OSError and UnicodeDecodeError."""
    return lambda name: (path.parent / name).read_text("utf-8")
