"""Messages of a recording as rows of the page: short texts and numbers, whatever the message holds."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

from dyknow.console.output.shown import printable
from dyknow.console.picture.differences import Row
from dyknow.federation.messages.acts import Act, parse_act
from dyknow.federation.messages.contents.parts import read
from dyknow.model.errors import DyknowError, TextError

LONGEST: Final = 240
LONGEST_ACT: Final = 2000
MOST_PARTS: Final = 64
_PLACES: Final = ("latitude_deg", "longitude_deg", "altitude_m")
_OBJECT_NUMBERS: Final = (
    "existence", "altitude_m", "vx_m_s", "vy_m_s", "sd_m", "xx_m2", "xy_m2", "yy_m2", "thermal", "colour", "observed_s",
)  # fmt: skip
_OBJECT_TEXTS: Final = ("type", "types", "colour", "status", "seen_by", "by", "because", "known", "kind", "callsign")


def text(value: object, most: int = LONGEST) -> str:
    """A text as it is shown: no control characters, not endless."""
    shown = printable(value[: most + 1] if isinstance(value, str) else str(value)[: most + 1])
    return shown if len(shown) <= most else shown[: most - 1] + "…"


def number(value: object) -> float | None:
    """A number that can be drawn; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if abs(value) < 1e18 and math.isfinite(value) else None


def rounded(value: float | None) -> float | None:
    """As many digits as are shown."""
    return None if value is None else round(value, 3)


def numbers(value: object, names: Sequence[str]) -> list[float] | None:
    """The fields of these names; None unless all are numbers."""
    if not isinstance(value, Mapping):
        return None
    found = [number(value.get(name)) for name in names]
    return [one for one in found if one is not None] if None not in found else None


def place(value: object) -> list[float] | None:
    """Latitude and longitude in degrees; None where there is no such place."""
    found = numbers(value, _PLACES[:2])
    return found if found is not None and abs(found[0]) <= 90 and abs(found[1]) <= 180 else None


def deviation(covariance: Any, at: int, scale: float = 1.0) -> float | None:
    """The standard deviation of the field at `at`, times `scale`; None if the matrix does not have it."""
    match covariance:
        case [*lines] if at < len(lines) and isinstance(lines[at], list | tuple) and at < len(lines[at]):
            variance = number(lines[at][at])
            return None if variance is None else rounded(math.sqrt(max(0.0, variance)) * scale)
    return None


def corner(value: object) -> list[float] | None:
    """Latitude and longitude written as acts write them, `58.4 15.6`."""
    if not isinstance(value, str) or len(value) > 64:
        return None
    try:
        found = [float(part) for part in value.split()]
    except ValueError:
        return None
    is_place = len(found) == 2 and abs(found[0]) <= 90 and abs(found[1]) <= 180
    return found if is_place else None


def corners(value: object) -> list[list[float]]:
    """The places among these."""
    listed = value[:MOST_PARTS] if isinstance(value, list | tuple) else []
    return [found for each in listed if (found := corner(each)) is not None]


def branch(prediction: object) -> tuple[str, float] | None:
    """The branch of a sample that is predicted along several, and its weight."""
    match prediction:
        case [int(), str(name), int() | float() as weight] if name:
            return text(name, 60), max(0.0, min(1.0, number(weight) or 0.0))
    return None


def flight_row(message: Mapping[str, Any]) -> Row:
    """Where a vehicle will fly, and within what."""
    fences = message.get("fences")
    listed = [each for each in fences[:16] if isinstance(each, Mapping)] if isinstance(fences, list) else []
    return {
        **fields(message, ("commander", "doing")),
        "ahead": corners(message.get("ahead")),
        "again": message.get("again") is True,
        "altitude": number(message.get("altitude_m")),
        "fences": [
            {
                "name": text(each.get("name", ""), 60),
                "centre": corner(each.get("centre")),
                "radius": number(each.get("radius_m")),
                "lowest": number(each.get("lowest_m")),
                "highest": number(each.get("highest_m")),
                "corners": corners(each.get("corners")),
            }
            for each in listed
        ],
    }


def instant(value: object) -> int | None:
    """Microseconds of federation time, of a clock that there can be."""
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1 << 53 else None


