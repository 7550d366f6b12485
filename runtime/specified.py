"""The inputs of a platform's specification: its file, read again when it changes, and a feed of samples.

Threads read; the node thread is given text that was read before, and samples when they are due.
"""

import threading
from collections.abc import Callable
from itertools import groupby
from operator import attrgetter
from pathlib import Path

from dyknow.agents.effects import Fed, FedTogether, Specify
from dyknow.agents.specification.specification_part import read
from dyknow.documents.json_lines import LIMIT_LINE
from dyknow.kpl import parse_specification
from dyknow.model.errors import DyknowError, SourceText, SpecificationFailed
from dyknow.model.instants import US_PER_S
from dyknow.proxies.files.named_files import bounded_text, opened_file, text_lines
from dyknow.proxies.files.watched_file import WatchedFiles
from dyknow.proxies.recordings.sample_file import FedSample, read_feed

LOOK_S = 0.5


class Specified:
    """Posts the specification now and whenever its file changes, and the samples of a feed at their times.

    Samples that become available at one time, as those of one line, are one event. The feed begins at the next full
    second of federation time, so that its samples lie on the grids that others ask for.

    Args:
        post: takes events for the node.
        note: takes notes for the user.
        now_us: the node clock; `federation_us` of it is what the feed's times count from the start in.

    Raises:
        SpecificationFailed: the specification or the feed cannot be read, or is wrong.
    """

    def __init__(
        self,
        path: Path,
        feed: Path | None,
        post: Callable[[Specify | FedTogether], None],
        note: Callable[[str], None],
        now_us: Callable[[], int],
        federation_us: Callable[[int], int],
    ) -> None:
        self._path, self._post, self._note, self._now_us, self._federation_us = path, post, note, now_us, federation_us
        self._over = threading.Event()
        self._watched = WatchedFiles(path)
        self._given = self._read()
        self._samples = _samples(feed)
        self._threads = [threading.Thread(target=self._watch, name="specification", daemon=True)]
        if self._samples:
            self._threads.append(threading.Thread(target=self._feed, name="feed", daemon=True))

    def start(self) -> None:
        self._post(self._given)
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        self._over.set()

    def _read(self) -> Specify:
        """The texts, which can be read; that is remembered for the node."""
        texts: dict[str, str] = {}
        self._watched.begin()

        def read_named(name: str) -> str:
            texts[name] = self._watched.read_named(name)
            return texts[name]

        try:
            text = SourceText(bounded_text(self._path), str(self._path))
            parse_specification(text, read_named)
            given = Specify(self._now_us(), str(text), text.file, tuple(texts.items()))
            read(text, given.named)
        except (OSError, DyknowError) as wrong:
            raise SpecificationFailed(str(wrong)) from None
        return given

    def _watch(self) -> None:
        while not self._over.wait(LOOK_S):
            if not self._watched.has_changed():
                continue
            try:
                given = self._read()
            except SpecificationFailed as wrong:
                self._note(f"specification rejected; the previous one keeps running:\n{wrong}")
            else:
                self._post(given)

    def _feed(self) -> None:
        begins_us = -(-self._federation_us(self._now_us()) // US_PER_S) * US_PER_S
        for at_us, together in groupby(self._samples, attrgetter("at_us")):
            while (left_us := begins_us + at_us - self._federation_us(self._now_us())) > 0:
                if self._over.wait(left_us / 1e6):
                    return
            now_us = self._now_us()
            samples = [Fed(now_us, each.source, begins_us + each.valid_us, each.value) for each in together]
            self._post(FedTogether(now_us, tuple(samples)))


def _samples(feed: Path | None) -> list[FedSample]:
    if feed is None:
        return []
    try:
        with opened_file(feed) as file:
            return read_feed(text_lines(file, LIMIT_LINE), str(feed))
    except (OSError, DyknowError) as wrong:
        raise SpecificationFailed(str(wrong)) from None
