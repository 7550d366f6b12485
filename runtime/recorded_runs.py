"""The streams that a platform's specification brought forth, from its journal: replayed, since a journal replays to the
same effects.
"""

from collections.abc import Sequence
from pathlib import Path

from pydantic import ValidationError

from agents.effects import Tell
from agents.platform import Platform
from dyknow import Quality, Sample, of_json
from dyknow.errors import DecodeError
from federation.clock import FederationClock
from proxies.journal_file import CLOCK_EPOCH, CLOCK_SPEED, Lost, Stepped, read_about, read_journal
from runtime.config import NodeConfig
from runtime.configured import platform_config


def recorded_streams(path: Path, units: Sequence[str] = ()) -> dict[str, list[Sample]]:
    """The samples of each declared stream, by available time; `units` are modules that the specification needs.

    Raises:
        DecodeError: it is not a journal, or entries were lost, so that nothing certain can be said.
        DyknowError: what the platform's configuration names cannot be read any more.
    """
    about = read_about(path)
    try:
        config = NodeConfig.model_validate_json(about["config"])
        clock = FederationClock(int(about[CLOCK_EPOCH]), float(about[CLOCK_SPEED]))
    except (KeyError, ValueError, ValidationError) as wrong:
        raise DecodeError("journal", f"{path} does not say what it is of: {wrong}") from None
    config = config.model_copy(update={"units": tuple(units) or config.units})
    platform: Platform | None = None
    found: dict[str, list[Sample]] = {}
    for entry in read_journal(path):
        if isinstance(entry, Lost):
            raise DecodeError("journal", f"{path}: {entry.count} entries were lost; what came of them is not known")
        if platform is None:
            platform = Platform(platform_config(config, clock, entry.now_us, ""), entry.now_us)
            platform.start(entry.now_us)
        _take(platform, entry, found)
    return found


def _take(platform: Platform, entry: Stepped, found: dict[str, list[Sample]]) -> None:
    now_us, event = entry
    effects = platform.on_time(now_us) if event is None else platform.on_event(event, now_us)
    for effect in effects:
        if isinstance(effect, Tell) and effect.record["event"] == "sample":
            said = effect.record
            quality = Quality(said.get("certainty", 1.0), tuple(map(tuple, said.get("covariance", ()))))
            sample = Sample(said["available_us"], said["valid_us"], of_json(said["value"]), quality)
            found.setdefault(said["stream"], []).append(sample)
