"""Containment of errors: an exception in a part ends its act, answer, sample or step, never the process.

It is counted, noted once and shown as impaired. A part whose step by time raises is left out for a second, a stream
whose consumer raises, too; after three times within a minute each is out, and retried each minute. Parts that keep
vehicles apart or receive acts are `vital`: they are left out for a tenth of a second only, however often they raise.
No part is rebuilt: it continues with its state. A place without a failure for 65 s is no longer impaired, which is noted.

Three failures within a minute over acts of one member, and its acts are refused for a minute. Only what it signed
counts, never at a place that fails over others, too, and a command centre is always heard. Times are the node clock.
"""

import traceback
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import PurePath
from typing import Any, Final, TypeVar

from dyknow.agents.part import Followed, Part, Timed
from dyknow.federation import keys
from dyknow.federation.messages.descriptions import ConditionEntry

T = TypeVar("T")
TRIES: Final = 3
"""Failures within a minute after which a part or stream stays out, and acts of a member are refused."""
VITAL_US: Final = 100_000
PAUSE_US: Final = 1_000_000
RETRY_US: Final = 60_000_000
DEAF_US: Final = 60_000_000
QUIET_US: Final = RETRY_US + 5_000_000
"""How long after its last failure a place is impaired: it has been tried again by then."""
OFFER_US: Final = 1_000_000
"""Least time between announcements of changed conditions."""
MOST: Final = 64
"""Places that are remembered, and members."""
_SHOWN, _MAX_TEXT = 5, 160


@dataclass(slots=True)
class Impairment:
    """A place that raised: where and what, how often, since when; and over the messages of one unit (empty: of several, or of none)."""

    text: str
    over: str
    since_us: int
    last_us: int
    count: int = 1
    is_out: bool = False

    @property
    def how(self) -> str:
        """How often, in words that change seldom."""
        if self.is_out:
            return "is out, tried again each minute"
        if self.count < TRIES:
            return "failed" if self.count == 1 else "failed twice"
        return f"failed {10 ** (len(str(self.count)) - 1) if self.count >= 10 else TRIES} times and more"


