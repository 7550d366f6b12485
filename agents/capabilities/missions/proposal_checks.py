"""Whether a proposal to lead a mission can be what it states: its plan is of the mission's actions, and as long as they are."""

import re
from typing import Final

from dyknow.agents.capabilities.missions.mission_texts import MissionTexts, step_of
from dyknow.federation.messages.contents import MissionProposal
from dyknow.model.errors import Refused

_LINE: Final = re.compile(r"(\d{1,9}(?:\.\d+)?) s  (.{1,1000})")
ROUNDED_S: Final = 0.06


def unbelievable(proposal: MissionProposal, texts: MissionTexts) -> str:
    """Why it is not believed; empty: nothing speaks against it."""
    whole, last_s = texts.domain.joined(texts.problem), 0.0
    for line in proposal.actions:
        found = _LINE.fullmatch(line)
        if found is None:
            return f"it plans what is no action: {line[:80]!r}"
        try:
            step_of(found[2], whole)
        except Refused as refused:
            return f"it plans {refused}"
        last_s = max(last_s, float(found[1]))
    if proposal.duration_s + ROUNDED_S < last_s:
        return f"it states {proposal.duration_s:g} s, and an action that begins after {last_s:g} s"
    if proposal.actions and not proposal.duration_s:
        return f"it states that {len(proposal.actions)} actions take no time"
    return ""
