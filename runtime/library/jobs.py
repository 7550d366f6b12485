"""The jobs of a connection for its program, step by step on the node thread."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.federation.keys import label as label_name
from dyknow.federation.members.command_centre import PlatformView
from dyknow.federation.members.directory import unit_order
from dyknow.federation.members.liveness import PeerState
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import (
    Answers,
    Content,
    CreateMonitor,
    CreateMulticast,
    Done,
    MonitorEntry,
    MonitorList,
    MonitorProximity,
    Monitors,
    Query,
    Reading,
    Samples,
    StreamSamples,
    TaskEntry,
    TaskList,
    Tasks,
    Verdict,
)
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.model.errors import ContentError, DyknowError, FederationFailed, Refused
from dyknow.runtime.client import SETTLE_S, Client, Job, Wait
from dyknow.runtime.configuration.wording import content_when, content_with
from dyknow.runtime.library.meanings import disagreement_with
from dyknow.runtime.library.questions import (
    Which,
    check_label,
    gone_text,
    missing_units,
    query_missing,
    query_of,
    receiver_of,
)
from dyknow.runtime.library.results import QueryResult, UnitSample, sample_of_reading
from dyknow.runtime.library.watched import WatchedStreams

if TYPE_CHECKING:
    from dyknow.runtime.library.feed import Feed  # asyncio takes commands a tenth of a second

P = Performative
C = TypeVar("C", bound=Content)
GRACE_S = 0.5
SET_UP_S = 2.0
MOST_LEADERS = 8
"""Platforms that one act permits to lead."""
_LOOK_S = 0.2


def platforms(client: Client, *, all_kinds: bool = False) -> Job[list[PlatformView]]:
    """Wait until the directory has settled; return the platforms."""
    yield Wait(client.is_settled, SETTLE_S)
    return client.centre.platforms(all_kinds=all_kinds)


def all_platforms(client: Client, *, all_kinds: bool = False) -> Job[list[PlatformView]]:
    """The same, with those that are gone without a good-bye; they are listed as gone until they return."""
    there = yield from platforms(client)
    alive = [view.unit for view in there if view.state == PeerState.ALIVE.value]
    missing = yield from missing_units((), query_missing(client, alive))
    there = client.centre.platforms(all_kinds=all_kinds)  # as it is now
    known, now_us = {view.unit for view in there}, client.now_us()
    gone = [
        PlatformView(unit, "uav", PeerState.GONE.value, None, now_us - ago_us)
        for unit, ago_us in missing.items()
        if unit not in known
    ]
    return sorted([*there, *gone], key=lambda view: unit_order(view.unit))


def query(client: Client, label: str, unit: str | None, which: Which, within: str) -> Job[QueryResult]:
    """Ask, and wait for all answers."""
    within_s = duration_us(within, option="within", least_us=SHORTEST_US) / 1e6
    query_of(label, which, client.federation_us())
    samples, missing = list[UnitSample](), dict[str, str]()

    def take(unit: str, readings: list[Reading], why: str, _answered_us: int) -> None:
        samples.extend(sample_of_reading(unit, label, reading) for reading in readings)
        if not readings:
            missing[unit] = why or "no sample"

    yield from platforms(client)
    yield from readings_of(client, label, unit, which, within_s, take)
    return QueryResult(sorted(samples, key=lambda sample: unit_order(sample.unit)), missing)


def readings_of(
    client: Client,
    label: str,
    unit: str | None,
    which: Which,
    within_s: float,
    take: Callable[[str, list[Reading], str, int], None],
) -> Job[None]:
    """Query a label; `take` gets what each platform answers, as soon as that is known.

    That is its name, its readings, why there are none, and when it answered, federation time by its own clock.
    """
    there = client.pick(None)
    around = query_missing(client, there) if unit is None or unit not in there else []
    missing = yield from missing_units(there, around if unit is not None else [])
    units = agreeing(
        client, label, [] if unit in missing else client.pick(unit), lambda name, why: take(name, [], why, 0)
    )
    content = query_of(label, which, client.federation_us())
    answered = False

    def take_answer(dialogue: Dialogue) -> None:
        nonlocal answered
        pages = [said for said in dialogue.results if isinstance(said, Samples | StreamSamples)]
        why = dialogue.trouble or ("" if pages else "no answer")
        readings = [] if why else [reading for page in pages for reading in page.samples]
        answered = answered or bool(readings)
        answered_us = max((act.created_us for act, _ in dialogue.said), default=0)
        take(dialogue.unit, readings, why, client.centre.clock.federation_us(answered_us))

    yield from client.answers(units, content, P.QUERY_REF, within_s, take_answer)
    for name, ago_us in (yield from missing_units(there, around)).items():
        if unit in {None, name}:
            take(name, [], gone_text(ago_us), 0)
    check_label(client, label, answered=answered)


def readings_via(client: Client, via: str, query: Query, within_s: float) -> Job[tuple[list[Answers], str]]:
    """Ask one platform, which asks all; its answers page by page, and why there are none (thesis 9.3.3)."""
    content = query.model_copy(update={"scope": "global"})
    [dialogue] = yield from client.answers(client.pick(via), content, P.QUERY_REF, within_s)
    pages = [said for said in dialogue.results if isinstance(said, Answers)]
    return pages, dialogue.trouble or ("" if pages else "no answer")


def agreeing(client: Client, label: str, units: Sequence[str], refused: Callable[[str, str], None]) -> list[str]:
    """The platforms that mean by the label what this program knows; `refused` gets the reason for each of the others."""
    reasons = {unit: disagreement_with(client, unit, label) for unit in units}
    for unit, why in reasons.items():
        if why:
            refused(unit, f"{label} is not shared: {why}")
    return [unit for unit, why in reasons.items() if not why]


def lists(client: Client, units: Sequence[str], content: Content, kind: type[C]) -> Job[list[tuple[str, C]]]:
    """The answers of platforms about themselves, with their names; failures go to `on_trouble` of the client."""
    dialogues = yield from client.answers(units, content, P.QUERY_REF, SET_UP_S)
    for unit, why in ((one.unit, one.trouble) for one in dialogues if one.trouble):
        client.on_trouble(unit, why)
    return [(one.unit, said) for one in dialogues for said in one.results if isinstance(said, kind)]


def monitors(client: Client, *, explain: bool = False) -> Job[list[MonitorEntry]]:
    """Ask every platform for its monitors, by platform, name and units."""
    yield from platforms(client)
    found = yield from lists(client, client.pick(None), Monitors(explain=explain or None), MonitorList)
    own = [m for unit, said in found for m in said.monitors if m.by == unit]  # of its own monitors only
    return sorted(own, key=lambda m: (m.by, m.name, m.units))


def tasks(client: Client, units: Sequence[str]) -> Job[list[tuple[str, TaskEntry]]]:
    """Ask these platforms for their tasks; with the platform that answers."""
    listed = yield from listed_tasks(client, units)
    return [(unit, task) for unit, task in listed if task.ended_by is None]


def listed_tasks(client: Client, units: Sequence[str]) -> Job[list[tuple[str, TaskEntry]]]:
    """The same, with those that a platform ended without a request."""
    answers = yield from lists(client, units, Tasks(), TaskList)
    return [(unit, task) for unit, answer in answers for task in answer.tasks]


def request_streams(
    client: Client,
    label: str,
    units: Sequence[str],
    every_s: float,
    delay_s: float,
    from_us: int | None = None,
    to_us: int | None = None,
) -> Job[list[Dialogue]]:
    """Have platforms export a stream to us; each dialogue has results, a refusal or no answer.

    `from_us`: where the grid of the samples begins; None: at the epoch. `to_us`: the last valid time that is wanted, if any.
    """
    content = CreateMulticast(
        semantic_labels=(label,),
        sample_period_s=every_s,
        delay_s=delay_s,
        to_units=(client.centre.unit,),
        from_us=from_us,
        to_us=to_us,
    )
    asked = [client.say(name, P.REQUEST, content, within_s=SET_UP_S, standing=True) for name in units]
    yield Wait(lambda: all(task.results or task.trouble for task in asked), SET_UP_S + GRACE_S)
    return asked


def watch(
    client: Client,
    streams: WatchedStreams,
    label: str,
    unit: str | None,
    every: str,
    max_delay: str,
    feed: "Feed[UnitSample]",
) -> Job[Job[None]]:
    """Have platforms export a stream to us; returns the job that ends that when the feed is closed."""
    from dyknow.agents.exchange.gateway import stream_policy

    label_name(label)
    every_s = duration_us(every, option="every", least_us=SHORTEST_US) / 1e6
    delay_s = duration_us(max_delay, option="max_delay", least_us=SHORTEST_US) / 1e6
    yield from platforms(client)
    units = client.pick(unit)
    remove = streams.add((label, stream_policy(every_s, delay_s).content_hash()), units, feed)
    asked = yield from request_streams(client, label, units, every_s, delay_s)
    tasks = [task for task in asked if task.results]
    if not tasks:
        remove()
        check_label(client, label, answered=False)
        raise failure_of(asked[0], f"no platform streams {label}")
    return _keep_streams(client, tasks, feed, remove)


def _keep_streams(
    client: Client, tasks: list[Dialogue], feed: "Feed[UnitSample]", remove: Callable[[], None]
) -> Job[None]:
    try:
        while not (feed.is_closed or all(task.over for task in tasks)):
            yield Wait(lambda: feed.is_closed or all(task.over for task in tasks), _LOOK_S)
        feed.close(FederationFailed(f"the streams have ended: {tasks[0].trouble or 'their platforms are gone'}"))
    finally:
        feed.close()
        remove()
        for task in tasks:
            if not task.over:
                client.cancel(task.unit, task.conversation)


class Subscriptions:
    """A subscription to every platform that is there, those that appear later included."""

    def __init__(self, client: Client, content: Content) -> None:
        self._client, self._content = client, content
        self._open: dict[str, Dialogue] = {}
        self._refused = set[str]()

    def news(self, within_s: float) -> Job[list[tuple[str, Content]]]:
        """Wait a moment; returns the news since the last call, with the platform that sent each."""
        for view in self._client.centre.platforms():
            known = self._open.get(view.unit)
            if view.state != "alive":
                self._refused.discard(view.unit)
            elif view.unit not in self._refused and (known is None or known.over):
                self._open[view.unit] = self._client.say(view.unit, P.SUBSCRIBE, self._content, standing=True)
        yield Wait(lambda: any(one.said for one in self._open.values()), within_s)
        found = [(unit, content) for unit, one in self._open.items() for content in one.results]
        self._refused.update(unit for unit, one in self._open.items() if one.refusal is not None)
        for one in self._open.values():
            one.said.clear()
        return found

    def cancel(self) -> None:
        """End them."""
        for unit, one in self._open.items():
            if not one.over:
                self._client.cancel(unit, one.conversation)


# Tasks


def begin_task(
    client: Client,
    task: str,
    to: str | None,
    given: Mapping[str, Any],
    within_s: float,
    when: tuple[str, str] | None = None,
) -> Job[Dialogue]:
    """Request a task of the platform that shall do it, `when` a formula is true within a time; its answers follow."""
    content_with(task, given, client.federation_us(), client.extensions)
    yield from platforms(client)  # the federation's clock may be learned meanwhile
    content = content_with(task, given, client.federation_us(), client.extensions)
    unit = receiver_of(client, content, to)
    how, what = (P.REQUEST, content) if when is None else (P.REQUEST_WHEN, content_when(content, *when))
    return client.say(unit, how, what, within_s=within_s, standing=True)


def running_already(client: Client, task: str, to: str | None, given: Mapping[str, Any]) -> Job[TaskEntry | None]:
    """The task that monitors already what this request asks for, wherever it is coordinated; None if there is none.

    A request with a period or delay of its own goes to its platform, which knows whether they fit what runs. A platform
    is believed about a task if it coordinates the task itself, not for another platform, and every platform has the
    monitors: a second task costs little, a missing one all monitoring.
    """
    from dyknow.agents.tasks.requests import DEFAULT_TASK

    content = content_with(task, given, client.federation_us(), client.extensions)
    if not isinstance(content, MonitorProximity | CreateMonitor):
        return None
    if content.sample_period_s is not None or content.delay_s is not None:
        return None
    there = yield from platforms(client)
    if isinstance(content, CreateMonitor):
        asked, avoidance = [receiver_of(client, content, to)], None
        wanted: tuple[str, ...] = (content.name,)
    else:
        asked = [view.unit for view in there if view.state == PeerState.ALIVE.value]
        wanted = DEFAULT_TASK if content.profile is None else (content.profile,)
        avoidance = content.avoidance is not False
    running = [
        entry
        for unit, entry in (yield from tasks(client, asked))
        if (entry.task, entry.monitors, entry.avoidance, entry.unit) == (task, wanted, avoidance, unit)
        and not _is_of_platform(client, entry)
    ]
    if not running:
        return None
    having = {(monitor.by, monitor.name) for monitor in (yield from monitors(client))}
    return running[0] if {(unit, name) for unit in asked for name in wanted} <= having else None


def _is_of_platform(client: Client, entry: TaskEntry) -> bool:
    """Whether a platform delegated it, which may end it, and not a command centre."""
    delegator = "" if entry.delegator is None else entry.delegator.partition("@")[2]
    found = client.centre.member.directory.entry(delegator)
    return (found is not None and found.kind == "uav") or not entry.conversation.startswith(f"{delegator}-")


def delegate(
    client: Client,
    task: str,
    to: str | None,
    given: Mapping[str, Any],
    within: str,
    when: tuple[str, str] | None = None,
) -> Job[Dialogue]:
    """Delegate a task; returns its conversation once it is agreed to, or raises why it is not."""
    within_s = duration_us(within, option="within", least_us=SHORTEST_US) / 1e6
    dialogue = yield from begin_task(client, task, to, given, within_s, when)
    yield Wait(lambda: bool(dialogue.said or dialogue.over), within_s + GRACE_S)
    if dialogue.trouble is not None or not dialogue.said:
        raise failure_of(dialogue, "no answer in time")
    return dialogue


def follow_task(dialogue: Dialogue, feed: "Feed[Content]") -> Job[None]:
    """Pass on the platform's reports, until the task is over or the feed is closed."""
    seen = 0

    def has_news() -> bool:
        return feed.is_closed or len(dialogue.said) > seen or dialogue.over

    try:
        while not feed.is_closed:
            for _, content in dialogue.said[seen:]:
                if content is not None:
                    feed.put(content)
            seen = len(dialogue.said)
            if state_of(dialogue) != "running":
                feed.close(None if dialogue.trouble is None else failure_of(dialogue, "it ended"))
            yield Wait(has_news, _LOOK_S)
    finally:
        feed.close()


def state_of(dialogue: Dialogue) -> str:
    """`running`, `done` or `failed`."""
    if any(isinstance(content, Done | Verdict) for content in dialogue.results):
        return "done"
    return "failed" if dialogue.trouble is not None else "done" if dialogue.over else "running"


def cancel(client: Client, unit: str, conversation: str) -> Job[None]:
    """End a task and all that it set up."""
    end = client.cancel(unit, conversation)
    yield Wait(lambda: end.over, SET_UP_S + GRACE_S)
    if end.trouble is not None or not end.said:
        raise failure_of(end, "no answer in time")
    client.over(conversation)


def failure_of(dialogue: Dialogue, otherwise: str) -> DyknowError:
    """The error for a conversation that did not succeed: Refused, ContentError or FederationFailed."""
    text = f"platform {dialogue.unit}: {dialogue.trouble or otherwise}"
    performative, reason = dialogue.refusal or (None, None)
    if performative is P.NOT_UNDERSTOOD:
        return ContentError(text)
    if performative is P.REFUSE and reason is not None:
        return Refused(text, reason.code or "", leader=reason.leader, generation=reason.generation)
    return FederationFailed(text)
