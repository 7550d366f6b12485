"""Questions to a federation and how its answers are read, for commands and programs alike."""

from collections.abc import Callable, Collection, Iterable, Sequence
from functools import partial
from typing import NamedTuple

from dyknow.federation.keys import label as label_name
from dyknow.federation.keys import unit as unit_name
from dyknow.federation.members.directory import unit_order
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import (
    Content,
    MonitorProximity,
    Query,
    QueryStream,
    Rejoin,
    Search,
    SearchResult,
)
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.model.errors import NothingFound, WrongCall, did_you_mean
from dyknow.model.instants import US_PER_S, print_span
from dyknow.model.labels import Label
from dyknow.runtime.client import Client, Job, Wait
from dyknow.runtime.configuration.instants import instant_us

LOOK_S = 1.0
GRACE_S = 0.2
"""For platforms that answer later than the first."""


class Which(NamedTuple):
    """Which samples of a stream are asked for: the newest, unless one of these is given.

    Attributes:
        at: that valid at an instant.
        between: all valid between two.
        last: the number of those that came last.
        nth: the n-th before the one that came last.
        slice: by number, the first and the last, both included; the oldest that a platform holds is the 0-th.
    """

    at: str | int | None = None
    between: Sequence[str | int] | None = None
    last: int | None = None
    nth: int | None = None
    slice: Sequence[int] | None = None

    @property
    def is_newest(self) -> bool:
        return self == Which()

    def check(self) -> None:
        """Raises WrongCall if more than one is given, or a number that counts nothing."""
        given = [f"--{name}" for name, value in self._asdict().items() if value is not None]
        if len(given) > 1:
            raise WrongCall(f"{' and '.join(given)} ask for different samples: give one of them.")
        if self.last is not None and self.last < 1:
            raise WrongCall(f"--last: {self.last} samples are none; write 1 or more.")
        if self.nth is not None and self.nth < 0:
            raise WrongCall(f"--nth: {self.nth} lies after the newest sample, which is 0; write 0 or more.")
        if self.slice is not None and not 0 <= self.slice[0] <= self.slice[1]:
            raise WrongCall(
                f"--slice: {self.slice[0]} to {self.slice[1]}: write two numbers from 0 on, the lower first."
            )


def query_of(label: str, which: Which, now_us: int) -> Query | QueryStream:
    """The question for these samples of a label; times are federation time.

    A label with objects, `speed[self]`, is the platform's own for one of its streams.

    Raises:
        WrongCall: as `Which.check`, a text that is no instant, or the later one first.
    """
    which.check()
    at, between = which.at, which.between
    if is_own_label(label):
        ask: Callable[..., Query | QueryStream] = partial(QueryStream, stream=str(Label.parse(label)))
    else:
        ask = partial(Query, semantic_label=label_name(label))
    if at is not None:
        return ask(op="at", at_us=instant_us(str(at), now_us, option="--at"))
    if between is not None:
        first, last = between
        from_us, to_us = (instant_us(str(text), now_us, option="--between") for text in (first, last))
        if from_us > to_us:
            raise WrongCall(f"--between: {first} is later than {last}; write the earlier time first.")
        return ask(op="between", from_us=from_us, to_us=to_us)
    if which.last is not None:
        return ask(op="last", n=which.last)
    if which.nth is not None:
        return ask(op="nth", n=which.nth)
    if which.slice is not None:
        return ask(op="slice", i=which.slice[0], j=which.slice[1])
    return ask()


def check_name(label: str) -> None:
    """Raises TextError, NameRefused: it is no label that can be asked for."""
    Label.parse(label) if is_own_label(label) else label_name(label)


def check_streamed(label: str) -> None:
    """Raise WrongCall for a platform's own label, NameRefused for a text that is none: streams have semantic labels."""
    if is_own_label(label):
        raise WrongCall(
            f"{label} is what a platform's own instance calls a stream: dyknow query {label} has its samples; to have it "
            f"streamed, export it there under a semantic label (export NAME = {label}) and give that name."
        )
    label_name(label)


