"""A recorded flight as a vehicle that flies now.

The recording's first position plus `from_us` is played at `epoch_us`, so recordings that share an epoch share one time.
A report is posted when federation time reaches its record time; its valid time is moved by the same amount.
"""

import threading
from collections.abc import Callable, Iterator

from dyknow.model.errors import DecodeError
from dyknow.navigation.vehicle import BatteryReport, HomeReport, Report, StatusReport
from dyknow.proxies.recordings.recording import Recording

_BEHIND_US = 1_000_000
_LASTING = (BatteryReport, HomeReport, StatusReport)


def schedule(
    recording: Recording, epoch_us: int, from_us: int = 0, *, since_us: int | None = None
) -> Iterator[tuple[int, Report]]:
    """(federation time, report) in the order of the file, from `since_us` on, by default from the epoch.

    Earlier reports are left out, except the last ones of home, status and battery, which still hold: these come first.

    Raises:
        DecodeError: where the recording is damaged, after everything before the damage.
    """
    shift_us = epoch_us - recording.first_position_us - from_us
    begin_us = epoch_us if since_us is None else max(epoch_us, since_us)
    lasting: dict[type, Report] | None = {}
    for record_us, report in recording.reports():
        at_us = record_us + shift_us
        if at_us < begin_us:
            if lasting is not None and isinstance(report, _LASTING):
                lasting[type(report)] = report
            continue
        if lasting:
            for held in lasting.values():
                yield at_us, held._replace(valid_us=at_us)
        lasting = None
        yield at_us, report._replace(valid_us=report.valid_us + shift_us)


class Replay:
    """Posts a recording's reports on schedule, from a thread of its own.

    Args:
        recording: opened.
        epoch_us: federation time at which the recording's first position plus `from_us` is played.
        from_us: where in the recording to begin, counted from its first position.
        post: takes a report; must not block.
        now_us: federation time.
        speed: how much faster federation time runs than the waiting.
        on_end: called once, from the thread, with the damage of the recording, or an empty text.
    """

    def __init__(
        self,
        recording: Recording,
        epoch_us: int,
        from_us: int,
        post: Callable[[Report], None],
        now_us: Callable[[], int],
        *,
        speed: float = 1.0,
        on_end: Callable[[str], None] = lambda _problem: None,
    ) -> None:
        if speed <= 0:
            raise ValueError(f"a replay's speed must be positive, got {speed}")
        self.problem = ""
        self._recording, self._epoch_us, self._from_us = recording, epoch_us, from_us
        self._post, self._now_us, self._speed, self._on_end = post, now_us, speed, on_end
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"replay-{recording.path.name}", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stopping.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(timeout=2.0)

    def _run(self) -> None:
        try:
            since_us = self._now_us() - _BEHIND_US
            for at_us, report in schedule(self._recording, self._epoch_us, self._from_us, since_us=since_us):
                wait_s = (at_us - self._now_us()) / 1e6 / self._speed
                if (wait_s > 0 and self._stopping.wait(wait_s)) or self._stopping.is_set():
                    break
                self._post(report)
        except DecodeError as damage:
            self.problem = str(damage)
        else:
            self.problem = "; ".join(self._recording.problems)
        finally:
            self._on_end(self.problem)
