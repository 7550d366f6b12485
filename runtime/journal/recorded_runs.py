"""The streams that a platform's specification produced, from its journal: replayed, since a journal replays to the
same effects.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path

from pydantic import ValidationError

from dyknow import Policy, Predicted, Quality, Sample, of_json
from dyknow.agents.capabilities.flight.flight import FlightAgent
from dyknow.agents.capabilities.flight.vehicle_streams import ESTIMATE
from dyknow.agents.effects import Effect, Tell
from dyknow.agents.platform import Platform
from dyknow.agents.specification.options import RunOptions
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.messages.contents.parts import in_words
from dyknow.model.errors import DecodeError, WrongCall
from dyknow.proxies.recordings.journal_file import (
    CLOCK_EPOCH,
    CLOCK_SPEED,
    REMEDY,
    STOPWATCH,
    Lost,
    Stepped,
    read_about,
    read_journal,
)
from dyknow.proxies.recordings.mcap_log import recorded_clock
from dyknow.proxies.recordings.mcap_records import Unread
from dyknow.runtime.clock import ReplayedStopwatch, Stopwatch
from dyknow.runtime.configuration.config import NodeConfig
from dyknow.runtime.configuration.resolved import platform_config
from dyknow.runtime.journal.journal import Journal, Journalled, replayed


def about(config: NodeConfig, clock: FederationClock) -> dict[str, str]:
    """The metadata in the journal of a platform."""
    return {
        "config": config.model_dump_json(),
        CLOCK_EPOCH: str(clock.epoch_us),
        CLOCK_SPEED: str(clock.speed),
        STOPWATCH: "shown",
    }


def journalled(platform: Platform, journal: Journal, stopwatch: Stopwatch) -> Journalled[Effect]:
    """The platform with its journal: events, timers, the stopwatch's readings, and the estimates."""
    for flight in (part for part in platform.parts if isinstance(part, FlightAgent)):
        estimate, fields = flight.streams.estimate, [field.name for field in ESTIMATE.fields]
        on_sample = partial(journal.on_sample, str(estimate), fields)
        platform.ports.network.connect(estimate, Policy(), on_sample)
    stopwatch.taken()  # before there was a step
    return Journalled(platform, journal, stopwatch)


def recorded_streams(
    path: Path,
    units: Sequence[str] = (),
    extensions: Sequence[str] = (),
    *,
    on_unread: Callable[[Unread], None] = lambda _unread: None,
) -> dict[str, list[Sample]]:
    """The samples of each declared stream, by available time; `on_unread` gets what a journal that was cut off leaves.

    The code of units and extensions is run as the caller names it, and never as the journal does: that may come from anyone.

    Raises:
        WrongCall: the platform had units or extensions that are not named.
        DecodeError: it is not a journal, or entries were lost, so that the streams are unknown.
        DyknowError: a file that the platform's configuration names can no longer be read.
    """
    said = read_about(path)
    try:
        config = NodeConfig.model_validate_json(said["config"])
    except KeyError:
        raise DecodeError("journal", f"{path} does not say what it is of; {REMEDY}") from None
    except ValidationError as wrong:
        why = in_words(wrong)
        raise DecodeError("journal", f"{path} does not say what it is of: {why}; {REMEDY}") from None
    clock = recorded_clock(path, said)
    _check_named(path, "--units", config[RunOptions].modules, units)
    _check_named(path, "--extension", config.extensions, extensions)
    config = config.model_copy(update={"modules": tuple(units), "extensions": tuple(extensions)})
    entries = _complete(path, on_unread)
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


def _check_named(path: Path, option: str, recorded: Sequence[str], named: Sequence[str]) -> None:
    if recorded and not named:
        options = " ".join(f"{option} {name}" for name in recorded)
        raise WrongCall(f"{path}: its platform ran code that is not run unasked; give {options}, if you trust it.")


def _complete(path: Path, on_unread: Callable[[Unread], None]) -> Iterator[Stepped]:
    """The entries of a journal that lost none."""
    for entry in read_journal(path):
        if isinstance(entry, Lost):
            raise DecodeError("journal", f"{path}: {entry.entries} entries were lost; their effects are unknown")
        if isinstance(entry, Unread):
            on_unread(entry)
        else:
            yield entry
