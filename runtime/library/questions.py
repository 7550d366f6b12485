"""Questions to a federation and how its answers are read, for commands and programs alike."""

from collections.abc import Collection, Iterable, Sequence

from dyknow.model.errors import NothingFound, WrongCall, did_you_mean
from federation.keys import unit as unit_name
from federation.members.directory import unit_order
from federation.messages.acts import Performative
from federation.messages.contents import Content, Found, MonitorProximity, Query, Rejoin, Search
from federation.messages.dialogue import Dialogue
from runtime.client import Client, Job, Wait
from runtime.configuration.instants import instant_us

LOOK_S = 1.0


def query_of(label: str, at: str | int | None, between: Sequence[str | int] | None, now_us: int) -> Query:
    """The newest value of a label, its value at an instant, or all values between two; times are federation time.

    Raises:
        WrongCall: a text that is no instant, both given, or the later one first.
    """
    if at is not None and between is not None:
        raise WrongCall("--at asks for one instant, --between for a span: give one of them.")
    if at is not None:
        return Query(semantic_label=label, op="at", at_us=instant_us(str(at), now_us, option="--at"))
    if between is not None:
        first, last = between
        from_us, to_us = (instant_us(str(text), now_us, option="--between") for text in (first, last))
        if from_us > to_us:
            raise WrongCall(f"--between: {first} is later than {last}; write the earlier time first.")
        return Query(semantic_label=label, op="between", from_us=from_us, to_us=to_us)
    return Query(semantic_label=label)


def ask_who_is_missing(client: Client, units: Iterable[str]) -> list[Dialogue]:
    """Ask these platforms which ones they miss: one that timed out before this client came is unknown to it."""
    return [client.say(unit, Performative.QUERY_REF, Search(), within_s=LOOK_S) for unit in units]


def missing_units(units: Collection[str], around: list[Dialogue]) -> Job[list[str]]:
    """Wait for an answer to `ask_who_is_missing`; the platforms that others miss, without `units`."""
    yield Wait(lambda: not around or any(dialogue.results for dialogue in around), LOOK_S)
    found = [content for dialogue in around for content in dialogue.results if isinstance(content, Found)]
    return sorted({name for content in found for name in content.missing_units} - set(units), key=unit_order)


def check_label(client: Client, label: str, *, answered: bool) -> None:
    """Raises NothingFound, with the labels there are, if no platform answered because none has the label."""
    known = sorted({name for view in client.centre.platforms() for name in view.labels})
    if not answered and known and label not in known:
        raise NothingFound(f"no platform offers {label!r}.{did_you_mean(label, known)}")


def receiver_of(client: Client, content: Content, to: str | None) -> str:
    """The platform to delegate `content` to. One that has left may be requested to rejoin.

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
