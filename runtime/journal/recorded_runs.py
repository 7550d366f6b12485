"""The streams that a platform's specification produced, from its journal: replayed, since a journal replays to the
same effects.
"""

from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

from pydantic import ValidationError

from agents.effects import Tell
from agents.platform import Platform
from dyknow import Quality, Sample, of_json
from dyknow.model.errors import DecodeError
from federation.members.clock import FederationClock
from proxies.recordings.journal_file import CLOCK_EPOCH, CLOCK_SPEED, Lost, Stepped, read_about, read_journal
from runtime.configuration.config import NodeConfig
from runtime.configuration.resolved import platform_config
from runtime.journal.journal import replayed


def recorded_streams(path: Path, units: Sequence[str] = ()) -> dict[str, list[Sample]]:
    """The samples of each declared stream, by available time; `units` are modules that the specification needs.

    Raises:
        DecodeError: it is not a journal, or entries were lost, so that the streams are unknown.
        DyknowError: what the platform's configuration names can no longer be read.
    """
    about = read_about(path)
    try:
        config = NodeConfig.model_validate_json(about["config"])
        clock = FederationClock(int(about[CLOCK_EPOCH]), float(about[CLOCK_SPEED]))
    except (KeyError, ValueError, ValidationError) as wrong:
        raise DecodeError("journal", f"{path} does not say what it is of: {wrong}") from None
    config = config.model_copy(update={"units": tuple(units) or config.units})
    entries = _complete(path)
    first = next(entries, None)
    if first is None:
        return {}
    platform = Platform(platform_config(config, clock, first.now_us, ""), first.now_us)
    platform.start(first.now_us)
    streams: dict[str, list[Sample]] = {}
    for _, effects in replayed(chain((first,), entries), platform):
        for effect in effects:
            if isinstance(effect, Tell) and effect.record["event"] == "sample":
                record = effect.record
                quality = Quality(record.get("certainty", 1.0), tuple(map(tuple, record.get("covariance", ()))))
                sample = Sample(record["available_us"], record["valid_us"], of_json(record["value"]), quality)
                streams.setdefault(record["stream"], []).append(sample)
    return streams


def _complete(path: Path) -> Iterator[Stepped]:
    """The entries of a journal that lost none."""
    for entry in read_journal(path):
        if isinstance(entry, Lost):
            raise DecodeError("journal", f"{path}: {entry.entries} entries were lost; their effects are unknown")
        yield entry
