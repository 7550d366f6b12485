"""The wanted stream of a call, and the proposals of platforms for it (thesis 9.2.3: quality, cost and willingness)."""

from collections.abc import Callable, Iterable
from typing import Literal, NamedTuple, TypeAlias

from dyknow.federation.members.directory import unit_order
from dyknow.model.instants import print_span


class WantedStream(NamedTuple):
    """The stream of a label with at least this quality; periods and delays are microseconds of federation time."""

    label: str
    period_us: int
    delay_us: int
    min_certainty: float = 0.0

    def __str__(self) -> str:
        sure = f", certainty {self.min_certainty:g}" if self.min_certainty else ""
        return f"{self.label} every {print_span(self.period_us)}, delay {print_span(self.delay_us)}{sure}"


class Proposal(NamedTuple):
    """The proposal of one platform, and its conversation; `boot` is its incarnation."""

    unit: str
    boot: int
    conversation: str
    cost: float
    period_us: int
    delay_us: int
    certainty: float

    def lacks(self, wanted: WantedStream) -> str:
        """Why it does not meet what is wanted; empty if it does."""
        found = []
        if self.period_us > wanted.period_us or wanted.period_us % self.period_us:
            found.append(f"a sample every {print_span(self.period_us)}, not every {print_span(wanted.period_us)}")
        if self.delay_us > wanted.delay_us:
            found.append(f"a delay of {print_span(self.delay_us)}, not {print_span(wanted.delay_us)}")
        if self.certainty < wanted.min_certainty:
            found.append(f"certainty {self.certainty:g}, not {wanted.min_certainty:g}")
        return "; ".join(found)


def best(
    proposals: Iterable[Proposal],
    wanted: WantedStream,
    is_unreliable: Callable[[str], bool] = lambda _unit: False,
) -> Proposal | None:
    """The cheapest proposal that meets what is wanted, of equal ones that of the unit that sorts first.

    Those of unreliable units come after all others.
    """
    fitting = [each for each in proposals if not each.lacks(wanted)]
    return min(fitting, key=lambda each: (is_unreliable(each.unit), each.cost, unit_order(each.unit)), default=None)


CallEvent: TypeAlias = Literal["called", "proposed", "refused", "taken", "failed", "open"]


class CallNews(NamedTuple):
    """An event of a call: to which unit (empty: to all of it), and in words.

    `called`: it was sent out. `proposed`, `refused`: an answer. `taken`: this unit streams from now on. `failed`: it does
    no longer, or never did. `open`: no proposal is left; the call waits for new offers.
    """

    event: CallEvent
    label: str
    unit: str
    text: str
    at_us: int
