"""A file that may change while it is used, and the files it names."""

from pathlib import Path

from dyknow.proxies.files.named_files import named_text


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


class WatchedFiles:
    """A file, and those that it names by their path from where it lies."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.begin()

    def begin(self) -> None:
        """It is about to be read, and may name other files than before."""
        self._files = [WatchedFile(self._path)]

    def read_named(self, name: str) -> str:
        """The text of a file that it names; raises OSError."""
        self._files.append(WatchedFile(self._path.parent / name))
        return named_text(self._path, name)

    def has_changed(self) -> bool:
        """Whether one of them is another than at the last look."""
        return any(each.has_changed() for each in self._files)
