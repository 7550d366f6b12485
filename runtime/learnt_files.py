"""The files in which a platform keeps what its streams of beliefs have learnt: one for each stream, in one directory.

A file is written next to its place and then put there, so that it is whole or as it was.
"""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Final

from dyknow.agents.effects import Keep
from dyknow.model.errors import WrongCall

MOST_BYTES: Final = 4 * 2**20


class LearntFiles:
    """Of one platform.

    Args:
        directory: made when something is kept.
    """

    def __init__(self, directory: Path, unit: str) -> None:
        self._directory, self._unit = directory, unit

    def path(self, stream: str) -> Path:
        """Of one stream."""
        return self._directory / f"{self._unit}-{re.sub(r'[^A-Za-z0-9_-]+', '_', stream)}.toml"

    def keep(self, stream: str, text: str) -> None:
        """Write what a stream has learnt.

        Raises:
            WrongCall: it cannot be written.
        """
        path = self.path(stream)
        fresh = path.with_suffix(".new")
        try:
            self._directory.mkdir(parents=True, exist_ok=True)
            fresh.write_text(f"# stream {stream}\n{text}", encoding="utf-8")
            fresh.replace(path)
        except OSError as error:
            raise WrongCall(f"learnt: {path} cannot be written ({error.strerror}); name another directory.") from None

    def read(self) -> dict[str, str]:
        """The kept texts, by stream.

        Raises:
            WrongCall: a file cannot be read, or is none of these.
        """
        found: dict[str, str] = {}
        for path in sorted(self._directory.glob(f"{self._unit}-*.toml")):
            try:
                with path.open("rb") as file:
                    text = file.read(MOST_BYTES + 1).decode("utf-8")
            except (OSError, UnicodeDecodeError) as error:
                raise WrongCall(f"learnt: {path} cannot be read ({error}); mend or remove it.") from None
            first = text.partition("\n")[0]
            if len(text) > MOST_BYTES or not first.startswith("# stream "):
                raise WrongCall(f"learnt: {path} was not written by a platform, or is too large; mend or remove it.")
            found[first.removeprefix("# stream ").strip()] = text
        return found


def keep(directory: Path | None, unit: str, effect: Keep, note: Callable[[str], None]) -> None:
    """Keep the learnt knowledge of a stream, where the platform has a directory for it; a failure is noted."""
    if directory is not None:
        try:
            LearntFiles(directory, unit).keep(effect.stream, effect.text)
        except WrongCall as wrong:
            note(str(wrong))
