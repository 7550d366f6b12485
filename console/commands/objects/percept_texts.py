"""The lines of recorded percepts: JSON as they are, those of a MOTChallenge text as JSON."""

from collections.abc import Callable, Iterable, Iterator
from itertools import chain

from dyknow.anchoring.percepts.motchallenge import MotSettings, has_places, is_motchallenge, percept_lines
from dyknow.model.errors import TextError, WrongCall


def numbered_lines(
    lines: Iterable[bytes],
    file: str,
    on_error: Callable[[TextError], None],
    fps: float | None,
    m_per_pixel: float | None,
) -> Iterable[tuple[int, str | bytes]]:
    """Lines of JSON with their numbers in the file.

    Raises:
        WrongCall: the text wants a frame rate or a scale that is not given, or has no use for one that is.
    """
    every = iter(lines)
    begin = _until_written(every)
    first = begin[-1] if begin else b""
    text = chain(begin, every)
    if not is_motchallenge(first):
        for option, value in (("--fps", fps), ("--m-per-pixel", m_per_pixel)):
            if value is not None:
                raise WrongCall(
                    f"{option}: {file} is no MOTChallenge text; lines of JSON have t_ms, and metres: leave it out."
                )
        return enumerate(text, 1)
    if fps is None:
        raise WrongCall(f"{file} is a MOTChallenge text, which counts frames: give how many a second it has, --fps 25.")
    if has_places(first) and m_per_pixel is not None:
        raise WrongCall(f"--m-per-pixel: {file} has places on the ground, in metres: leave it out.")
    if not has_places(first) and m_per_pixel is None:
        raise WrongCall(
            f"{file} has boxes in an image and no places on the ground: give how many metres a pixel is, --m-per-pixel 0.05."
        )
    return percept_lines(text, file, MotSettings(fps, m_per_pixel), on_error)


def _until_written(lines: Iterator[bytes]) -> list[bytes]:
    """The lines to the first that is not empty."""
    found: list[bytes] = []
    for line in lines:
        found.append(line)
        if line.strip():
            break
    return found
