"""The streams that a platform's specification produced, from its journal: replayed, since a journal replays to the
same effects.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path

from pydantic import ValidationError

from agents.effects import Effect, Tell
from agents.flight.flight import FlightAgent
from agents.flight.vehicle_streams import ESTIMATE
from agents.platform import Platform
from dyknow import Policy, Predicted, Quality, Sample, of_json
from dyknow.model.errors import DecodeError
from federation.members.clock import FederationClock
from proxies.recordings.journal_file import CLOCK_EPOCH, CLOCK_SPEED, STOPWATCH, Lost, Stepped, read_about, read_journal
from runtime.clock import ReplayedStopwatch, Stopwatch
from runtime.configuration.config import NodeConfig
from runtime.configuration.resolved import platform_config
from runtime.journal.journal import Journal, Journalled, replayed


def about(config: NodeConfig, clock: FederationClock) -> dict[str, str]:
    """What the journal of a platform says of it."""
    return {
        "config": config.model_dump_json(),
        CLOCK_EPOCH: str(clock.epoch_us),
        CLOCK_SPEED: str(clock.speed),
        STOPWATCH: "shown",
    }


def journalled(platform: Platform, journal: Journal, stopwatch: Stopwatch) -> Journalled[Effect]:
    """The platform with its journal: events, timers, what the stopwatch showed, and what was estimated."""
    for flight in (part for part in platform.parts if isinstance(part, FlightAgent)):
        estimate, fields = flight.streams.estimate, [field.name for field in ESTIMATE.fields]
        on_sample = partial(journal.on_sample, str(estimate), fields)
        platform.ports.network.subscribe(estimate, Policy(), on_sample)
    stopwatch.taken()  # before there was a step
    return Journalled(platform, journal, stopwatch)


def recorded_streams(path: Path, units: Sequence[str] = ()) -> dict[str, list[Sample]]:
    """The samples of each declared stream, by available time; `units` are modules that the specification needs.

    Raises:
        DecodeError: it is not a journal, or entries were lost, so that the streams are unknown.
        DyknowError: what the platform's configuration names can no longer be read.
    """
    said = read_about(path)
    try:
        config = NodeConfig.model_validate_json(said["config"])
        clock = FederationClock(int(said[CLOCK_EPOCH]), float(said[CLOCK_SPEED]))
    except (KeyError, ValueError, ValidationError) as wrong:
        raise DecodeError("journal", f"{path} does not say what it is of: {wrong}") from None
    config = config.model_copy(update={"units": tuple(units) or config.units})
    entries = _complete(path)
    first = next(entries, None)
    if first is None:
        return {}
    stopwatch = ReplayedStopwatch() if STOPWATCH in said else None
    told = platform_config(config, clock, first.now_us, "")
    platform = Platform(told if stopwatch is None else replace(told, stopwatch=stopwatch.now_us), first.now_us)
    platform.start(first.now_us)
    streams: dict[str, list[Sample]] = {}
    for _, effects in replayed(chain((first,), entries), platform, stopwatch):
        for effect in effects:
            if isinstance(effect, Tell) and effect.record["event"] == "sample":
                record = effect.record
                quality = Quality(record.get("certainty", 1.0), tuple(map(tuple, record.get("covariance", ()))))
                if "prediction" in record:
                    quality = quality._replace(prediction=Predicted(*record["prediction"]))
                sample = Sample(record["available_us"], record["valid_us"], of_json(record["value"]), quality)
                streams.setdefault(record["stream"], []).append(sample)
    return streams


def _complete(path: Path) -> Iterator[Stepped]:
    """The entries of a journal that lost none."""
    for entry in read_journal(path):
        if isinstance(entry, Lost):
            raise DecodeError("journal", f"{path}: {entry.entries} entries were lost; their effects are unknown")
        yield entry
