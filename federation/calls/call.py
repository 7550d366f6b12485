"""A call for the stream of a label by the contract net of FIPA (SC00029): the cheapest proposal that will do is taken.

| state | entered by | left by |
|---|---|---|
| open | `begin`, or no proposal is left | an offer in the directory: calling |
| calling | `cfp` to each platform that offers the label | all have answered, or half a second is over: taken, else open |
| taken | `accept-proposal` to the best one | it fails, is gone, or its stream is not what it promised: the next, else open |

Proposals that would do as well are kept, so that the next is taken without asking again; they are rejected when the call
ends. Each platform is called once in
a round, its first proposal counts, and one whose stream was not as promised is left out.
Times are the node clock, but for valid times.
"""

from collections import Counter
from collections.abc import Callable
from typing import Final

from dyknow.federation.calls.kept_record import KeptRecord
from dyknow.federation.calls.proposals import CallEvent, CallNews, Proposal, WantedStream, best
from dyknow.federation.members.correspondence import Correspondence
from dyknow.federation.members.directory import DirectoryEntry, DirectoryFacilitator, unit_order
from dyknow.federation.members.liveness import PeerState
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import (
    CallForStream,
    Content,
    LeaveProposal,
    Reason,
    StreamProposal,
    TakeProposal,
)
from dyknow.federation.messages.contents.parts import LEAST_PERIOD_S
from dyknow.model.errors import Refused
from dyknow.model.instants import print_span

P = Performative
PROPOSE_WITHIN_US: Final = 500_000
"""How long proposals are waited for."""
LOOK_US: Final = 100_000
BEGIN_WITHIN_US: Final = 1_000_000
"""How long after its proposal was taken a stream may take to begin."""
SILENT_LEAST_US: Final = 500_000
SILENT_PERIODS: Final = 3
OVERDUE_US: Final = 1_000_000
"""A stream fails that brings nothing for this number of periods, or for one and this, and the delay that was promised."""
WINDOW_US: Final = 2_000_000
LEAST_PART: Final = 0.4
"""Of the samples that are due within a window, at least this part must come as promised."""
SLACK_US: Final = 250_000
"""How much later than its maximum delay a sample may arrive: it was put in time, and travelled."""
AHEAD_US: Final = 60_000_000
"""How far in the future a sample may be valid."""
FORGIVEN_US: Final = 5_000_000
AGAIN_US: Final = 1_000_000
AGAIN_MOST_US: Final = 8_000_000
"""Before the next round, when no proposal is left; it doubles."""
MOST_REQUESTED: Final = 64
"""Recipients of one round, those that offer it at the least cost first."""


