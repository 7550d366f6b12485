"""A recording of a federation, played: the data of each of its platforms, at its time, to a platform of that name.

Federation time cannot be turned back, so all instants are moved by the same amount: a whole number of seconds, which
keeps samples on the grids of their periods.
"""

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import Any, Final, NamedTuple

from pydantic import ValidationError

from dyknow import NO_VALUE, SURE, Predicted, Quality, Value, of_json
from dyknow.agents.playback.recorded_platform import OffersPlayed, Played, PlayedAct, PlayedSample
from dyknow.federation.messages.acts import parse_act
from dyknow.federation.messages.contents import ActLog
from dyknow.federation.messages.descriptions import DefinitionEntry
from dyknow.model.errors import DecodeError, TextError
from dyknow.model.instants import US_PER_S
from dyknow.model.semantic_labels import SemanticLabel
from dyknow.reasoning import AlarmEvent
from dyknow.runtime.configuration.config import RecordedVehicle
from dyknow.runtime.recordings.recorded import FederationRecording, RecordedMessage
from dyknow.runtime.recordings.recording_file import ACT, ALARM, PLATFORM, SAMPLE
from dyknow.runtime.recordings.summary import LATEST_US

AT_ONCE: Final = 256
"""Messages that are played as one event at most."""
_MOST_LABELS = 256


class Due(NamedTuple):
    """An item to play at `at_us`, moved: labels that are offered from then on, a sample, an act or an alarm."""

    at_us: int
    what: OffersPlayed | PlayedSample | PlayedAct | AlarmEvent


