"""The alarm that neither of two vehicles can avoid the other: one a pair, until they meet no longer."""

from collections.abc import Callable

from agents.separation.situation import Neither
from reasoning import NEITHER_CAN_AVOID, AlarmEvent


class NeitherAlarms:
    """Those of one platform; federation time.

    Args:
        note: takes words for the log.
        on_alarm: takes each opening and closing.
    """

    def __init__(self, unit: str, note: Callable[[str], None], on_alarm: Callable[[AlarmEvent], None]) -> None:
        self._unit, self._note, self._raise = unit, note, on_alarm
        self._open: dict[str, AlarmEvent] = {}

    def open(self, step: Neither, at_us: int) -> None:
        """With the seconds that are left, and both reasons; once a pair."""
        if step.unit in self._open:
            return
        reasons = zip((self._unit, step.unit), step.reasons, strict=True)
        values: dict[str, str | float] = {f"reason[{unit}]": why for unit, why in reasons}
        values["seconds"] = round(step.seconds, 1)
        event = AlarmEvent(
            f"{NEITHER_CAN_AVOID} {self._unit} {step.unit} {at_us}", "opened", NEITHER_CAN_AVOID,
            (self._unit, step.unit), at_us, at_us, values,
        )  # fmt: skip
        self._open[step.unit] = event
        self._note(
            f"neither {self._unit} nor {step.unit} can avoid the other, in {step.seconds:.0f} s: {'; '.join(step.reasons)}"
        )
        self._raise(event)

    def close(self, unit: str, at_us: int) -> None:
        """The two meet no longer."""
        event = self._open.pop(unit, None)
        if event is not None:
            self._raise(event._replace(event="closed", detected_us=at_us))