class Containment:
    """See the module.

    Args:
        note: takes words for users.
        now_us: the time of the present step.
        cause: the unit whose message is being processed; empty: none.
        may_silence: whether acts of that unit are signed, and may be refused.
        is_on: False: exceptions are not caught, as tests want it.

    Attributes:
        failures: how often a place raised.
        senders: number of failures over messages of a member.
        impaired: the impairments that are shown, by place.
        owner_of: the member behind a unit, which is refused under all its names.
        is_news: whether anything was caught; `Platform.settle` resets it.
    """

    def __init__(
        self,
        note: Callable[[str], None],
        now_us: Callable[[], int],
        cause: Callable[[], str],
        may_silence: Callable[[str], bool],
        *,
        is_on: bool = True,
    ) -> None:
        self.is_on, self._note, self._now_us, self._cause, self._may_silence = is_on, note, now_us, cause, may_silence
        self.owner_of: Callable[[str], str] = str
        self.failures: Counter[str] = Counter()
        self.senders: Counter[str] = Counter()
        self.impaired: dict[str, Impairment] = {}
        self.paused_us: dict[Timed, int] = {}
        self._lately_us: dict[str, list[int]] = {}
        self._refused_us: dict[str, int] = {}
        self.is_news = False
        self._announced: tuple[str, ...] = ()
        self._announced_us: int | None = None

    # -- what raises -------------------------------------------------------------------------------------------

    def caught(self, where: str, error: Exception, sender: str | None = None, *, by_act: bool = False) -> Impairment:
        """Count, note once and show that `where` raised, over a message of `sender`; raises it again unless `is_on`.

        `by_act`: the sender signed what it was over, if anything is signed here.
        """
        if not self.is_on:
            raise error
        self.is_news, now_us, over = True, self._now_us(), self._cause() if sender is None else sender
        self.failures[where.partition(" of ")[0]] += 1
        found = self.impaired.get(where)
        if found is None:
            found = self.impaired[where] = Impairment(_description(where, error), over, now_us, now_us)
            _bound(self.impaired)
            about = f", over messages of {over}" if over else ""
            self._note(f"impaired: {found.text}{about}; its current operation is ended, the rest continues")
        else:
            found.count, found.last_us = found.count + 1, now_us
            found.over = over if over == found.over else ""
        if over:
            self.senders[over] += 1
            _bound(self.senders)
            if by_act and found.over == over and self._may_silence(over):
                self._blame(self.owner_of(over), now_us)
        return found

    def call(self, do: Callable[..., T], *given: Any, otherwise: T) -> T:
        """Return the result of `do`, or `otherwise` if it raises."""
        try:
            return do(*given)
        except Exception as error:  # noqa: BLE001  (contained)
            self.caught(place_of(do), error)
            return otherwise

    def step(self, part: Part, do: Callable[..., object], *given: Any) -> bool:
        """Step a part, or something in it; whether it did not raise. If it does, the part is left out for a while."""
        try:
            do(*given)
        except Exception as error:  # noqa: BLE001  (contained)
            self._pause(part, place_of(do), error)
            return False
        return True

    def timed(self, part: Part, now_us: int) -> Followed:
        """Step a part by time; returns the parts it may have made due; None: any, and it is left out if it raised."""
        try:
            return part.on_time(now_us)
        except Exception as error:  # noqa: BLE001  (contained)
            self._pause(part, place_of(part.on_time), error)
            return None

    def stream_out_us(self, do: Callable[..., object], label: str, error: Exception) -> int:
        """Note that a consumer or producer of a stream raised; returns for how long it is left out."""
        where = f"{place_of(do)} of {label}"
        return self._weigh(where, self.caught(where, error))

    def _pause(self, part: Timed, where: str, error: Exception) -> None:
        found = self.caught(where, error)
        self.paused_us[part] = self._now_us() + (
            self._weigh(where, found) if not getattr(part, "vital", True) else VITAL_US
        )

    def _weigh(self, where: str, found: Impairment) -> int:
        if found.count >= TRIES and not found.is_out:
            found.is_out = True
            self._note(f"impaired: {where} raised {found.count} times: it is out, and tried again each minute")
        return RETRY_US if found.is_out else PAUSE_US

    def is_stepped(self, part: Part) -> bool:
        """Whether a part is stepped by time now."""
        until_us = self.paused_us.get(part)
        if until_us is None:
            return True
        if self._now_us() < until_us:
            return False
        del self.paused_us[part]
        return True

    def due_us(self, part: Timed) -> int | None:
        """When a part, or something in it, is due: not before its pause ends."""
        until_us = self.paused_us.get(part)
        try:
            due_us = part.deadline_us
        except Exception as error:  # noqa: BLE001  (contained)
            if until_us is None or until_us <= self._now_us():
                self._pause(part, f"{type(part).__name__}.deadline_us", error)
            return self.paused_us[part]  # it may be due: it is stepped when its pause ends
        return due_us if until_us is None or due_us is None else max(due_us, until_us)

    # -- members -----------------------------------------------------------------------------------------------

    def _blame(self, sender: str, now_us: int) -> None:
        lately = [at_us for at_us in self._lately_us.pop(sender, []) if now_us - at_us < DEAF_US] + [now_us]
        if len(lately) < TRIES:
            self._lately_us[sender] = lately
        else:
            self._refused_us[sender] = now_us + DEAF_US
            self._note(f"impaired: {len(lately)} failures over acts of {sender}; they are refused for a minute")
        _bound(self._lately_us)
        _bound(self._refused_us)

    def is_heard(self, sender: str) -> bool:
        """Whether acts of a member are let in."""
        until_us = self._refused_us.get(self.owner_of(sender)) if self._refused_us else None
        return until_us is None or self._now_us() >= until_us

    # -- what is shown -----------------------------------------------------------------------------------------

    @property
    def deadline_us(self) -> int | None:
        """When what is shown is to be announced, or changes by time; None: nothing is impaired."""
        if not self.impaired and not self._refused_us and not self._announced:
            return None
        ends_us = [found.last_us + QUIET_US for found in self.impaired.values()] + list(self._refused_us.values())
        if self._announced_us is None or self._texts() != self._announced:
            ends_us.append(0 if self._announced_us is None else self._announced_us + OFFER_US)
        return min(ends_us, default=None)

    def on_time(self, now_us: int) -> bool:
        """Forget what has not failed for long; whether what is shown is to be announced again."""
        for where, found in [*self.impaired.items()]:
            if now_us >= found.last_us + QUIET_US:
                del self.impaired[where]
                self._note(f"no longer impaired: {where}")
        for unit in [unit for unit, until_us in self._refused_us.items() if now_us >= until_us]:
            del self._refused_us[unit]
            self._note(f"acts of {unit} are let in again")
        texts = self._texts()
        if texts == self._announced or (self._announced_us is not None and now_us < self._announced_us + OFFER_US):
            return False
        self._announced, self._announced_us = texts, now_us
        return True

    def _texts(self) -> tuple[str, ...]:
        return tuple(entry.text for entry in self.conditions())

    def conditions(self) -> Iterable[ConditionEntry]:
        """The impairments as conditions for `ls`, the newest first."""
        for unit, until_us in list(self._refused_us.items())[-_SHOWN:]:
            text = f"impaired: acts of {unit} are refused for a minute: parts failed over them"
            yield ConditionEntry(text=text, since_us=max(0, until_us - DEAF_US))
        if len(self.impaired) > _SHOWN:
            text = f"impaired: {len(self.impaired)} places; the newest {_SHOWN} are listed"
            yield ConditionEntry(text=text, since_us=min(max(0, found.since_us) for found in self.impaired.values()))
        for found in list(self.impaired.values())[: -_SHOWN - 1 : -1]:
            over = f", over messages of {found.over}" if found.over else ""
            yield ConditionEntry(
                text=f"impaired ({found.how}{over}): {found.text}"[:200], since_us=max(0, found.since_us)
            )