class StreamCall:
    """See the module.

    Args:
        wanted: the stream, and the least of its quality.
        unit: of the caller, which does not ask itself.
        speed: of the federation's clock.
        trust: how far a platform is trusted, in [0, 1]; its promises and samples are as much less certain.
        declared: likewise, where samples are less certain by that already when they arrive.
        record: which platforms do not keep what they propose, over all calls of this member.
        on_news: takes what happens.

    Attributes:
        taken: the proposal whose stream is used.
        reserve: the proposals that would do as well, by unit.
        refused: answers that count for nothing, by reason.
    """

    def __init__(
        self,
        wanted: WantedStream,
        unit: str,
        acts: Correspondence,
        directory: DirectoryFacilitator,
        on_news: Callable[[CallNews], None],
        speed: float = 1.0,
        trust: Callable[[str], float] = lambda _unit: 1.0,
        declared: Callable[[str], float] = lambda _unit: 1.0,
        record: KeptRecord | None = None,
    ) -> None:
        self._record = KeptRecord() if record is None else record
        self.wanted, self._unit, self._acts, self._directory = wanted, unit, acts, directory
        self._on_news, self._speed, self._trust, self._declared = on_news, speed, trust, declared
        self.taken: Proposal | None = None
        self.reserve: dict[str, Proposal] = {}
        self.refused: Counter[str] = Counter()
        self._name = ""
        self._asked: dict[tuple[str, int], None] = {}
        self._awaited: dict[str, tuple[str, int]] = {}
        self._blamed_us: dict[str, int] = {}
        self._decide_us: int | None = None
        self._again_us, self._pause_us = 0, AGAIN_US
        self._good_us = self._window_us = 0
        self._good = 0
        self._is_open = False
        self.deadline_us: int | None = None

    # -- steps -------------------------------------------------------------------------------------------------

    def begin(self, now_us: int) -> None:
        """Call for it."""
        self._name = self._acts.conversations.new_conversation("call")
        self.deadline_us = now_us
        self.on_time(now_us)

    def on_time(self, now_us: int) -> None:
        """Look at proposals, at the samples of the taken one, and at new offers."""
        if self.deadline_us is None or now_us < self.deadline_us:
            return
        self.deadline_us = now_us + LOOK_US
        self._ask_newcomers(now_us)
        if self._decide_us is not None and (now_us >= self._decide_us or not self._awaited):
            self._decide(now_us)
        if self.taken is not None:
            unit = self.taken.unit
            if not self._is_heard(unit):  # however rarely it is to bring something
                self._fail("its platform is no longer heard", now_us, cancel=True)
            elif why := self._failure(self.taken, now_us):
                self._blame(unit, now_us)
                self._fail(why, now_us, cancel=True)
        elif self._decide_us is None and now_us >= self._again_us and self._asked:
            self._ask_again(now_us)

    def on_sample(self, unit: str, certainty: float, delay_us: int, now_us: int) -> bool:
        """A sample of the stream arrived from a unit; whether it is of the proposal that was taken, and as promised."""
        wanted, taken = self.wanted, self.taken
        if taken is None or unit != taken.unit:
            return False
        if certainty * self._trust(unit) < wanted.min_certainty:
            self.refused["certainty"] += 1
            return False
        if not -AHEAD_US <= delay_us <= wanted.delay_us + SLACK_US * self._speed:
            self.refused["late" if delay_us > 0 else "future"] += 1
            return False
        self._good_us = max(self._good_us, now_us)
        self._good += 1
        return True

    def end(self, now_us: int) -> None:
        """The stream is needed no longer."""
        self.deadline_us = None
        if self.taken is not None:
            self._acts.cancel(self.taken.unit, self.taken.conversation, now_us)
        for proposal in self.reserve.values():
            self._reject(proposal.unit, proposal.conversation, "the call is over", now_us)
        for conversation, (unit, _) in self._awaited.items():
            self._acts.cancel(unit, conversation, now_us)
        self.taken = None
        self.reserve.clear()
        self._awaited.clear()

    # -- asking ------------------------------------------------------------------------------------------------

    def offering(self) -> list[DirectoryEntry]:
        """The platforms that offer the label to us at a cost, the cheapest first."""
        there = [
            entry
            for entry in self._directory.entries()
            if entry.unit != self._unit and entry.state is PeerState.ALIVE and not entry.refusal
        ]
        offers = [
            (label.cost, unit_order(entry.unit), entry)
            for entry in there
            for label in entry.labels
            if label.label == self.wanted.label and label.cost is not None
        ]
        return [entry for _, _, entry in sorted(offers, key=lambda each: each[:2])]

    def _ask_newcomers(self, now_us: int) -> None:
        self._forgive(now_us)
        there = [each for each in self.offering() if each.unit not in self._blamed_us]
        new = [each for each in there if (each.unit, each.boot) not in self._asked]
        new = new[: max(0, MOST_REQUESTED - len(self._asked))]
        if not new:
            if not self._asked and not self._is_open:
                self._wait(f"no platform offers {self.wanted.label} at a cost", now_us)
            return
        self._is_open = False
        self._news("called", "", f"{self.wanted}: {', '.join(each.unit for each in new)}", now_us)
        for entry in new:
            self._asked[entry.unit, entry.boot] = None
            self._ask(entry, now_us)
        if self.taken is None and self._decide_us is None:
            self._decide_us = now_us + PROPOSE_WITHIN_US

    def _forgive(self, now_us: int) -> None:
        """A platform that is not heard soon after its stream failed was cut off, or died: it is not blamed."""
        for unit, since_us in list(self._blamed_us.items()):
            if not self._is_heard(unit) and now_us <= since_us + FORGIVEN_US:
                del self._blamed_us[unit]
                self._record.forgive(unit)

    def _blame(self, unit: str, now_us: int) -> None:
        self._blamed_us[unit] = now_us
        self._record.on_failed(unit, now_us)

    def _is_heard(self, unit: str) -> bool:
        entry = self._directory.entry(unit)
        return entry is not None and entry.state is PeerState.ALIVE

    def _ask(self, entry: DirectoryEntry, now_us: int) -> None:
        unit, wanted = entry.unit, self.wanted
        conversation = self._acts.conversations.new_conversation(unit)
        self._awaited[conversation] = (unit, entry.boot)
        content = CallForStream(
            call=self._name,
            semantic_label=wanted.label,
            sample_period_s=max(LEAST_PERIOD_S, wanted.period_us / 1e6),
            delay_s=wanted.delay_us / 1e6,
            min_certainty=wanted.min_certainty,
        )
        try:
            self._acts.ask(
                unit,
                content,
                now_us,
                performative=P.CFP,
                on_reply=lambda act, said, _last, at_us: self._on_reply(conversation, act, said, at_us),
                on_silence=lambda why, at_us: self._on_end(conversation, unit, why, at_us),
                within_us=PROPOSE_WITHIN_US,
                conversation=conversation,
            )
        except Refused as refused:
            self._on_end(conversation, unit, refused.reason, now_us)

    def _ask_again(self, now_us: int) -> None:
        """Nothing is left of the last round: call the platforms that are there in a new one."""
        self._pause_us = min(2 * self._pause_us, AGAIN_MOST_US)
        self._again_us = now_us + self._pause_us
        self._name = self._acts.conversations.new_conversation("call")
        self._asked.clear()
        self._ask_newcomers(now_us)

    # -- answers -----------------------------------------------------------------------------------------------

    def _on_reply(self, conversation: str, act: Act, said: Content | None, now_us: int) -> None:
        unit = act.sender.unit
        if act.performative is P.PROPOSE:
            self._on_proposal(conversation, unit, said, now_us)
        elif act.performative is not P.INFORM:
            why = said.text if isinstance(said, Reason) else str(act.performative)
            self._on_end(conversation, unit, why or str(act.performative), now_us)

    def _on_proposal(self, conversation: str, unit: str, said: Content | None, now_us: int) -> None:
        asked = self._awaited.pop(conversation, None)
        if asked is None:
            self.refused["second proposal"] += 1
            return
        if not isinstance(said, StreamProposal) or said.semantic_label != self.wanted.label:
            self.refused["no proposal"] += 1
            self._reject(unit, conversation, f"this is no proposal for {self.wanted.label}", now_us)
            return
        period_us, delay_us = round(said.sample_period_s * 1e6), round(said.delay_s * 1e6)
        certainty = said.certainty * self._trust(unit) * self._declared(unit)
        proposal = Proposal(unit, asked[1], conversation, said.cost, max(1, period_us), delay_us, certainty)
        why = self._unlike_announced(proposal, now_us) or proposal.lacks(self.wanted)
        if why:
            self._news("refused", unit, f"cost {said.cost:g}, but {why}", now_us)
            self._reject(unit, conversation, why, now_us)
            return
        self._news("proposed", unit, f"cost {said.cost:g}", now_us)
        self.reserve[unit] = proposal
        if self._decide_us is None and self.taken is None:
            self._decide(now_us)
        else:
            self.deadline_us = now_us  # all may have answered

    def _unlike_announced(self, proposal: Proposal, now_us: int) -> str:
        """Why its cost is not believed: the platform announces the label at another one."""
        entry, label = self._directory.entry(proposal.unit), self.wanted.label
        announced = [] if entry is None else [each.cost for each in entry.labels if each.label == label]
        if proposal.cost in announced or not announced or announced[0] is None:
            return ""
        self.refused["cost"] += 1
        text = f"{label} at cost {proposal.cost:g} and announces it at {announced[0]:g}"
        self._record.on_misstated(proposal.unit, text, now_us)
        return f"it announces {announced[0]:g}"

    def _on_end(self, conversation: str, unit: str, why: str, now_us: int) -> None:
        """A conversation is over: it was declined, failed, or its platform is gone or silent."""
        if self.taken is not None and self.taken.conversation == conversation:
            if self._is_heard(unit):
                self._record.on_failed(unit, now_us)
            self._fail(why, now_us, cancel=False)
        elif unit in self.reserve and self.reserve[unit].conversation == conversation:
            del self.reserve[unit]
            self._news("refused", unit, f"its proposal stands no longer: {why}", now_us)
        elif self._awaited.pop(conversation, None) is not None:
            self._news("refused", unit, why, now_us)
            self.deadline_us = None if self.deadline_us is None else now_us

    # -- deciding ----------------------------------------------------------------------------------------------

    def _decide(self, now_us: int) -> None:
        """Take the best of the reserve."""
        self._decide_us = None
        chosen = best(self.reserve.values(), self.wanted, lambda unit: self._record.is_unreliable(unit, now_us))
        if chosen is None:
            self._again_us = now_us + self._pause_us
            self._wait("no proposal is left that would do", now_us)
            return
        del self.reserve[chosen.unit]
        self.taken, self._is_open, self._pause_us = chosen, False, AGAIN_US
        self._record.on_taken(chosen.unit, now_us)
        self._good_us = now_us + BEGIN_WITHIN_US
        self._window_us, self._good = now_us + BEGIN_WITHIN_US, 0
        self._acts.decide(chosen.unit, chosen.conversation, P.ACCEPT_PROPOSAL, TakeProposal(), now_us)
        self._news("taken", chosen.unit, f"cost {chosen.cost:g}", now_us)

    def _failure(self, taken: Proposal, now_us: int) -> str:
        """Why the stream that was taken is not as promised; empty while it is."""
        period_us = self.wanted.period_us / self._speed
        silent_us = now_us - self._good_us
        overdue_us = max(SILENT_LEAST_US, min(SILENT_PERIODS * period_us, period_us + OVERDUE_US))
        patience_us = taken.delay_us / self._speed + overdue_us
        if silent_us > patience_us:
            return f"no sample as promised for {print_span(round(patience_us))}"
        if now_us >= self._window_us + max(WINDOW_US, 10 * period_us):
            due, good = (now_us - self._window_us) / period_us, self._good
            self._window_us, self._good = now_us, 0
            if good < LEAST_PART * due:
                return f"{good} of {due:.0f} samples came as promised"
        return ""

    def _fail(self, why: str, now_us: int, *, cancel: bool) -> None:
        failed, self.taken = self.taken, None
        assert failed is not None  # noqa: S101  (only then it is called)
        self._news("failed", failed.unit, why, now_us)
        if cancel:
            self._acts.cancel(failed.unit, failed.conversation, now_us)
        self._decide(now_us)

    def _reject(self, unit: str, conversation: str, why: str, now_us: int) -> None:
        self._acts.decide(unit, conversation, P.REJECT_PROPOSAL, LeaveProposal(because=why), now_us)

    def _wait(self, why: str, now_us: int) -> None:
        if not self._is_open:
            self._is_open = True
            self._news("open", "", why, now_us)

    def _news(self, event: CallEvent, unit: str, text: str, now_us: int) -> None:
        self._on_news(CallNews(event, self.wanted.label, unit, text, now_us))
