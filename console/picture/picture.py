"""The picture of a federation: one value, stepped by the messages that a recording has, live or from a file.

It is a table of sections, each of rows by name. Rows are replaced, never changed, so that the difference of two pictures
is found by looking at which rows are the same objects.
"""

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from dyknow.console.picture import rows
from dyknow.console.picture.differences import Row, Sections
from dyknow.console.picture.intents import agreed_meetings, intent_row, meeting_row
from dyknow.console.picture.measures import Curves, close_pairs
from dyknow.console.picture.rows import number, text
from dyknow.federation.messages.acts import Act
from dyknow.navigation.geodesy import metres_per_degree
from dyknow.runtime.recordings import foxglove
from dyknow.runtime.recordings import recording_file as kinds

SECTIONS: Final = (
    "platforms", "streams", "links", "monitors", "alarms", "tasks", "missions", "acts", "events", "objects", "views",
    "areas", "salient", "targets", "pairs", "flights", "intents", "meetings", "lost",
)  # fmt: skip
MOST: Final[Mapping[str, int]] = {"platforms": 256, "streams": 4096, "objects": 2048, "links": 4096}
MOST_OTHERS: Final = 256
"""Rows of a section; the oldest go first."""
STREAM_US: Final = 1_000_000
"""How often the row of a stream is replaced."""
TRAIL_US, TRAIL_POINTS = 1_000_000, 90
MOST_OTHERS_OF: Final = 8
"""Places where one object may be that are shown."""
HISTORY: Final = 64
"""Most kept changes of a monitor's state."""
_SLOW_M_S: Final = 0.5
_KINDS: Final = ("", "info", "info", "warning", "bad", "bad")
_OBJECTS: Final = frozenset({"believed-objects", "object-tracks", "global-objects", "traffic", "vision-percepts"})
_SALIENT: Final = frozenset({"saliency-map", "camera-attention"})
MAP_LABELS: Final = (
    "heli-position", "heli-altitude", "heli-height", "heli-velocity", "heli-attitude", "battery", "heli-home", "camera-view",
    "intent", "assigned-area", "winch-load", "object-identities", *sorted(_OBJECTS - {"vision-percepts"}), *sorted(_SALIENT),
)  # fmt: skip
"""The streams that the page takes from platforms that offer them."""


@dataclass(slots=True)
class _Stream:
    """The samples of one stream: their number, and the last shown one."""

    count: int = 0
    valid_us: int = 0
    delay_us: int = 0
    shown_us: int = 0
    shown_count: int = 0


