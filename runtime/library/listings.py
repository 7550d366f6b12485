"""Listings of all platforms: their tasks, objects and acts; and the end of a task by its name."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from dyknow.federation.messages.contents import ActList, ActLog, ObjectList, TaskEntry
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.model.errors import NothingFound, WrongCall
from dyknow.runtime.client import Client, Job, Wait
from dyknow.runtime.library import jobs


class ListedObject(NamedTuple):
    """One object as a platform sees it: its newest state in one of its streams.

    Attributes:
        by: the platform.
        type: the sort of its states, or their field `type`.
        attributes: the fields of the state, in the units of its sort.
    """

    by: str
    symbol: str
    type: str
    stream: str
    valid_us: int
    attributes: Mapping[str, Any]


def tasks(client: Client) -> Job[list[TaskEntry]]:
    """Of all platforms; raises NothingFound: none is there."""
    yield from jobs.platforms(client)
    return [task for _, task in (yield from jobs.listed_tasks(client, client.pick(None)))]


def conversation_of(client: Client, beginning: str) -> Job[list[tuple[str, str]]]:
    """The task whose conversation is, or begins, so: each platform that has it, with the whole name.

    Raises:
        NothingFound: no platform has it.
        WrongCall: several begin so.
    """
    yield from jobs.platforms(client)
    listed = yield from jobs.tasks(client, client.pick(None))
    found = [(unit, task.conversation) for unit, task in listed]
    named = sorted({name for _, name in found if name.startswith(beginning)})
    if beginning in named:
        named = [beginning]
    if not named:
        raise NothingFound(f"no platform has a task {beginning!r}; dyknow tasks lists those there are.")
    if len(named) > 1:
        raise WrongCall(f"CONVERSATION: {beginning!r} is the beginning of {', '.join(named)}; write more of it.")
    return [(unit, name) for unit, name in found if name == named[0]]


def cancel(client: Client, conversation: str) -> Job[list[Dialogue]]:
    """End a task at each platform that has it, and have the others know; returns the answers.

    Raises:
        NothingFound, WrongCall: as `conversation_of`.
        Refused, FederationFailed: no platform ended it; why the first did not.
    """
    ends = [client.cancel(unit, name) for unit, name in (yield from conversation_of(client, conversation))]
    yield Wait(lambda: all(end.over for end in ends), jobs.SET_UP_S + jobs.GRACE_S)
    failed = [end for end in ends if end.trouble is not None or not end.said]
    if len(failed) == len(ends):
        raise jobs.failure_of(failed[0], "no answer in time")
    client.over(ends[0].conversation)
    return ends


def objects(client: Client, unit: str | None, type_: str | None) -> Job[list[ListedObject]]:
    """Of one platform or of all, by platform, stream and symbol; of one type or one stream if that is named."""
    yield from jobs.platforms(client)
    answers = yield from jobs.lists(client, client.pick(unit), ObjectList(type=type_), ObjectList)
    found = [
        ListedObject(by, each.symbol, each.type, each.stream, each.valid_us, dict(each.attributes))
        for by, said in answers
        for each in said.objects or ()
    ]
    return sorted(found, key=lambda each: (each.by, each.stream, each.symbol))


def acts(client: Client, unit: str | None) -> Job[list[ActLog]]:
    """That one platform or all remember, by time."""
    yield from jobs.platforms(client)
    answers = yield from jobs.lists(client, client.pick(unit), ActList(), ActList)
    return sorted((one for _, said in answers for one in said.acts or ()), key=lambda one: one.at_us)