def sender_of(key: keys.Key | None) -> str:
    """The unit that sent what arrived on a key; empty: it is not known."""
    match key:
        case keys.ActKey(sender=unit) | keys.HeartbeatKey(unit=unit) | keys.AnnouncementKey(unit=unit):
            return unit
        case keys.StreamKey(owner=unit) | keys.HistoryKey(owner=unit):
            return unit
    return ""


def place_of(do: Callable[..., object]) -> str:
    """Class and method of a callable."""
    while isinstance(do, partial):
        do = do.func
    part, name = getattr(do, "__self__", None), getattr(do, "__name__", "call")
    if part is not None and not isinstance(part, type):
        return f"{type(part).__name__}.{name}"
    return str(getattr(do, "__qualname__", type(do).__name__)).replace(".<locals>", "")


def _description(where: str, error: Exception) -> str:
    """Place, type and text of an error, unprintable characters replaced: the text may quote a message."""
    try:
        words = str(error)
    except Exception:  # noqa: BLE001  (of an extension's error, too)
        words = "?"
    words = " ".join("".join(each if each.isprintable() else " " for each in words[:_MAX_TEXT]).split())
    return f"{where}: {type(error).__name__}: {words} ({_place(error)})"[: _MAX_TEXT + 60]


def _place(error: Exception) -> str:
    """File and line of the innermost frame."""
    frames = traceback.extract_tb(error.__traceback__, limit=-1)
    return f"{PurePath(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "nowhere"


def _bound(kept: dict[str, Any]) -> None:
    while len(kept) > MOST:
        del kept[next(iter(kept))]
