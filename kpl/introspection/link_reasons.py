"""Why a link of two objects was made or removed, as text for users (thesis 8.5)."""

from functools import lru_cache
from itertools import chain
from typing import TYPE_CHECKING

from dyknow import NO_VALUE, US_PER_S, Value
from dyknow.kpl.syntax.printing import print_formula

if TYPE_CHECKING:
    from dyknow.anchoring.links.objects import LinkReason

_printed = lru_cache(maxsize=256)(print_formula)


def because(reason: "LinkReason") -> str:
    """The condition with the samples that decided it, or how long there was no sample or no link."""
    if reason.cause == "ended":
        return "the percept ended"
    if reason.cause == "silent":
        return f"no sample for {reason.for_us / US_PER_S:g} s"
    if reason.cause == "tracked":
        return f"in view for {reason.for_us / US_PER_S:g} s"
    if reason.cause == "released":
        return "it is wanted no more"
    if reason.cause == "wanted" and reason.formula is None:
        return "it was decided that it is this one"
    if reason.cause == "weighed":
        return "of the known objects that it may be, another has become the likelier one"
    if reason.cause == "another":
        return "how it moves shows that it is another"
    if reason.cause == "forgotten" or reason.formula is None:
        return f"not linked to a percept for {reason.for_us / US_PER_S:g} s"
    verdict = "fails" if reason.cause == "maintain" else "holds"
    samples = dict(chain.from_iterable(each.samples.items() for each in reason.explanations))
    shown = ", ".join(f"{label} = {_shown(value)}" for label, value in samples.items())
    return f"{reason.cause} {verdict}, {_printed(reason.formula)}{', with ' if shown else ''}{shown}"


def _shown(value: Value) -> str:
    return "no value" if value is NO_VALUE else f"{value:.2f}" if isinstance(value, float) else str(value).lower()
