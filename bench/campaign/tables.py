"""What the runs of a campaign came to, by cause: geometry, number of vehicles, mode, bound, fault."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from bench.campaign.running import CampaignRun

MEDIAN_FACTOR, LATE_FACTOR = 1.2, 1.6
"""What the median and the 95th of 100 factors are to be at most."""


class CauseRow(NamedTuple):
    """One line: how many runs have the cause, and what happened in them."""

    cause: str
    runs: int
    breaches: int
    untold: int
    told: int
    stuck: int
    explained: int
    violations: int
    manoeuvres: int
    factor: float
    factor_95: float


def by_cause(runs: Sequence[CampaignRun]) -> list[CauseRow]:
    """A line for each cause, and one for all runs at the end."""
    having: dict[str, list[CampaignRun]] = defaultdict(list)
    for run in runs:
        for cause in run.causes:
            having[cause].append(run)
    rows = [_row(cause, having[cause]) for cause in sorted(having, key=_order)]
    return [*rows, _row("all", runs)]


def _order(cause: str) -> tuple[int, str]:
    kinds = ("geometry", "vehicles", "mode", "autopilot", "bound", "failsafe", "fault")
    return kinds.index(cause.partition(":")[0]), cause


def _row(cause: str, runs: Sequence[CampaignRun]) -> CauseRow:
    factors = [factor for run in runs for factor in run.factors]

    def total(counts: Iterable[Sequence[object]]) -> int:
        return sum(map(len, counts))

    return CauseRow(
        cause, len(runs), total(run.breaches for run in runs), total(run.untold for run in runs),
        total(run.told for run in runs), total(run.stuck for run in runs), total(run.explained for run in runs),
        total(run.violations for run in runs), sum(run.manoeuvres for run in runs),
        quantile(factors, 0.5), quantile(factors, 0.95),
    )  # fmt: skip


def quantile(values: Sequence[float], part: float) -> float:
    """The value that this part of them does not exceed; NaN of none."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(part * len(ordered)))] if ordered else float("nan")


def printed(rows: Sequence[CauseRow]) -> str:
    """The table, as text."""
    heads = (
        "cause",
        "runs",
        "breaches",
        "untold",
        "told",
        "stuck",
        "why not",
        "violations",
        "manoeuvres",
        "x 50 %",
        "x 95 %",
    )
    lines = [heads, *((row.cause, *map(str, row[1:9]), f"{row.factor:.2f}", f"{row.factor_95:.2f}") for row in rows)]
    widths = [max(len(line[at]) for line in lines) for at in range(len(heads))]
    return "\n".join(
        "  ".join(
            [line[0].ljust(widths[0]), *(each.rjust(wide) for each, wide in zip(line[1:], widths[1:], strict=True))]
        )
        for line in lines
    )