def texts(value: object) -> list[str]:
    """The parts of a list as they are shown."""
    return [text(each) for each in value[:MOST_PARTS]] if isinstance(value, list | tuple) else []


def figures(value: object) -> dict[str, Any]:
    """Values by name: numbers, and other values as texts."""
    if not isinstance(value, Mapping):
        return {}
    some = [*value.items()][:MOST_PARTS]
    return {text(name): text(each) if (found := number(each)) is None else found for name, each in some}


def fields(message: Mapping[str, Any], names: Sequence[str]) -> dict[str, str]:
    """The texts of these names, those that there are."""
    return {name: text(message[name]) for name in names if message.get(name) is not None}


def object_fields(value: Mapping[str, Any]) -> dict[str, Any]:
    """The known fields of an object."""
    known = {key: found for key in _OBJECT_NUMBERS if (found := number(value.get(key))) is not None}
    return {**known, **fields(value, _OBJECT_TEXTS)}


def alarm_row(before: Row | None, message: Mapping[str, Any]) -> Row:
    """An alarm after this edge; `before` is what it was."""
    event = text(message.get("event"))
    row = {
        **fields(message, ("monitor", "by")),
        "units": texts(message.get("units")),
        "event": event,
        "values": figures(message.get("values")),
        "because": texts(message.get("because")),
        "opened_us": before.get("opened_us") if before else None,
        "closed_us": None,
    }
    row["opened_us" if event == "opened" else "closed_us"] = instant(message.get("valid_us"))
    if event != "opened" and before:
        row |= {"values": before["values"], "because": before["because"]}
    return row


def mission_row(by: str, entry: Mapping[str, Any]) -> Row:
    """A mission as its leader lists it, with its question."""
    question = entry.get("question")
    asked = None
    if isinstance(question, Mapping):
        asked = {
            "number": question.get("number") if isinstance(question.get("number"), int) else 0,
            "text": text(question.get("text"), LONGEST_ACT),
            "options": texts(question.get("options")),
            "default": text(question.get("default", "")),
            "until_us": instant(question.get("until_us")),
        }
    row = fields(entry, ("mission", "conversation", "phase", "why"))
    return {
        **row, "by": by, "since_us": instant(entry.get("since_us")), "actions": texts(entry.get("actions")),
        "question": asked,
    }  # fmt: skip


def parsed(message: Mapping[str, Any]) -> Act | None:
    """The act in a line of a message log, if it is one."""
    written = message.get("act")
    try:
        return parse_act(written) if isinstance(written, str) else None
    except TextError:
        return None


def act_row(by: str, message: Mapping[str, Any], act: Act | None) -> Row:
    """A speech act as it passed a platform."""
    is_out = message.get("direction") == "out"
    peer = text(message.get("peer", ""))
    return {
        "at_us": instant(message.get("at_us")),
        "from": by if is_out else peer,
        "to": peer if is_out else by,
        "what": "" if act is None else act.performative.value,
        "head": "" if act is None or act.content is None else text(act.content.head),
        "conversation": "" if act is None else text(act.conversation_id or ""),
        "outcome": text(message.get("outcome", "")),
        "act": text(message.get("act", ""), LONGEST_ACT),
    }


def target_row(act: Act) -> Row | None:
    """Where an act sends a vehicle, or what manoeuvre it proposes; empty: that it flies there no more. None: neither."""
    if act.content is None or act.performative.value not in {"request", "propose"}:
        return None
    head = act.content.head
    if head in {"hold", "land", "return-home", "resume", "follow"}:
        return {}
    if head not in {"goto", "avoid"}:
        return None
    try:
        said = read(act.content).model_dump()
    except (DyknowError, ValueError):
        return None
    if head == "goto":
        return {"kind": "goto", "at": [said[name] for name in _PLACES]}
    return {"kind": "avoid", "units": texts(said["units"]), "by": act.sender.unit, **fields(said, ("because",))}


def ends_target(act: Act) -> bool:
    """Whether the vehicle is not, or no longer, on its way: refused, failed, cancelled, there."""
    is_there = act.performative.value == "inform" and act.content is not None and act.content.head == "done"
    return is_there or act.performative.value in {"refuse", "failure", "cancel", "not-understood"}
