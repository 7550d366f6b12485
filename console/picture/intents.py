"""Where vehicles say that they will be, and which of two gives way, as rows of the page.

An intent that says the same as before keeps its row for `SAME_US`, so that fifty members that say theirs twice a second cost
a page little.
"""

from collections.abc import Mapping
from typing import Any, Final

from dyknow.agents.capabilities.separation.records import intent_of
from dyknow.console.picture.differences import Row
from dyknow.console.picture.rows import text
from dyknow.federation.messages.acts import Act, Performative
from dyknow.model.sample import Sample
from dyknow.navigation.intents.intent import IntendedPlace

SAME_US: Final = 2_000_000
_FIELDS: Final = (
    "source", "rank", "latitude_deg", "longitude_deg", "altitude_m", "north_m_s", "east_m_s", "down_m_s", "speed_m_s",
    "climb_m_s", "descent_m_s", "radius_m", "half_height_m", "legs", "ending", "failsafe",
)  # fmt: skip
_PASSING: Final = frozenset({"at", "valid_us", "altitude"})
"""The fields that differ between intents of equal meaning."""


def intent_row(value: Mapping[str, Any], valid_us: int, before: Row | None) -> Row | None:
    """An intent; `before` where it says the same and is not old; None: it is none, or the vehicle is on the ground."""
    parts: tuple[Any, ...] = tuple(value.get(name) for name in _FIELDS)
    intent = intent_of(Sample(valid_us, valid_us, parts))
    if intent is None or not intent.is_airborne:
        return None
    failsafe = intent.contingency
    row = {
        "at": [intent.latitude_deg, intent.longitude_deg],
        "valid_us": valid_us,
        "altitude": round(intent.altitude_m, 1),
        "source": intent.source.value,
        "rank": intent.rank.name.lower(),
        "speed": round(intent.speed_m_s, 1),
        "radius": round(intent.radius_m),
        "legs": _places(intent.legs),
        "ending": intent.ending.value,
        "after_s": None if failsafe is None else failsafe.after_s,
        "failsafe": [] if failsafe is None else _places(failsafe.legs),
        "failsafe_ending": "" if failsafe is None else failsafe.ending.value,
    }
    is_same = before is not None and 0 <= valid_us - before["valid_us"] < SAME_US
    return before if is_same and before is not None and _lasting(before) == _lasting(row) else row


def _places(legs: tuple[IntendedPlace, ...]) -> list[list[float]]:
    return [[round(each.latitude_deg, 6), round(each.longitude_deg, 6), round(each.altitude_m, 1)] for each in legs]


def _lasting(row: Row) -> dict[str, Any]:
    return {name: value for name, value in row.items() if name not in _PASSING}


def meeting_row(target: Row, conversation: str | None, at_us: int | None) -> tuple[str, Row] | None:
    """Of two that meet, which one yields, or is left to, by a proposal to keep apart; with their name. None: not of two."""
    units = target["units"]
    if len(units) != 2 or at_us is None:
        return None
    sender, other = units if units[0] == target["by"] else units[::-1]
    because = target.get("because", "")
    row = {
        "units": sorted(units), "yields": other if because else sender, "to": sender if because else other,
        "because": because, "conversation": text(conversation or ""), "at_us": at_us, "agreed": False,
    }  # fmt: skip
    return " ".join(sorted(units)), row


def agreed_meetings(meetings: Mapping[str, Row], act: Act) -> dict[str, Row]:
    """The meetings about which this act agrees, as they are then."""
    if act.performative not in {Performative.AGREE, Performative.ACCEPT_PROPOSAL}:
        return {}
    return {
        name: {**row, "agreed": True}
        for name, row in meetings.items()
        if row["conversation"] == act.conversation_id and not row["agreed"]
    }
