"""The position filter offline: what it puts out for reports whose available times are known."""

from collections.abc import Iterable

from dyknow.model.sample import Sample
from dyknow.navigation.fusion import PositionFilter
from dyknow.navigation.vehicle import Report


def run_filter(
    reports: Iterable[tuple[Report, int]],
    period_us: int,
    *,
    until_us: int | None = None,
    filtered: PositionFilter | None = None,
) -> list[Sample]:
    """What a `PositionFilter` puts out for `reports`, each with the time at which it was available, in that order.

    Timers fire exactly when they are due, after the reports of the same instant. The last ones fire up to `until_us`,
    or all of them if None.
    """
    unit = filtered or PositionFilter(period_us)
    found: list[Sample] = []
    for report, available_us in reports:
        while (due_us := unit.deadline_us) is not None and due_us < available_us:
            found += unit.on_time(due_us)
        found += unit.on_report(report, available_us)
    while (due_us := unit.deadline_us) is not None and (until_us is None or due_us <= until_us):
        found += unit.on_time(due_us)
    return found
