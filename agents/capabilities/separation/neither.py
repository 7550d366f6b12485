"""Alarms `neither-can-avoid`: opened once for each other vehicle, closed when the meeting with it is over."""

from collections.abc import Callable

from dyknow.agents.capabilities.separation.situation import Neither
from dyknow.reasoning import NEITHER_CAN_AVOID, AlarmEvent


class NeitherAlarms:
    """See the module; `on_alarm` takes events, `note` words. Federation time."""

    def __init__(self, unit: str, on_alarm: Callable[[AlarmEvent], None], note: Callable[[str], None]) -> None:
        self._unit, self._raise, self._note = unit, on_alarm, note
        self._open: dict[str, AlarmEvent] = {}

    def open(self, step: Neither, now_us: int) -> None:
        """Report that neither of the two avoids the other."""
        if step.unit in self._open:
            return
        values: dict[str, str | float] = {
            f"reason[{unit}]": why for unit, why in zip((self._unit, step.unit), step.reasons, strict=True)
        }
        values["seconds"] = round(step.seconds, 1)
        event = AlarmEvent(
            f"{NEITHER_CAN_AVOID} {self._unit} {step.unit} {now_us}", "opened", NEITHER_CAN_AVOID,
            (self._unit, step.unit), now_us, now_us, values,
        )  # fmt: skip
        self._open[step.unit] = event
        reasons = "; ".join(step.reasons)
        self._note(f"neither {self._unit} nor {step.unit} can avoid the other, in {step.seconds:.0f} s: {reasons}")
        self._raise(event)

    def close(self, unit: str, now_us: int) -> None:
        """The meeting with that unit is over."""
        event = self._open.pop(unit, None)
        if event is not None:
            self._raise(event._replace(event="closed", detected_us=now_us))