def is_own_label(label: str) -> bool:
    """Whether this is how a platform's own instance calls a stream, `speed[self]`, and no semantic label."""
    return "[" in label


def query_missing(client: Client, units: Iterable[str]) -> list[Dialogue]:
    """Ask these platforms which ones they miss: a platform that timed out before this client came is unknown to it."""
    return [client.say(unit, Performative.QUERY_REF, Search(), within_s=LOOK_S) for unit in units]


def missing_units(units: Collection[str], around: list[Dialogue]) -> Job[dict[str, int]]:
    """Wait for answers to `query_missing`; the platforms that others miss, without `units`.

    With each comes how long ago it was last heard by any of those that miss it, in microseconds.
    """
    yield Wait(lambda: not around or any(dialogue.results for dialogue in around), LOOK_S)
    yield Wait(lambda: all(dialogue.over for dialogue in around), GRACE_S)
    ago: dict[str, int] = {}
    for act, content in (said for dialogue in around for said in dialogue.said):
        if isinstance(content, SearchResult):
            for name, since_us in zip(content.missing_units, content.missing_since, strict=False):
                heard_us = max(0, act.created_us - since_us)  # both by the clock of the platform that answers
                ago[name] = min(heard_us, ago.get(name, heard_us))
    return {name: ago[name] for name in sorted(ago.keys() - set(units), key=unit_order)}


def gone_text(ago_us: int) -> str:
    """`gone 12 s ago`."""
    ago_s = max(1, ago_us // US_PER_S)
    return f"gone {f'{ago_s} s' if ago_s < 60 else print_span(ago_s * US_PER_S)} ago"


def age_of(client: Client, unit: str, label: str, valid_us: int, answered_us: int) -> tuple[int, bool]:
    """How old a sample was when its platform answered, in microseconds of federation time, and whether it is stale.

    Both times are of that platform's clock, so that it does not matter how far it is off.
    """
    entry = client.centre.member.directory.entry(unit)
    age_us = max(0, answered_us - valid_us)
    periods = (one.period_us for one in (entry.labels if entry else ()) if one.label == label)
    return age_us, is_stale(client, age_us, next(periods, 1))


def is_stale(client: Client, age_us: int, period_us: int) -> bool:
    """Whether a sample is older than its policy allows: three periods, and a second by the wall.

    Ages and periods are of federation time. A stream without a period has samples only on changes, and is not stale.
    """
    return period_us > 0 and age_us > max(3 * period_us, round(US_PER_S * client.centre.clock.speed))


def check_label(client: Client, label: str, *, answered: bool) -> None:
    """Raises NothingFound, with the labels there are, if no platform answered because none has the label."""
    if is_own_label(label):
        return
    there = client.centre.platforms()
    known = sorted({name for view in there for name in view.labels})
    if answered or label in known:
        return
    declaring = [view.unit for view in there if view.entry is not None and label in view.entry.definitions]
    if declaring:
        raise NothingFound(
            f"no platform offers {label!r}; platform {', '.join(declaring)} knows the label and exports no stream "
            f"under it: add `export {label} = STREAM` to its specification."
        )
    if known:
        meant = f" Known: {', '.join(known)}." if label in client.ontology else did_you_mean(label, known)
        raise NothingFound(f"no platform offers {label!r}.{meant}")


def receiver_of(client: Client, content: Content, to: str | None) -> str:
    """The platform to delegate `content` to. A platform that has left may be requested to rejoin.

    Raises:
        WrongCall: it was not named, and there are several.
        NothingFound: it is not there.
    """
    if isinstance(content, Rejoin):
        if to is None:
            raise WrongCall("--to: name the platform that shall rejoin; one that has left is not listed.")
        return unit_name(to)
    units = client.pick(to)
    if len(units) > 1 and not isinstance(content, MonitorProximity):
        raise WrongCall(f"--to: name the platform that shall do it; there are {', '.join(units)}.")
    return units[0]