@dataclass(slots=True)
class Picture:
    """See the module; times are federation time.

    Attributes:
        now_us: the time of the newest message.
        origin: latitude and longitude of the metres east and north that objects have, where a user gave it; else each
            platform's objects stand where that platform says that theirs count from.
    """

    origin: tuple[float, float] | None = None
    now_us: int = 0
    _sections: Sections = field(default_factory=lambda: {name: {} for name in SECTIONS})
    _streams: dict[str, _Stream] = field(default_factory=dict)
    _trails: dict[str, "deque[tuple[int, float, float]]"] = field(default_factory=dict)
    _curves: Curves = field(default_factory=Curves)
    _origins: dict[str, tuple[float, float]] = field(default_factory=dict)
    _numbers: int = 0

    def take(self, at_us: int, schema: str, message: Mapping[str, Any]) -> None:
        """Take a message; one that no recorder writes is passed over."""
        self.now_us = max(self.now_us, at_us)
        self._curves.on_time(self.now_us, self._sections["platforms"], self._sections["monitors"])
        match schema:
            case kinds.SAMPLE:
                self._on_sample(at_us, message)
            case kinds.PLATFORM:
                self._on_platform(at_us, message)
            case kinds.ALARM:
                self._on_alarm(message)
            case kinds.MONITOR:
                self._on_monitor(at_us, message)
            case kinds.TASK:
                self._on_task(message)
            case kinds.MISSIONS:
                self._on_missions(message)
            case kinds.FLIGHTS:
                self._on_flight(message)
            case kinds.IMPORTS:
                self._on_imports(at_us, message)
            case kinds.ACT:
                self._on_act(message)
            case foxglove.LOG:
                self._on_log(at_us, message)
            case kinds.LOST:
                self._on_lost(message)

    def sections(self) -> Sections:
        """All rows as they are now."""
        self._sections["pairs"] = close_pairs(self._sections["platforms"], self._sections["pairs"])
        return {name: dict(rows) for name, rows in self._sections.items()}

    def section(self, name: str) -> Mapping[str, Row]:
        """The rows of one section as they are now."""
        return self._sections[name]

    def trails(self) -> dict[str, list[list[float]]]:
        """Where platforms were in the last minute or more, a point a second."""
        return {
            unit: [[latitude, longitude] for _, latitude, longitude in trail] for unit, trail in self._trails.items()
        }

    def curves(self) -> dict[str, list[list[float]]]:
        """The measures of monitors in the last two minutes, pairs of time and measure."""
        return self._curves.points()

    @property
    def base(self) -> list[float] | None:
        """The origin of metres: the user's, else that of the first platform which states one."""
        found = self.origin or next(iter(self._origins.values()), None)
        return None if found is None else [*found]

    def copy(self) -> "Picture":
        """The same picture, stepped by itself from now on."""
        copies = {name: dict(rows) for name, rows in self._sections.items()}
        streams = {
            name: _Stream(s.count, s.valid_us, s.delay_us, s.shown_us, s.shown_count)
            for name, s in self._streams.items()
        }
        trails = {unit: deque(trail, TRAIL_POINTS) for unit, trail in self._trails.items()}
        return Picture(
            self.origin, self.now_us, copies, streams, trails, self._curves.copy(), dict(self._origins), self._numbers
        )

    # -- rows --------------------------------------------------------------------------------------------------

    def _put(self, section: str, name: str, row: Row) -> None:
        rows_there = self._sections[section]
        if name not in rows_there:
            while len(rows_there) >= MOST.get(section, MOST_OTHERS):
                del rows_there[next(iter(rows_there))]
        rows_there[name] = row

    def _change(self, section: str, name: str, **values: Any) -> None:
        self._put(section, name, {**self._sections[section].get(name, {}), **values})

    def _remove(self, section: str, name: str) -> None:
        self._sections[section].pop(name, None)

    def _append(self, section: str, row: Row) -> None:
        self._numbers += 1
        self._put(section, str(self._numbers), row)

    # -- messages ----------------------------------------------------------------------------------------------

    def _on_sample(self, at_us: int, message: Mapping[str, Any]) -> None:
        match message:
            case {"unit": str(unit), "label": str(label), "valid_us": int(valid_us)}:
                unit, label = text(unit), text(label)
                value = message.get("value")
                self._count(unit, label, valid_us, at_us)
                if not isinstance(value, Mapping):
                    return
                if label in _OBJECTS or label in _SALIENT:
                    self._on_object(unit, label, valid_us, value, rows.branch(message.get("prediction")))
                elif label == "object-identities":
                    self._on_identity(unit, value)
                else:
                    self._on_own(unit, label, valid_us, value, message.get("covariance"))

    def _count(self, unit: str, label: str, valid_us: int, at_us: int) -> None:
        name = f"{unit} {label}"
        if name not in self._streams and len(self._streams) >= MOST["streams"]:
            return
        stream = self._streams.setdefault(name, _Stream())
        stream.count, stream.valid_us, stream.delay_us = stream.count + 1, valid_us, max(0, at_us - valid_us)
        passed_us = at_us - stream.shown_us
        if passed_us >= STREAM_US:
            rate = (stream.count - stream.shown_count) * 1e6 / passed_us if stream.shown_us else None
            stream.shown_us, stream.shown_count = at_us, stream.count
            self._change(
                "streams", name, unit=unit, label=label, valid_us=valid_us, delay_us=stream.delay_us, rate=rate
            )

    def _on_own(self, unit: str, label: str, valid_us: int, value: Mapping[str, Any], covariance: object) -> None:
        """A platform's statement about itself."""
        match label:
            case "heli-position":
                if (where := rows.place(value)) is not None:
                    before = self._sections["platforms"].get(unit, {})
                    state = before.get("state", "alive")  # records of encounters have none
                    sds = [
                        rows.deviation(covariance, at, scale) for at, scale in enumerate(metres_per_degree(where[0]))
                    ]
                    sd = max((each for each in sds if each is not None), default=None)
                    self._change("platforms", unit, at=where, valid_us=valid_us, state=state, sd=sd)
                    trail = self._trails.setdefault(unit, deque(maxlen=TRAIL_POINTS))
                    if not trail or valid_us - trail[-1][0] >= TRAIL_US:
                        trail.append((valid_us, where[0], where[1]))
            case "heli-velocity":
                if (speeds := rows.numbers(value, ("north_m_s", "east_m_s", "down_m_s"))) is not None:
                    north, east, down = speeds
                    speed, climb = round(math.hypot(north, east), 2), round(-down, 2)
                    course = {} if speed < _SLOW_M_S else {"course": _degrees(math.atan2(east, north))}
                    self._change("platforms", unit, speed=speed, climb=climb, speed_us=valid_us, **course)
            case "heli-attitude":
                if (yaw := number(value.get("yaw_rad"))) is not None:
                    self._change("platforms", unit, heading=_degrees(yaw))
            case "heli-altitude" | "heli-height" | "battery" | "winch-load":
                name, key = _FIGURES[label]
                figure, sd = rows.rounded(number(value.get(name))), rows.deviation(covariance, 0)
                self._change("platforms", unit, **{key: figure, f"{key}_sd": sd, f"{key}_us": valid_us})
            case "intent":
                row = intent_row(value, valid_us, self._sections["intents"].get(unit))
                self._remove("intents", unit) if row is None else self._put("intents", unit, row)
            case "heli-home":
                self._change("platforms", unit, home=rows.place(value))
            case "camera-view":
                corners = rows.numbers(value, [f"{axis}{at}_m" for at in range(1, 5) for axis in "xy"])
                if corners is not None:
                    places = [self._on_earth(unit, x, y) for x, y in zip(corners[::2], corners[1::2], strict=True)]
                    self._put("views", unit, {"ring": places})
            case "assigned-area":
                self._put("areas", unit, {"at": rows.place(value), "border": text(value.get("border", ""), 4000)})

    def _on_object(
        self, unit: str, label: str, valid_us: int, value: Mapping[str, Any], branch: tuple[str, float] | None
    ) -> None:
        symbol = text(value.get("symbol", ""), 60)
        section = "salient" if label in _SALIENT else "objects"
        name = f"{unit} {label} {symbol}"
        where = rows.numbers(value, ("x_m", "y_m"))
        on_earth = rows.place(value)
        if value.get("end") is True or (where is None and on_earth is None):
            self._remove(section, name)
            return
        row: dict[str, Any] = {
            **rows.object_fields(value),
            "unit": unit,
            "label": label,
            "symbol": symbol,
            "valid_us": valid_us,
        }
        before = self._sections[section].get(name, {})
        at = on_earth if where is None else self._on_earth(unit, *where)
        if branch is not None:
            known_ones = before.get("others", []) if before.get("valid_us") == valid_us else []
            others = [*(each for each in known_ones if each[0] != branch[0]), [branch[0], at, branch[1]]]
            row["others"] = others[-MOST_OTHERS_OF:]
            weights = [float(each[2]) for each in row["others"]]
            at = row["others"][weights.index(max(weights))][1]
        self._put(section, name, {**row, "at": at, "identity": before.get("identity")})

    def _on_identity(self, unit: str, value: Mapping[str, Any]) -> None:
        symbol = text(value.get("symbol", ""), 60)
        name = f"{unit} object-tracks {symbol}"
        if name in self._sections["objects"]:
            identity = None if value.get("end") is True else text(value.get("identity", ""), 60)
            self._change("objects", name, identity=identity)

    def _on_earth(self, unit: str, x_m: float, y_m: float) -> list[float] | None:
        """Metres east and north as latitude and longitude; none while it is not known from where they count."""
        origin = self.origin or self._origins.get(unit) or next(iter(self._origins.values()), None)
        if origin is None:
            return None
        north_m, east_m = metres_per_degree(origin[0])
        return [round(origin[0] + y_m / north_m, 8), round(origin[1] + x_m / east_m, 8)]

    def _on_flight(self, message: Mapping[str, Any]) -> None:
        unit = text(message.get("by", ""))
        origin = rows.corner(message.get("origin"))
        if origin is not None and abs(origin[0]) < 90 and len(self._origins) < MOST["platforms"]:
            self._origins[unit] = origin[0], origin[1]
        self._put("flights", unit, rows.flight_row(message))

    def _on_platform(self, at_us: int, message: Mapping[str, Any]) -> None:
        match message:
            case {"unit": str(unit), "state": str(state)}:
                unit = text(unit)
                said: dict[str, Any] = {"state": text(state), "state_us": at_us}
                if isinstance(message.get("labels"), list):
                    said |= {key: rows.texts(message.get(key)) for key in ("services", "conditions")}
                    self._offered(unit, message["labels"])
                self._change("platforms", unit, **said)

    def _offered(self, unit: str, labels: Sequence[Any]) -> None:
        offered = {}
        for each in labels[:256]:
            match each:
                case {"label": str(label), **rest}:
                    offered[f"{unit} {text(label)}"] = text(label), number(rest.get("period_us")), rest.get("cost")
        rows_there = self._sections["streams"]
        for name in [name for name, row in rows_there.items() if row.get("unit") == unit and name not in offered]:
            del rows_there[name]
        for name, (label, period_us, cost) in offered.items():
            self._change("streams", name, unit=unit, label=label, period_us=period_us, cost=number(cost))

    def _on_alarm(self, message: Mapping[str, Any]) -> None:
        if isinstance(message.get("id"), str):
            name = text(message["id"])
            self._put("alarms", name, rows.alarm_row(self._sections["alarms"].get(name), message))

    def _on_monitor(self, at_us: int, message: Mapping[str, Any]) -> None:
        match message:
            case {"by": str(by), "monitor": str(monitor), "units": list(units)}:
                name = text(f"{by} {monitor} {' '.join(map(str, units[:8]))}")
                said: dict[str, Any] = {
                    **rows.fields(message, ("verdict", "inputs", "shows")),
                    "which": rows.texts(message.get("which")),
                    "margin": number(message.get("margin")),
                }
                change = message.get("change")
                if change == "ended":
                    self._remove("monitors", name)
                    return
                if change is not None:
                    is_unknown = change == "unknown"
                    said = {"shows": "unknown" if is_unknown else "ok", "which": said["which"], "margin": None}
                before = self._sections["monitors"].get(name, {})
                history = before.get("history", [])
                if before.get("shows") != said.get("shows"):
                    history = [*history, [at_us, said.get("shows")]][-HISTORY:]
                self._change(
                    "monitors",
                    name,
                    by=text(by),
                    monitor=text(monitor),
                    units=rows.texts(units),
                    history=history,
                    **said,
                )

    def _on_task(self, message: Mapping[str, Any]) -> None:
        if isinstance(message.get("conversation"), str):
            row: dict[str, Any] = {"since_us": rows.instant(message.get("since_us"))}
            row |= rows.fields(message, ("task", "unit", "state", "delegator", "ended_by", "conversation"))
            self._put("tasks", text(message["conversation"]), {**row, "monitors": rows.texts(message.get("monitors"))})

    def _on_missions(self, message: Mapping[str, Any]) -> None:
        by = text(message.get("by", ""))
        listed = message.get("missions")
        there = {name for name, row in self._sections["missions"].items() if row.get("by") == by}
        for entry in listed[:16] if isinstance(listed, list) else ():
            if isinstance(entry, Mapping) and isinstance(entry.get("mission"), str):
                name = f"{by} {text(entry['mission'])}"
                there.discard(name)
                self._put("missions", name, rows.mission_row(by, entry))
        for name in there:
            self._remove("missions", name)

    def _on_imports(self, at_us: int, message: Mapping[str, Any]) -> None:
        by, listed = text(message.get("by", "")), message.get("imports")
        for one in listed[:256] if isinstance(listed, list) else ():
            match one:
                case {"owner": str(owner), "semantic_label": str(label), "received": int(received), **rest}:
                    name = text(f"{owner} {label} {by} {rest.get('hash', '')}")
                    before = self._sections["links"].get(name, {})
                    passed_us = at_us - before.get("at_us", at_us)
                    rate = (received - before["received"]) * 1e6 / passed_us if passed_us > 0 else before.get("rate")
                    counts = {key: rest.get(key, 0) for key in ("missing", "lost", "recovered", "every")}
                    known = {key: count for key, count in counts.items() if isinstance(count, int)}
                    who = {"from": text(owner), "to": by, "label": text(label)}
                    known["delay_us"] = round(1e6 * max(0.0, number(rest.get("delay_s")) or 0.0))
                    kept = {"received": received, "at_us": at_us, "rate": None if rate is None else max(0.0, rate)}
                    self._put("links", name, {**who, **kept, **known})

    def _on_act(self, message: Mapping[str, Any]) -> None:
        by = text(message.get("by", ""))
        act = rows.parsed(message)
        if act is not None and message.get("outcome") in {"sent", "accepted"}:
            self._follow(by, act, message)
        self._append("acts", rows.act_row(by, message, act))

    def _follow(self, by: str, act: Act, message: Mapping[str, Any]) -> None:
        """Where a vehicle was sent, or what manoeuvre is proposed; no longer where that has ended."""
        target = rows.target_row(act)
        self._sections["meetings"].update(agreed_meetings(self._sections["meetings"], act))
        if target is None:
            ended = [n for n, row in self._sections["targets"].items() if row["conversation"] == act.conversation_id]
            for name in ended if rows.ends_target(act) else ():
                self._remove("targets", name)
        elif target.get("kind") == "avoid" or message.get("direction") == "in":
            name = f"{by} {target.get('kind', 'goto')}"
            at_us = rows.instant(message.get("at_us"))
            about = {"unit": by, "conversation": act.conversation_id, "at_us": at_us}
            if target.get("kind") == "avoid" and (met := meeting_row(target, act.conversation_id, at_us)):
                self._put("meetings", *met)
            if target:
                self._put("targets", name, {**target, **about})
            else:
                self._remove("targets", name)

    def _on_log(self, at_us: int, message: Mapping[str, Any]) -> None:
        level = message.get("level")
        kind = _KINDS[level] if isinstance(level, int) and 0 < level < len(_KINDS) else "info"
        self._append("events", {"at_us": at_us, "level": kind, "text": text(message.get("message", ""), 400)})

    def _on_lost(self, message: Mapping[str, Any]) -> None:
        unit, count = text(message.get("unit", "")), number(message.get("messages")) or 0
        self._change("lost", unit, messages=self._sections["lost"].get(unit, {}).get("messages", 0) + count)


_FIGURES: Final[Mapping[str, tuple[str, str]]] = {
    "heli-altitude": ("altitude_m", "altitude"), "heli-height": ("height_m", "height"), "battery": ("fraction", "battery"),
    "winch-load": ("load_kg", "load"),
}  # fmt: skip


def _degrees(radians: float) -> float:
    return round(math.degrees(radians) % 360, 1)
