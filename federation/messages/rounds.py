"""Questions to several: awaited answers, and when a question may be repeated. Node clock."""

from collections.abc import Hashable, Iterable
from typing import Generic, TypeVar

K = TypeVar("K", bound=Hashable)


class Round(Generic[K]):
    """One question to several. A recipient counts once: by its first answer, its silence, or when it is gone.

    Attributes:
        awaited: the recipients whose answers are awaited; the round is over when there is none.
    """

    def __init__(self, recipients: Iterable[K] = ()) -> None:
        self.awaited = dict.fromkeys(recipients)

    def ask(self, recipient: K) -> None:
        """Await the answer of one that comes late."""
        self.awaited[recipient] = None

    def answered(self, recipient: K) -> bool:
        """Await it no longer; whether it was awaited."""
        return recipient in self.awaited and self.awaited.pop(recipient) is None


class Retries(Generic[K]):
    """When a request may be repeated: after a pause that doubles from the third request on, until the recipient obeys.

    Args:
        pause_us: after the first request, and after the second.
        most_us: the longest; None: all pauses are equal.
    """

    def __init__(self, pause_us: int, most_us: int | None = None) -> None:
        self._pause_us, self._most_us = pause_us, pause_us if most_us is None else most_us
        self._asked: dict[K, tuple[int, int, int]] = {}

    def asked(self, recipient: K, now_us: int) -> None:
        """A request to it leaves, and its pause begins."""
        *_, pause_us = self._asked.get(recipient, (self._pause_us,))
        after_us = min(2 * pause_us, self._most_us) if recipient in self._asked else pause_us
        self._asked[recipient] = now_us, pause_us, after_us

    def is_due(self, recipient: K, now_us: int, patience: int = 1) -> bool:
        """Whether a request may leave: there was none, or `patience` times its pause is over."""
        asked_us, pause_us, _ = self._asked.get(recipient, (now_us, 0, 0))
        return now_us >= asked_us + patience * pause_us

    def settle(self, recipient: K) -> None:
        """It obeys: its pause is the first again."""
        if recipient in self._asked:
            self._asked[recipient] = self._asked[recipient][0], self._pause_us, self._pause_us

    def forget(self, recipient: K) -> None:
        """It is gone; a request may leave at once when it is back."""
        self._asked.pop(recipient, None)
