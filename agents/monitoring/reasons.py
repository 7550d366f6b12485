"""Why a formula was decided, as acts say it."""

from collections.abc import Iterable
from itertools import islice
from typing import Final

from dyknow import NoValue, Value, as_json
from dyknow.federation.messages.contents import Because
from dyknow.kpl import print_formula
from dyknow.kpl.checking.error_collector import shortened
from dyknow.model.values import LARGEST
from dyknow.reasoning.formulas.tree import Formula
from dyknow.reasoning.progression.explaining import Explanation

MOST_SAMPLES: Final = 8
LONGEST: Final = 1000
LONGEST_LABEL: Final = 256
MOST_REASONS: Final = 3
LONGEST_PART: Final = 200
"""Of an alarm or a monitor: its reasons, and characters of each."""


def because(reason: Explanation, longest: int = LONGEST) -> Because:
    """One reason; a part of the formula has at most `longest` characters."""
    shown = islice(
        ((name, value) for name, value in reason.samples.items() if len(name) <= LONGEST_LABEL), MOST_SAMPLES
    )
    return Because(
        part=_short(reason.part, longest),
        holds=reason.holds,
        samples={name: scalar(value) for name, value in shown},
        members=dict(reason.binding),
        within=None if reason.obligation is None else _short(reason.obligation, longest),
        since_us=reason.since_us,
        until_us=reason.until_us,
    )


def reasons(found: Iterable[Explanation]) -> tuple[Because, ...]:
    """The first of several reasons, with shorter parts."""
    return tuple(because(each, LONGEST_PART) for each in islice(found, MOST_REASONS))


def scalar(value: Value) -> bool | float | NoValue | str:
    """A value as an act can carry it: records, and numbers that are not finite, as text."""
    if isinstance(value, NoValue | bool) or (isinstance(value, int | float) and -LARGEST <= value <= LARGEST):
        return value
    return shortened(str(as_json(value)))


def _short(formula: Formula, longest: int) -> str:
    text = print_formula(formula)
    return text if len(text) <= longest else f"{text[: longest - 3]}..."