def shift_us(first_us: int, from_us: int, begin_us: int) -> int:
    """By how much instants are moved, so that `from_us` after the first message is played at `begin_us`, or just after."""
    exact_us = begin_us - first_us - from_us
    return -(-exact_us // US_PER_S) * US_PER_S


def schedule(recording: FederationRecording, unit: str, played: RecordedVehicle) -> Iterator[Due]:
    """The items to play of one platform, in the order of the file.

    The labels are offered at once, so that monitors can be set up before anything is played. The newest sample of each
    stream before `from_us`, and the alarms that were open then, are played at the beginning.
    """
    begin_us, beginning_us = played.begin_us, played.first_us + played.from_us
    moved_us = shift_us(played.first_us, played.from_us, begin_us)
    definitions: dict[str, SemanticLabel] = {}
    before: dict[object, Due] | None = {}
    has_offers = False
    for each in recording.messages(
        lambda topic: topic in {"/directory", "/alarms", "/acts"} or topic.startswith(f"/{unit}/")
    ):
        what = _read(each, unit, definitions, moved_us)
        if what is None or (isinstance(what, AlarmEvent) and not played.alarms):
            continue
        if isinstance(what, OffersPlayed):
            what = OffersPlayed(0, tuple(one for one in what.labels if one[0].name in played.labels))
            if not has_offers:
                has_offers = True
                yield Due(0, what)
                continue
        if before is not None:
            if each.at_us < beginning_us:
                _keep(before, what, begin_us)
                continue
            yield from before.values()
            before = None
        yield Due(each.at_us + moved_us, what)
    yield from before.values() if before is not None else ()


def _keep(before: dict[object, Due], what: OffersPlayed | PlayedSample | PlayedAct | AlarmEvent, begin_us: int) -> None:
    if isinstance(what, OffersPlayed):
        before[OffersPlayed] = Due(begin_us, what)
    elif isinstance(what, PlayedSample):
        before[what.label] = Due(begin_us, what)
    elif isinstance(what, PlayedAct):
        return
    elif what.event == "opened":
        before[what.id, "alarm"] = Due(begin_us, what)
    else:
        before.pop((what.id, "alarm"), None)


def _read(
    each: RecordedMessage, unit: str, definitions: dict[str, SemanticLabel], moved_us: int
) -> OffersPlayed | PlayedSample | PlayedAct | AlarmEvent | None:
    """A message about this platform; None for another one, or one that is not as a recorder writes it."""
    match each.schema, each.message:
        case str(schema), {"unit": str(of), "labels": list(labels), "definitions": list(given)} if (
            schema == PLATFORM and of == unit
        ):
            return _offers(labels[:_MOST_LABELS], given[:_MOST_LABELS], definitions)
        case str(schema), {"unit": str(of), "label": str(label), "valid_us": int(valid_us), "value": value} if (
            schema == SAMPLE and of == unit and label in definitions and 0 <= valid_us <= LATEST_US
        ):
            read = _value(value, definitions[label])
            return (
                None
                if read is None
                else PlayedSample(label, valid_us + moved_us, read, _quality(each.message, moved_us))
            )
        case str(schema), {"by": str(by)} if schema == ALARM and by == unit:
            return _alarm(each.message, moved_us)
        case str(schema), {"by": str(by)} if schema == ACT and by == unit:
            return _act(each.message)
    return None


def _offers(labels: list[Any], given: list[Any], definitions: dict[str, SemanticLabel]) -> OffersPlayed:
    for entry in given:
        with suppress(ValidationError, TypeError):
            if isinstance(entry, dict):
                pairs = tuple(map(tuple, entry.get("fields", ())))
                label = DefinitionEntry.model_validate({**entry, "fields": pairs}).definition
                definitions[label.name] = label
    offered: list[tuple[SemanticLabel, int]] = []
    for entry in labels:
        match entry:
            case {"label": str(name), **rest} if name in definitions:
                period_us = rest.get("period_us", 0)
                offered.append(
                    (definitions[name], period_us if isinstance(period_us, int) and 0 <= period_us <= LATEST_US else 0)
                )
    return OffersPlayed(0, tuple(offered))


def _value(value: Any, label: SemanticLabel) -> Value | None:
    """The value in the order of its fields; None if it lacks one."""
    if value is None:
        return NO_VALUE
    fields = [field.name for field in label.sort.fields] or ["value"]
    if not isinstance(value, dict) or set(fields) != set(value):
        return None
    parts = tuple(of_json(value[name]) for name in fields)
    return parts if label.sort.fields else parts[0]


def _quality(message: Mapping[str, Any], moved_us: int) -> Quality:
    """How good the sample was, as far as that is recorded in numbers."""
    certainty, rows, prediction = (message.get(name) for name in ("certainty", "covariance", "prediction"))
    quality = SURE
    if isinstance(certainty, int | float) and 0 <= certainty <= 1:
        quality = quality._replace(certainty=float(certainty))
    if isinstance(rows, list) and all(isinstance(row, list) and len(row) == len(rows) for row in rows):
        with suppress(TypeError, ValueError):
            quality = quality._replace(covariance=tuple(tuple(map(float, row)) for row in rows))
    match prediction:
        case [int(made_us), str(branch), int(weight) | float(weight)] if 0 <= made_us <= LATEST_US:
            quality = quality._replace(prediction=Predicted(made_us + moved_us, branch, float(weight)))
    return quality


def _alarm(message: Mapping[str, Any], moved_us: int) -> AlarmEvent | None:
    match message:
        case {
            "id": str(name), "event": ("opened" | "closed" | "ended") as event, "monitor": str(monitor), "units": list(units),
            "valid_us": int(valid_us), "detected_us": int(detected_us), "values": dict(values), "samples": dict(samples),
        } if 0 <= valid_us <= LATEST_US and 0 <= detected_us <= LATEST_US:  # fmt: skip
            sampled = {str(label): us + moved_us for label, us in samples.items() if isinstance(us, int)}
            made_us = message.get("made_us")
            return AlarmEvent(
                name, event, monitor, tuple(map(str, units)), valid_us + moved_us, detected_us + moved_us,
                {str(label): value for label, value in values.items() if isinstance(value, bool | int | float | str)},
                sampled, made_us=made_us + moved_us if isinstance(made_us, int) else None,
            )  # fmt: skip
    return None


def _act(message: Mapping[str, Any]) -> PlayedAct | None:
    """An act of the message log; its text may have been cut off, which is no act."""
    try:
        log = ActLog.model_validate({name: value for name, value in message.items() if name != "by"})
    except ValidationError:
        return None
    act = None
    if log.act is not None:
        with suppress(TextError):
            act = parse_act(log.act)
    return PlayedAct(log.direction, log.peer, log.outcome, act)


class Playback:
    """Posts what is due of one platform, from a thread of its own.

    Args:
        played: the times of the recording to play.
        unit: the platform.
        post: takes events for the platform; must not block.
        now_us: federation time; `node_us` the node clock.
        speed: how much faster federation time runs than the waiting.
        on_end: called once, from the thread, with the damage of the recording, or an empty text.
    """

    def __init__(
        self,
        played: RecordedVehicle,
        unit: str,
        post: Callable[[Any], None],
        now_us: Callable[[], int],
        node_us: Callable[[], int],
        *,
        speed: float = 1.0,
        on_end: Callable[[str], None] = lambda _problem: None,
    ) -> None:
        self._recording, self._unit, self._played = FederationRecording(played.file), unit, played
        self._post, self._now_us, self._node_us, self._speed = post, now_us, node_us, speed
        self._on_end = on_end
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"playback-{unit}", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stopping.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(timeout=2.0)

    def _run(self) -> None:
        together: list[PlayedSample | PlayedAct | AlarmEvent] = []
        problem = ""
        try:
            for at_us, what in schedule(self._recording, self._unit, self._played):
                left_us = at_us - self._now_us()
                if left_us > 0 or len(together) >= AT_ONCE or isinstance(what, OffersPlayed):
                    self._play(together)
                if left_us > 0 and self._stopping.wait(left_us / 1e6 / self._speed):
                    return
                if self._stopping.is_set():
                    return
                if isinstance(what, OffersPlayed):
                    self._post(what._replace(at_us=self._node_us()))
                else:
                    together.append(what)
            self._play(together)
            problem = self._recording.unread_text
        except DecodeError as damage:
            self._play(together)
            problem = str(damage)
        finally:
            if not self._stopping.is_set():
                self._on_end(problem)

    def _play(self, together: list[PlayedSample | PlayedAct | AlarmEvent]) -> None:
        if together:
            self._post(Played(self._node_us(), tuple(together)))
            together.clear()
