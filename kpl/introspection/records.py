"""Output of a running specification as records for users and programs: samples, alarms, faults."""

from collections import Counter
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from dyknow import Label, Sample, as_json
from dyknow.kpl.introspection.link_reasons import because
from dyknow.kpl.syntax.printing import print_formula
from dyknow.reasoning import AlarmEvent
from dyknow.reasoning.progression.explaining import Explanation
from dyknow.states.synchronization import Origin

if TYPE_CHECKING:
    from dyknow.anchoring.links.objects import LinkEvent

MOST_REPORTED = 3
"""Faults of one stream that are reported."""
MOST_REASONS = 3
"""Parts of a formula that an alarm names."""
_NONE: Mapping[str, Origin] = {}


def sample_json(sample: Sample) -> dict[str, Any]:
    """A sample; its quality only where it is not sure and exact."""
    quality = sample.quality
    return {
        "valid_us": sample.valid_us,
        "available_us": sample.available_us,
        "value": as_json(sample.value),
        **({"certainty": quality.certainty} if quality.certainty != 1.0 else {}),
        **({"covariance": [list(row) for row in quality.covariance]} if quality.covariance else {}),
        **({} if quality.prediction is None else {"prediction": list(quality.prediction)}),
    }


def sample_record(
    name: str, sample: Sample, origins: Mapping[str, Origin] = _NONE, maker: Label | None = None
) -> dict[str, Any]:
    """A sample of a declared stream; of a state, how each of its values was obtained, of a merge, its member."""
    said: dict[str, Any] = {"event": "sample", "stream": name, **sample_json(sample)}
    if maker is not None:
        said["of"] = str(maker)
    if origins:
        said["origins"] = {label: {"manner": one.manner, "valid_us": one.valid_us} for label, one in origins.items()}
    return said


def producer_record(label: Label, producer: Label | None, since_us: int) -> dict[str, Any]:
    """Which of several redundant producers a stream is of from then on; null: all are silent. Federation time."""
    made_by = None if producer is None else str(producer)
    return {"event": "producer", "label": str(label), "of": made_by, "valid_us": since_us}


def alarm_record(event: AlarmEvent) -> dict[str, Any]:
    """An alarm that opened, with the reasons, or that closed or ended."""
    return {
        "event": f"alarm-{event.event}",
        "monitor": event.monitor,
        "id": event.id,
        "units": list(event.units),
        "valid_us": event.valid_us,
        "detected_us": event.detected_us,
        "values": {label: as_json(value) for label, value in event.values.items()},
        "samples": dict(event.samples_us),
        "because": [_reason(each) for each in event.because[:MOST_REASONS]],
        **({} if event.made_us is None else {"made_us": event.made_us}),
    }


def found_record(event: "LinkEvent") -> dict[str, Any]:
    """A wanted object was found, is tracked, lost or found again."""
    return {
        "event": event.kind,
        "symbol": event.target,
        "from": event.source or None,
        "valid_us": event.valid_us,
        "because": because(event.reason),
    }


def _reason(found: Explanation) -> dict[str, Any]:
    """A part of the formula that the deciding state settled, by its samples; `in` which temporal part needed it."""
    return {
        "part": print_formula(found.part),
        "holds": found.holds,
        "samples": {label: as_json(value) for label, value in found.samples.items()},
        "members": dict(found.binding),
        "in": None if found.obligation is None else print_formula(found.obligation),
        "since_us": found.since_us,
        "until_us": found.until_us,
    }


class FaultLog:
    """Tells the first faults of each stream, so that one that fails with every sample does not drown the others."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._counts: Counter[Label] = Counter()

    def on_fault(self, label: Label, said: str) -> None:
        """Something a person wrote does not work."""
        self._counts[label] += 1
        if self._counts[label] <= MOST_REPORTED:
            more = "; further ones of it are not reported" if self._counts[label] == MOST_REPORTED else ""
            self._tell(f"{label}: {said}{more}")

    def clear(self) -> None:
        """Restart the counts: the failures may have been repaired."""
        self._counts.clear()
