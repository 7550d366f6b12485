"""A member's record of a federation: streams, alarms, monitors, speech acts, tasks and the directory.

The member is the one that every command is (`dyknow.runtime.client`): it asks each platform for its streams and
subscribes to the rest, again whenever a platform is back. A platform's messages may fill its own share of the file
only.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

from dyknow.federation.members.command_centre import PlatformView
from dyknow.federation.members.imports import ImportName
from dyknow.federation.members.liveness import PeerState
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.codec import StreamSample
from dyknow.federation.messages.contents import (
    ActLog,
    Acts,
    Alarm,
    AlarmList,
    Alarms,
    Content,
    CreateMulticast,
    FlightOutlook,
    ImportList,
    MissionList,
    MissionQuery,
    MonitorChange,
    MonitorChanges,
    MonitorList,
    Monitors,
    TaskList,
    Tasks,
)
from dyknow.federation.messages.descriptions import DefinitionEntry
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.federation.messages.rounds import Retries
from dyknow.model.values import NO_VALUE, as_json
from dyknow.runtime.client import Client
from dyknow.runtime.library.jobs import SET_UP_S, Subscriptions
from dyknow.runtime.library.meanings import meaning_to, record_of
from dyknow.runtime.recorder.entries import alarm_json, change_in_words, monitor_json, parsed_act
from dyknow.runtime.recorder.pictures import Pictures
from dyknow.runtime.recordings import foxglove
from dyknow.runtime.recordings.recording_file import (
    ACT,
    ALARM,
    FLIGHTS,
    IMPORTS,
    LOST,
    MISSIONS,
    MONITOR,
    PLATFORM,
    SAMPLE,
    TASK,
)

P = Performative
PERIOD_US: Final = 100_000
"""Of streams that are offered without a period."""
BYTES_PER_S, BYTES_AT_ONCE = 500_000, 4_000_000
"""The share of one platform in a recording."""
LIST_US: Final = 10_000_000
_LISTS: Final = (Monitors(), Tasks(), ImportList(), MissionQuery())
_FLIGHT: Final = "flight"
"""The service whose platforms say where they will fly."""
_DELAY_S = 1.0
_AGAIN_US = 5_000_000
_STEP_S = 0.1
_RECORDED = {P.REQUEST, P.REQUEST_WHEN, P.AGREE, P.REFUSE, P.FAILURE, P.CANCEL}


class Sink(Protocol):
    """Takes what is recorded: a file, or whatever else passes it on.

    `add` takes topic, schema, message, when it came and when it held (federation time), and returns its bytes, 0 if it is
    not kept; `on_time` is called with every step.
    """

    def add(
        self, topic: str, schema: str, message: Mapping[str, Any], at_us: int, valid_us: int | None = None, /
    ) -> int: ...
    def on_time(self) -> None: ...


@dataclass(slots=True)
class _Share:
    """Of the file, of one platform: bytes that it may still add; `over` were not kept since that was reported."""

    left: float = BYTES_AT_ONCE
    at_us: int = 0
    over: int = 0

    def is_spent(self, now_us: int) -> bool:
        self.left = min(BYTES_AT_ONCE, self.left + (now_us - self.at_us) * BYTES_PER_S / 1e6)
        self.at_us = now_us
        return self.left <= 0


@dataclass(slots=True)
class _Peer:
    """One platform as it is recorded: its life, the version that was described, and the questions to it."""

    boot: int = -1
    version: int = -1
    state: str = ""
    streams: dict[str, Dialogue] = field(default_factory=dict)
    retries: Retries[str] = field(default_factory=lambda: Retries(_AGAIN_US))
    lists: list[Dialogue] = field(default_factory=list)
    listed_us: int = 0


class Recorder:
    """Records until `close`. Step it; times are the node clock, in the file federation time.

    Args:
        client: a member.
        file: takes what is recorded, such as a `RecordingFile`.
        labels: the wanted streams; none: all that are offered.
        every_us: their period; None: as they are offered.
        note: takes words for users, such as that a platform refuses a stream.
        list_us: how often monitors, tasks, imports and missions are asked for.
        is_watched: for a view of now: nothing is drawn for other programs, and acts with this member are kept as well.

    Attributes:
        counts: how many messages of each kind are in the file.
    """

    def __init__(
        self,
        client: Client,
        file: Sink,
        labels: Iterable[str] = (),
        every_us: int | None = None,
        note: Callable[[str], None] = lambda _text: None,
        list_us: int = LIST_US,
        *,
        is_watched: bool = False,
    ) -> None:
        self._client, self._file, self._labels, self._every_us = client, file, frozenset(labels), every_us
        self.list_us, self._is_watched = list_us, is_watched
        self._note, self.counts = note, Counter[str]()
        self._since_us = client.federation_us()
        self._peers: dict[str, _Peer] = {}
        self._shares: dict[str, _Share] = {}
        self._noted, self._edges, self._listed = set[str](), dict[tuple[str, str], None](), dict[str, Any]()
        self._tasks: dict[str, dict[str, dict[str, Any]]] = {}
        self._news = [Subscriptions(client, content) for content in (Alarms(), MonitorChanges(), Acts())]
        self._pictures = Pictures(self._picture)
        client.centre.on_sample = self._on_sample

    @property
    def streams(self) -> int:
        """How many streams come."""
        return sum(
            not asked.over and bool(asked.results) for peer in self._peers.values() for asked in peer.streams.values()
        )

    @property
    def units(self) -> list[str]:
        """The platforms that are recorded."""
        return list(self._peers)

    def step(self, within_s: float = _STEP_S) -> None:
        """Take the messages of a moment, and ask for streams that do not come yet."""
        now_us = self._client.now_us()
        for view in self._client.centre.platforms():
            self._look_at(view, now_us)
        for unit in self._peers.keys() - {view.unit for view in self._client.centre.platforms()}:
            self._changed(unit, "gone")
        for at, news in enumerate(self._news):
            is_last = at == len(self._news) - 1
            for unit, content in self._client.run(news.news(within_s if is_last else 0)):
                self._take(unit, content)
        self._file.on_time()

    def close(self) -> None:
        """End what was asked for."""
        for news in self._news:
            news.cancel()
        open_ones = [asked for peer in self._peers.values() for asked in peer.streams.values() if not asked.over]
        ends = [self._client.cancel(asked.unit, asked.conversation) for asked in open_ones]
        self._client.wait_for(lambda: all(end.over for end in ends), SET_UP_S)

    # -- platforms ---------------------------------------------------------------------------------------------

    def _look_at(self, view: PlatformView, now_us: int) -> None:
        peer = self._peers.setdefault(view.unit, _Peer())
        if view.entry is None or not view.entry.version:
            return
        self._changed(view.unit, view.state)
        if view.state != PeerState.ALIVE.value:
            return
        if peer.boot != view.entry.boot:
            peer.boot, peer.version, peer.listed_us = view.entry.boot, -1, 0
            peer.lists.append(self._client.say(view.unit, P.QUERY_REF, AlarmList(), within_s=SET_UP_S))
        if peer.version != view.entry.version:
            peer.version = view.entry.version
            self._describe(view)
        if now_us >= peer.listed_us + self.list_us:
            peer.listed_us = now_us
            flies = any(service.service == _FLIGHT for service in view.entry.services)
            asked_for = (*_LISTS, FlightOutlook()) if flies else _LISTS
            peer.lists += [self._client.say(view.unit, P.QUERY_REF, content) for content in asked_for]
        self._ask_for_streams(view, peer, now_us)
        for asked in peer.lists[:]:
            if asked.over:
                peer.lists.remove(asked)
                pages = [content for content in asked.results if isinstance(content, AlarmList)]
                self._on_remembered(view.unit, [alarm for page in pages for alarm in page.alarms or ()])
                for content in asked.results:
                    self._take(view.unit, content)

    def _changed(self, unit: str, state: str) -> None:
        peer = self._peers[unit]
        if peer.state == state:
            return
        level = foxglove.INFO if state == PeerState.ALIVE.value else foxglove.WARNING
        is_first, peer.state = not peer.state, state
        self._say(level, f"platform {unit} is {'there' if is_first and level == foxglove.INFO else state}", unit)
        self._keep(unit, "/directory", PLATFORM, {"unit": unit, "state": state})

    def _describe(self, view: PlatformView) -> None:
        entry = view.entry
        assert entry is not None  # noqa: S101  (who calls has looked)
        meanings = [meaning_to(self._client, view.unit, label.label) for label in entry.labels]
        record = {
            "unit": view.unit,
            "state": view.state,
            "kind": view.kind,
            "boot": entry.boot,
            "version": entry.version,
            "labels": [label.model_dump(mode="json") for label in entry.labels],
            "definitions": [DefinitionEntry.of(each).model_dump(mode="json") for each in meanings if each is not None],
            "services": [service.service for service in entry.services],
            "conditions": [each.text for each in entry.conditions],
        }
        self._keep(view.unit, "/directory", PLATFORM, record)

    def _ask_for_streams(self, view: PlatformView, peer: _Peer, now_us: int) -> None:
        assert view.entry is not None  # noqa: S101  (who calls has looked)
        for offered in view.entry.labels:
            label, asked = offered.label, peer.streams.get(offered.label)
            if offered.cost is not None or (self._labels and label not in self._labels):
                continue
            if asked is not None and asked.trouble is not None:
                self._note_once(f"platform {view.unit}: {label} is not recorded: {asked.trouble}")
            if (asked is None or asked.over) and peer.retries.is_due(label, now_us):
                peer.retries.asked(label, now_us)
                period_us = self._every_us or offered.period_us or PERIOD_US
                content = CreateMulticast(
                    semantic_labels=(label,),
                    sample_period_s=period_us / 1e6,
                    delay_s=_DELAY_S,
                    to_units=(self._client.centre.unit,),
                )
                peer.streams[label] = self._client.say(view.unit, P.REQUEST, content, within_s=SET_UP_S, standing=True)

    def _note_once(self, text: str) -> None:
        if text not in self._noted and len(self._noted) < BYTES_AT_ONCE // 1000:
            self._noted.add(text)
            self._note(text)
            self._say(foxglove.WARNING, text, "recorder")

    # -- what comes --------------------------------------------------------------------------------------------

    def _on_sample(self, name: ImportName, sample: StreamSample, at_us: int) -> None:
        unit, label, _ = name
        value = None if sample.value is NO_VALUE else record_of(self._client, unit, label, sample.value)
        record = {
            "unit": unit,
            "label": label,
            "valid_us": sample.valid_us,
            "available_us": self._client.centre.clock.federation_us(at_us),
            "value": None if value is None else {field: as_json(part) for field, part in value.items()},
        }
        quality = sample.quality
        if quality.certainty != 1.0:
            record["certainty"] = quality.certainty
        if quality.covariance:
            record["covariance"] = quality.covariance
        if quality.prediction is not None:
            record["prediction"] = [*quality.prediction]
        self._keep(unit, f"/{unit}/{label}", SAMPLE, record, sample.valid_us)
        if value is not None and not self._is_watched:
            self._pictures.on_sample(unit, label, value, sample)

    def _take(self, unit: str, content: Content) -> None:
        """Take a platform's report about itself: about others it is not believed."""
        match content:
            case Alarm() if content.by == unit:
                self._on_alarm(content)
            case MonitorChange() if content.by == unit:
                self._keep(unit, "/monitors", MONITOR, {"change": content.event, **monitor_json(content)})
                self._say(
                    foxglove.WARNING if content.event == "unknown" else foxglove.INFO, change_in_words(content), unit
                )
            case MonitorList():
                for entry in content.monitors:
                    if entry.by == unit:
                        name = f"{unit} {entry.name} {entry.units}"
                        self._keep_news(name, unit, "/monitors", MONITOR, monitor_json(entry))
            case TaskList():
                self._end_tasks(unit, {task.conversation for task in content.tasks})
                for task in content.tasks:
                    is_own = (task.delegator or "").endswith(f"@{self._client.centre.unit}")
                    if is_own and not (self._is_watched and task.task != CreateMulticast.head):
                        continue
                    record = {"by": unit, **task.model_dump(mode="json", exclude_none=True)}
                    self._tasks.setdefault(unit, {})[task.conversation] = record
                    self._keep_news(f"{unit} {task.conversation}", unit, "/tasks", TASK, record)
            case ImportList():
                self._keep_list(unit, "/imports", IMPORTS, content.model_dump(mode="json", exclude_none=True))
            case MissionList():
                self._keep_list(unit, "/missions", MISSIONS, content.model_dump(mode="json", exclude_none=True))
            case FlightOutlook():
                outlook = {"by": unit, **content.model_dump(mode="json", exclude_none=True)}
                self._keep_news(f"/flights {unit}", unit, "/flights", FLIGHTS, outlook)
            case ActLog():
                self._on_act(unit, content)
            case _:
                pass

    def _on_remembered(self, unit: str, alarms: list[Alarm]) -> None:
        """Both edges of an alarm of before: kept if it was open during this recording, so unless it closed before that."""
        earlier = {alarm.id for alarm in alarms if alarm.event != "opened" and alarm.detected_us < self._since_us}
        for alarm in alarms:
            if alarm.by == unit and alarm.id not in earlier:
                self._on_alarm(alarm)

    def _on_alarm(self, alarm: Alarm) -> None:
        if (alarm.id, alarm.event) in self._edges:
            return
        self._edges[alarm.id, alarm.event] = None
        if len(self._edges) > MOST_EDGES:
            del self._edges[next(iter(self._edges))]
        self._keep(alarm.by, "/alarms", ALARM, alarm_json(alarm), alarm.valid_us)
        level = foxglove.ERROR if alarm.event == "opened" else foxglove.INFO
        self._say(level, f"{alarm.monitor} of {', '.join(alarm.units)} by {alarm.by} {alarm.event}", alarm.by)
        self._pictures.on_alarm(alarm)

    def _on_act(self, unit: str, log: ActLog) -> None:
        if log.peer == self._client.centre.unit and not self._is_watched:
            return
        record = {"by": unit, **log.model_dump(mode="json", exclude_none=True)}
        self._keep(unit, "/acts", ACT, record)
        act = parsed_act(log)
        if act is not None and log.direction == "out" and act.performative in _RECORDED:
            head = "" if act.content is None else f" {act.content.head}"
            self._say(foxglove.INFO, f"{unit} to {log.peer}: {act.performative.value}{head}", unit)

    # -- into the file -----------------------------------------------------------------------------------------

    def _keep_news(self, name: str, unit: str, topic: str, schema: str, record: Mapping[str, Any]) -> None:
        """Keep what is listed again and again where it has changed."""
        if self._listed.get(name) != record and len(self._listed) < MOST_EDGES:
            self._listed[name] = record
            self._keep(unit, topic, schema, record)

    def _end_tasks(self, unit: str, listed: set[str]) -> None:
        """The tasks that a platform had are over once it lists them no more."""
        had = self._tasks.get(unit, {})
        for conversation in had.keys() - listed:
            ended = {**had.pop(conversation), "state": "ended"}
            self._keep_news(f"{unit} {conversation}", unit, "/tasks", TASK, ended)

    def _keep_list(self, unit: str, topic: str, schema: str, listed: Mapping[str, Any]) -> None:
        """Keep what one platform lists, if it is something, or was."""
        if any(isinstance(each, list) and each for each in listed.values()) or f"{topic} {unit}" in self._listed:
            self._keep_news(f"{topic} {unit}", unit, topic, schema, {"by": unit, **listed})

    def _picture(self, unit: str, topic: str, schema: str, message: Mapping[str, Any], valid_us: int) -> None:
        self._keep(unit, topic, schema, message, valid_us)

    def _say(self, level: int, text: str, about: str) -> None:
        now_us = self._client.federation_us()
        self._keep(about, "/log", foxglove.LOG, foxglove.log_entry(now_us, level, text, about))

    def _keep(
        self, unit: str, topic: str, schema: str, message: Mapping[str, Any], valid_us: int | None = None
    ) -> None:
        share, now_us = self._shares.setdefault(unit, _Share()), self._client.federation_us()
        if share.is_spent(self._client.now_us()):
            share.over += 1
            return
        if share.over:
            over, share.over = share.over, 0
            self._note_once(f"platform {unit} sends more than a recording takes of one; what is over is counted")
            self._file.add("/lost", LOST, {"unit": unit, "messages": over, "why": "more than one may send"}, now_us)
        size = self._file.add(topic, schema, message, now_us, valid_us)
        share.left -= size
        self.counts[schema if size else LOST] += 1


MOST_EDGES: Final = 100_000
"""Edges of alarms, monitors and tasks by which repetitions are known."""
