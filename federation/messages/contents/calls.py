"""Calls for a stream, and proposals for them: the contract net of FIPA (SC00029; thesis 9.2.3)."""

from dyknow.federation.messages.contents import parts
from dyknow.federation.messages.descriptions import Cost, SemanticLabel
from dyknow.model.instants import US_PER_S


class CallForStream(parts.Content):
    """Propose the stream of a label, with at least this quality: with `cfp`. `call` names the call, over all its recipients."""

    call: parts.Conversation
    semantic_label: SemanticLabel
    sample_period_s: parts.Period
    delay_s: parts.Seconds
    min_certainty: parts.Share = 0.0

    @property
    def sample_us(self) -> int:
        return round(self.sample_period_s * US_PER_S)

    @property
    def delay_us(self) -> int:
        return round(self.delay_s * US_PER_S)


class StreamProposal(parts.Content):
    """The stream of a label at a cost, with the quality that is promised: with `propose`."""

    semantic_label: SemanticLabel
    cost: Cost
    sample_period_s: parts.Period
    delay_s: parts.Seconds
    certainty: parts.Share = 0.0


class TakeProposal(parts.Content):
    """The proposal of this conversation is taken: begin. With `accept-proposal`."""


class LeaveProposal(parts.Content):
    """The proposal of this conversation is not taken, or no longer, and why: with `reject-proposal`."""

    because: parts.Prose
