"""Texts of the MOTChallenge: lines of numbers, `det.txt` and `gt.txt`, as percepts.

    frame, id, bb_left, bb_top, bb_width, bb_height, conf, x, y, z
    frame, id, bb_left, bb_top, bb_width, bb_height, conf, class, visibility

Frames count from 1; id is -1 of a detection without a name. Its place is x, y in metres where the text has them, which are -1
otherwise: then it is the middle of the lower edge of the box, by the scale that is given, x to the right and y up, and wrong by
2 pixels or 5 % of the height. In a text with names `conf` 0 marks what does not count. Lines need no order.
"""

import json
from collections.abc import Callable, Iterable, Iterator
from math import isfinite
from operator import itemgetter
from typing import Any, Final, NamedTuple

from dyknow.model.errors import TextError
from dyknow.model.instants import US_PER_MS, US_PER_S

MOST_LINES: Final = 2_000_000
_LEAST, _MOST = 6, 10
_CLASSES: Final = 9
"""Numbers of a line that ends in a class and a visibility."""
_LEAST_SD_PIXELS, _SD_OF_HEIGHT = 2.0, 0.05
"""How wrong the lower edge of a box is: pixels, or a share of its height."""
_KINDS: Final = {1: "pedestrian", 2: "rider", 3: "car", 4: "bicycle", 5: "motorbike", 7: "person"}
"""Classes by their numbers."""
_NONE: Final = -1.0
_EXAMPLE: Final = "1, -1, 794.2, 47.5, 71.2, 174.8, 0.9, -1, -1, -1"
_FRAMES: Final = 1e9
_LONGEST: Final = 400
"""The most characters of a line."""


class MotSettings(NamedTuple):
    """Settings that the text lacks.

    Attributes:
        fps: frames a second.
        m_per_pixel: where it has no places on the ground; None: it has.
    """

    fps: float
    m_per_pixel: float | None = None


def is_motchallenge(line: str | bytes) -> bool:
    """Whether the first line of a text is one of this format, and not of JSON."""
    return _numbers(_decoded(line)) is not None


def has_places(line: str | bytes) -> bool:
    """Whether a line has a place on the ground, in metres."""
    return _place(_numbers(_decoded(line)) or []) is not None


def percept_lines(
    lines: Iterable[str | bytes], file: str, given: MotSettings, on_error: Callable[[TextError], None]
) -> Iterator[tuple[int, str]]:
    """Lines of JSON, with the numbers of the lines that they are from, in the order of time."""
    kept: list[tuple[float, int, str | bytes]] = []
    frame = 0.0
    for number, line in enumerate(lines, 1):
        if number > MOST_LINES:
            on_error(_error(f"at most {MOST_LINES} lines are read", "a part of it", number, file))
            break
        if line.strip():
            frame = _frame(line, frame)
            kept.append((frame, number, line))
    kept.sort(key=itemgetter(0, 1))
    for _, number, line in kept:
        try:
            record = _record(_decoded(line), number, file, given)
        except TextError as error:
            on_error(error)
            continue
        if record is not None:
            yield number, json.dumps(record)


def _decoded(line: str | bytes) -> str:
    return line.decode("utf-8-sig", errors="replace") if isinstance(line, bytes) else line


def _frame(line: str | bytes, before: float) -> float:
    """The frame of a line; for a line of another format, the frame before."""
    try:
        frame = float(_decoded(line[:_LONGEST]).partition(",")[0])
    except ValueError:
        return before
    return frame if isfinite(frame) else before


def _record(text: str, number: int, file: str, given: MotSettings) -> dict[str, Any] | None:
    """The percept of a line; None: it does not count."""
    numbers = _numbers(text)
    if numbers is None:
        raise _error(f"{_LEAST} to {_MOST} numbers with commas between them are a line", _EXAMPLE, number, file)
    frame, id_, left, top, width, height = numbers[:_LEAST]
    if not (1 <= frame <= _FRAMES and frame == int(frame) and id_ == int(id_)):
        raise _error("frame is a number from 1, and id a whole one", _EXAMPLE, number, file)
    confidence = numbers[_LEAST] if len(numbers) > _LEAST else None
    if id_ != _NONE and confidence == 0.0:
        return None
    place = _place(numbers)
    if given.m_per_pixel is not None:
        if place is not None:
            raise _error("it has a place on the ground, which wants no scale", "no --m-per-pixel", number, file)
        place = (left + width / 2) * given.m_per_pixel, -(top + height) * given.m_per_pixel
    if place is None:
        raise _error("it has no place on the ground, and lines before it have", "x, y, z in metres", number, file)
    record: dict[str, Any] = {"t_ms": round((frame - 1) * US_PER_S / given.fps) / US_PER_MS}
    if id_ != _NONE:
        record["percept"] = int(id_)
    if given.m_per_pixel is not None:
        record["sd_m"] = given.m_per_pixel * max(_LEAST_SD_PIXELS, _SD_OF_HEIGHT * abs(height))
    record |= {"x_m": place[0], "y_m": place[1], "box_width": width, "box_height": height}
    if confidence is not None:
        record["confidence"] = confidence
    if len(numbers) == _CLASSES:
        number_of = int(numbers[-2])
        record |= {"class": _KINDS.get(number_of, str(number_of)), "visibility": numbers[-1]}
    return record


def _numbers(text: str) -> list[float] | None:
    """The numbers of a line, if it is one of this format."""
    if len(text) > _LONGEST:
        return None
    parts = text.strip().rstrip(",").split(",")
    if not _LEAST <= len(parts) <= _MOST:
        return None
    try:
        numbers = [float(each) for each in parts]
    except ValueError:
        return None
    return numbers if all(map(isfinite, numbers)) else None


def _place(numbers: list[float]) -> tuple[float, float] | None:
    """X and y in metres."""
    if len(numbers) != _MOST or (numbers[7] == numbers[8] == _NONE):
        return None
    return numbers[7], numbers[8]


def _error(message: str, repair: str, number: int, file: str) -> TextError:
    return TextError(message, line=number, repair=repair, file=file)
