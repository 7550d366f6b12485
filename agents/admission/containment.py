"""What a part raises ends that act, event or step, never the process: it is counted, noted with its place, and shown as impaired.

A part whose step by time raises is left out for a second; after three such steps it is out, tried again each minute. Three
failures within a minute over what one member sent, and that member is not listened to for a minute; its heartbeats still
are, so that it is not taken for gone. Times are the node clock.
"""

import traceback
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import PurePath
from typing import Final

from agents.part import Part
from federation import keys
from federation.messages.descriptions import ConditionEntry

TRIES: Final = 3
"""Failed steps after which a part stays out, and failures over one member's messages after which it is not heard."""
PAUSE_US: Final = 1_000_000
RETRY_US: Final = 60_000_000
DEAF_US: Final = 60_000_000
MOST: Final = 64
"""Places that are remembered, and members."""
_SHOWN: Final = 4


@dataclass(slots=True)
class Impairment:
    """A part that raised in one of its methods: where and what, how often, and since when."""

    text: str
    since_us: int
    count: int = 1
    is_out: bool = False


class Containment:
    """See the module.

    Args:
        is_on: False: what is raised is not caught, as tests want it.
        note: takes words for users; offer: called when what is shown has changed.

    Attributes:
        failures: how often a part raised, by the class of the part and its method.
        senders: how often that was over what a member sent.
        impaired: what is shown, by the same.
    """

    def __init__(self, note: Callable[[str], None], offer: Callable[[int], None], *, is_on: bool = True) -> None:
        self.is_on, self._note, self._offer = is_on, note, offer
        self.failures: Counter[str] = Counter()
        self.senders: Counter[str] = Counter()
        self.impaired: dict[str, Impairment] = {}
        self._paused_us: dict[Part, int] = {}
        self._lately_us: dict[str, list[int]] = {}
        self._deaf_us: dict[str, int] = {}

    # -- parts -------------------------------------------------------------------------------------------------

    def caught(self, where: str, error: Exception, now_us: int, sender: str = "") -> None:
        """Count, note once and show that `where` raised, over what `sender` had sent (empty: over nothing)."""
        self.failures[where] += 1
        text = f"{where}: {type(error).__name__}: {error} ({_place(error)})"
        found = self.impaired.get(where)
        if found is None:
            self.impaired[where] = Impairment(text, now_us)
            while len(self.impaired) > MOST:
                del self.impaired[next(iter(self.impaired))]
            over = f", over what {sender} sent" if sender else ""
            self._note(f"impaired: {text}{over}; what it was doing is ended, the rest continues")
        else:
            found.count += 1
        if sender:
            self._blame(sender, now_us)
        self._offer(now_us)

    def failed_step(self, part: Part, method: str, error: Exception, now_us: int) -> None:
        """A step by time raised: the part pauses, and stays out if it does so again and again."""
        where = f"{type(part).__name__}.{method}"
        self.caught(where, error, now_us)
        self._paused_us[part] = now_us + PAUSE_US
        found = self.impaired[where]
        if found.count >= TRIES and not found.is_out:
            found.is_out = True
            self._note(f"impaired: {where} raised {found.count} times: it is out, and tried again each minute")
        if found.is_out:
            self._paused_us[part] = now_us + RETRY_US

    def is_stepped(self, part: Part, now_us: int) -> bool:
        """Whether a part is stepped by time now."""
        until_us = self._paused_us.get(part)
        if until_us is None:
            return True
        if now_us < until_us:
            return False
        del self._paused_us[part]
        return True

    def deadline_us(self, part: Part) -> int | None:
        """When a part is due: not before its pause ends."""
        until_us = self._paused_us.get(part)
        try:
            due_us = part.deadline_us
        except Exception as error:
            if not self.is_on:
                raise
            self.failed_step(part, "deadline_us", error, 0 if until_us is None else until_us)
            return None
        if until_us is None or due_us is None:
            return due_us
        return max(due_us, until_us)

    # -- members -----------------------------------------------------------------------------------------------

    def _blame(self, sender: str, now_us: int) -> None:
        self.senders[sender] += 1
        lately = [at_us for at_us in self._lately_us.pop(sender, []) if now_us - at_us < DEAF_US] + [now_us]
        if len(lately) < TRIES:
            self._lately_us[sender] = lately
        else:
            self._deaf_us[sender] = now_us + DEAF_US
            self._note(f"impaired: {len(lately)} failures over what {sender} sent; it is not listened to for a minute")
        for each in (self._lately_us, self._deaf_us, self.senders):
            while len(each) > MOST:
                del each[next(iter(each))]

    def is_heard(self, key: str, now_us: int) -> bool:
        """Whether what arrived on a key is looked at."""
        if not self._deaf_us:
            return True
        name = keys.parse_key(key)
        sender = sender_of(name)
        until_us = self._deaf_us.get(sender)
        if until_us is None or isinstance(name, keys.HeartbeatKey):
            return True
        if now_us < until_us:
            return False
        del self._deaf_us[sender]
        self._offer(now_us)
        return True

    def conditions(self) -> Iterable[ConditionEntry]:
        """What `ls` shows of it, the newest first."""
        for unit, until_us in list(self._deaf_us.items())[-_SHOWN:]:
            text = f"{unit} is not listened to: what it sends makes parts fail"
            yield ConditionEntry(text=text, since_us=max(0, until_us - DEAF_US))
        for found in list(self.impaired.values())[: -_SHOWN - 1 : -1]:
            how = "is out" if found.is_out else f"failed {found.count} times" if found.count > 1 else "failed"
            text = " ".join("".join(one if one.isprintable() else " " for one in found.text).split())
            yield ConditionEntry(text=f"impaired ({how}): {text}"[:200], since_us=max(0, found.since_us))


def sender_of(key: keys.Key | None) -> str:
    """The unit that sent what arrived on a key; empty: it is not known."""
    match key:
        case keys.ActKey(sender=unit) | keys.HeartbeatKey(unit=unit) | keys.AnnouncementKey(unit=unit):
            return unit
        case keys.StreamKey(owner=unit) | keys.HistoryKey(owner=unit):
            return unit
    return ""


def _place(error: Exception) -> str:
    """Where it was raised: file and line of the innermost frame."""
    frames = traceback.extract_tb(error.__traceback__)
    return f"{PurePath(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "nowhere"
