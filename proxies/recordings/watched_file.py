"""A file that may change while it is used."""

from pathlib import Path


class WatchedFile:
    """Compared by size and time of change; a file that is not there is a state like any other."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._seen = self._state()

    def has_changed(self) -> bool:
        """Whether it is another than at the last look."""
        before, self._seen = self._seen, self._state()
        return self._seen != before

    def _state(self) -> tuple[int, int] | None:
        try:
            found = self._path.stat()
        except OSError:
            return None
        return found.st_mtime_ns, found.st_size
