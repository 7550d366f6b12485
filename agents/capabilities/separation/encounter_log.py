"""One record for each encounter, as an authority asks for it: both sides' positions and intents, acts, orders, alarms, in one order.

An encounter begins 20 s before its meeting was seen, and ends 5 s after it was over. Its record is made from the
histories of streams, the audit log, the alarms, and the notes of giving way. Its messages are those of a recording, so
that tools for recordings play and draw it. Times are federation time, but for `now_us` of the node.
"""

from collections import deque
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from dyknow import NO_VALUE, Sample
from dyknow.agents.audit_log import AuditEntry
from dyknow.agents.capabilities.separation.options import EncounterOptions
from dyknow.agents.effects import EncounterMessage, KeepEncounter
from dyknow.agents.exchange.gateway import Gateway
from dyknow.agents.monitoring.alarm_log import AlarmLog, alarm_content
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.model.errors import Refused, UnknownLabel, ValueNotAvailable
from dyknow.model.values import as_json

LABELS: Final = ("heli-position", "heli-altitude", "heli-velocity", "heli-height", "intent")
BEFORE_US, AFTER_US = 20_000_000, 5_000_000
LONGEST_US: Final = 600_000_000
"""An encounter that lasts longer is split over several records."""
NOTES: Final = 500
_LEVEL_INFO: Final = 2


class _Encounter(NamedTuple):
    """With one other vehicle: since when, and when it was over; None: it is not."""

    since_us: int
    over_us: int | None = None


class EncounterLog(Part):
    """See the module.

    Args:
        keeps_encounters: whether anything is kept.
        emit: takes the records.
    """

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._agent, self._clock, self._gateway = ports.unit, ports.agent, ports.clock, parts[Gateway.of]
        self._alarms = parts[AlarmLog]
        self._keeps = ports.config.options[EncounterOptions].encounters is not None
        self._emit = ports.emit
        self._open: dict[str, _Encounter] = {}
        self._notes: deque[tuple[int, str]] = deque(maxlen=NOTES)
        self._due_us: int | None = None

    # -- what happens ------------------------------------------------------------------------------------------

    def begin(self, other: str, now_us: int) -> None:
        """Begin an encounter with a vehicle; a meeting that is seen again soon continues it."""
        if self._keeps:
            known = self._open.get(other)
            self._open[other] = (
                _Encounter(self._clock.federation_us(now_us)) if known is None else known._replace(over_us=None)
            )
            self._wake(now_us)

    def end(self, other: str, now_us: int) -> None:
        """The meeting is over."""
        known = self._open.get(other)
        if known is not None:
            self._open[other] = known._replace(over_us=self._clock.federation_us(now_us))
            self._wake(now_us)

    def note(self, text: str, now_us: int) -> None:
        """Note a decision, an order or an observation."""
        if self._keeps:
            self._notes.append((self._clock.federation_us(now_us), text))

    def _wake(self, now_us: int) -> None:
        self._due_us = now_us + 1_000_000 if self._due_us is None else self._due_us

    @property
    def deadline_us(self) -> int | None:
        return self._due_us

    def on_time(self, now_us: int) -> None:
        """Emit the records of encounters that have ended."""
        if self._due_us is None or now_us < self._due_us:
            return
        at_us = self._clock.federation_us(now_us)
        for other, known in list(self._open.items()):
            is_over = known.over_us is not None and at_us >= known.over_us + AFTER_US
            if is_over or at_us >= known.since_us + LONGEST_US:
                del self._open[other]
                if not is_over:
                    self._open[other] = _Encounter(at_us)
                self._emit(self._record(other, known.since_us, at_us))
        self._due_us = now_us + 1_000_000 if self._open else None

    # -- the record --------------------------------------------------------------------------------------------

    def _record(self, other: str, since_us: int, until_us: int) -> KeepEncounter:
        from_us = since_us - BEFORE_US
        messages = [
            *self._samples(other, from_us, until_us),
            *self._acts(other, from_us, until_us),
            *self._alarm_edges(other, from_us, until_us),
            *(
                EncounterMessage("/log", "foxglove.Log", _log_entry(at_us, text, self._unit), at_us, at_us)
                for at_us, text in self._notes
                if from_us <= at_us <= until_us
            ),
        ]
        messages.sort(key=lambda each: each.at_us)
        return KeepEncounter(other, since_us, tuple(messages))

    def _samples(self, other: str, from_us: int, until_us: int) -> Iterator[EncounterMessage]:
        for unit in (self._unit, other):
            for label in LABELS:
                try:
                    fields = [field.name for field in self._gateway.sort(label).fields]
                    held = self._held(label, unit, from_us, until_us)
                except (UnknownLabel, Refused, ValueNotAvailable):
                    continue
                for sample in held:
                    record = _sample_record(unit, label, fields, sample)
                    yield EncounterMessage(
                        f"/{unit}/{label}", "dyknow.Sample", record, sample.available_us, sample.valid_us
                    )

    def _held(self, label: str, unit: str, from_us: int, until_us: int) -> list[Sample]:
        """The samples of that time that the history holds; it may begin later."""
        try:
            return self._gateway.between(label, from_us, until_us, until_us, unit)
        except ValueNotAvailable:
            snapshot = self._gateway.network.snapshot(self._gateway.local(label, unit))
            begins_us = snapshot.starts_us
            return (
                []
                if begins_us is None
                else self._gateway.between(label, max(from_us, begins_us), until_us, until_us, unit)
            )

    def _acts(self, other: str, from_us: int, until_us: int) -> Iterator[EncounterMessage]:
        for entry in self._agent.audit_log.entries:
            at_us = self._clock.federation_us(entry.at_us)
            if from_us <= at_us <= until_us and self._is_about(entry, other):
                record = {
                    "at_us": at_us, "by": self._unit, "direction": entry.direction, "peer": entry.peer,
                    "outcome": entry.outcome, "act": None if entry.act is None else str(entry.act),
                }  # fmt: skip
                yield EncounterMessage("/acts", "dyknow.Act", record, at_us, at_us)

    def _is_about(self, entry: AuditEntry, other: str) -> bool:
        """Acts with that unit about manoeuvres and alarms, and orders of any unit."""
        head = "" if entry.act is None or entry.act.content is None else entry.act.content.head
        ordered = head in {"goto", "hold", "land", "return-home", "resume"}
        return ordered or (entry.peer == other and head not in {"create-multicast", "stream"})

    def _alarm_edges(self, other: str, from_us: int, until_us: int) -> Iterator[EncounterMessage]:
        for event in self._alarms.events:
            if other in event.units and from_us <= event.detected_us <= until_us:
                record = alarm_content(event, self._unit).model_dump(mode="json", exclude_none=True)
                record["because"] = [
                    f"{each['part']} is {'true' if each['holds'] else 'false'}" for each in record.get("because", ())
                ]
                yield EncounterMessage("/alarms", "dyknow.Alarm", record, event.detected_us, event.valid_us)


def _sample_record(unit: str, label: str, fields: list[str], sample: Sample) -> dict[str, Any]:
    value = None
    if sample.value is not NO_VALUE:
        value = {name: as_json(part) for name, part in zip(fields, sample.value, strict=True)}
    return {
        "unit": unit,
        "label": label,
        "valid_us": sample.valid_us,
        "available_us": sample.available_us,
        "value": value,
    }


def _log_entry(at_us: int, text: str, unit: str) -> dict[str, Any]:
    stamp = {"sec": at_us // 1_000_000, "nsec": at_us % 1_000_000 * 1000}
    return {"timestamp": stamp, "level": _LEVEL_INFO, "message": text, "name": unit, "file": "", "line": 0}
