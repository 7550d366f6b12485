"""How far one vehicle is from losing well clear of all others, and which tracks, speeds and altitudes would lose it.

Positions, altitudes and velocities are what platforms answer, each carried on in a straight line by its own age. A
state older than `MOST_AGE_US`, and a platform that does not answer, is unknown, and is in no band.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from math import atan2, ceil, degrees, hypot, isfinite
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from dyknow.federation.members.command_centre import PlatformView
from dyknow.federation.members.liveness import PeerState
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Query, Reading, Samples
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.model.errors import WrongCall, did_you_mean
from dyknow.model.instants import US_PER_S, print_span
from dyknow.navigation.geodesy import LocalFrame
from dyknow.reasoning.features.bands import (
    ConflictBand,
    Goal,
    Intruders,
    ValueRange,
    altitude_bands,
    speed_bands,
    track_bands,
)
from dyknow.reasoning.features.well_clear import time_to_violation_s
from dyknow.reasoning.features.well_clear_arrays import Floats
from dyknow.reasoning.monitoring.profiles import builtin_profiles
from dyknow.runtime.client import Client, Job, Wait
from dyknow.runtime.library.jobs import GRACE_S, agreeing, all_platforms
from dyknow.runtime.library.questions import gone_text

POSITION, ALTITUDE, VELOCITY, TRAFFIC = "heli-position", "heli-altitude", "heli-velocity", "traffic"
PROFILE: Final = "well-clear"
LOOKAHEAD_S: Final = 30.0
MOST_AGE_US: Final = 3_000_000
MOST_AIRCRAFT_AGE_US: Final = 15_000_000
"""An aircraft that is no member is heard less often; an older state is unknown."""
LEAST_M_S, HOVER_TRACK_M_S = 0.5, 5.0
"""A vehicle slower than the first hovers: its tracks are tried at the second."""
TRACK_STEP_DEG, SPEED_STEP_M_S, ALTITUDE_STEP_M = 1.0, 0.5, 1.0
FASTEST_M_S, ALTITUDES_M = 20.0, 50.0
_ANSWER_S: Final = 1.0
_AIRCRAFT: Final = 64
_FIELDS: Final[Mapping[str, tuple[str, ...]]] = {
    POSITION: ("latitude_deg", "longitude_deg"),
    ALTITUDE: ("altitude_m",),
    VELOCITY: ("north_m_s", "east_m_s", "down_m_s"),
}


class VehicleMotion(NamedTuple):
    """Where a vehicle was `ahead_us` ago, and how it moves: WGS-84, metres above mean sea level, m/s north, east, up.

    Attributes:
        age_us: the age of the oldest sample from which that follows.
        error_m: within what its altitude is known.
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    v_m_s: tuple[float, float, float]
    ahead_us: int = 0
    age_us: int = 0
    error_m: float = 0.0


class OtherVehicle(NamedTuple):
    """A member, or an aircraft that is none; `why`: the reason for which its motion is unknown."""

    name: str
    kind: Literal["member", "aircraft"]
    motion: VehicleMotion | None
    why: str = ""


class ClearanceRow(NamedTuple):
    """The clearance between the vehicle and another one, both flown straight on; None where it is unknown.

    Attributes:
        is_clear: whether well clear is kept for the look-ahead.
        loses_in_s: the time to its loss, 0 while it is lost; None: it is kept.
        apart_m, above_m: horizontal distance now; how far the other is above.
        passes_in_s, passes_m, passes_above_m: the same at the horizontally closest approach within the look-ahead.
        why: the reason for which it is unknown.
    """

    unit: str
    kind: Literal["member", "aircraft"]
    age_us: int | None = None
    is_clear: bool | None = None
    loses_in_s: float | None = None
    apart_m: float | None = None
    above_m: float | None = None
    passes_in_s: float | None = None
    passes_m: float | None = None
    passes_above_m: float | None = None
    why: str = ""


class BandsPicture(NamedTuple):
    """The bands of one vehicle. Without a known motion of its own all is unknown, for the reason `why`.

    Attributes:
        goal: the separation of members, and for how long; of aircraft that are no members `traffic-well-clear`.
        track_deg: None: it hovers; the tracks are tried at `tried_at_m_s`.
        tracks, speeds, altitudes: values that keep well clear or do not, degrees, m/s along the track, m above mean sea level.
    """

    unit: str
    at_us: int
    profile: str
    goal: Goal
    others: tuple[ClearanceRow, ...]
    age_us: int | None = None
    track_deg: float | None = None
    speed_m_s: float | None = None
    altitude_m: float | None = None
    tried_at_m_s: float | None = None
    tracks: tuple[ConflictBand, ...] = ()
    speeds: tuple[ConflictBand, ...] = ()
    altitudes: tuple[ConflictBand, ...] = ()
    why: str = ""

    def as_json(self) -> dict[str, Any]:
        """For `--json`, but for what units are."""
        volume, lookahead_s = self.goal
        return {
            "unit": self.unit, "at_us": self.at_us, "profile": self.profile, "lookahead_s": lookahead_s,
            "thresholds": volume._asdict(), "age_us": self.age_us, "track_deg": _rounded(self.track_deg),
            "speed_m_s": _rounded(self.speed_m_s), "altitude_m": _rounded(self.altitude_m),
            "why": self.why or None, "others": [_row_json(row) for row in self.others],
            "tried_at_m_s": _rounded(self.tried_at_m_s), "tracks_deg": _bands_json(self.tracks),
            "speeds_m_s": _bands_json(self.speeds), "altitudes_m": _bands_json(self.altitudes),
        }  # fmt: skip


def goal_of(profile: str, lookahead_s: float = LOOKAHEAD_S) -> Goal:
    """The volume of a ready profile; raises WrongCall for one that has none."""
    profiles = builtin_profiles()
    having = [name for name, one in profiles.items() if "DMOD" in one.thresholds and "ZTHR" in one.thresholds]
    if profile not in having:
        raise WrongCall(
            f"--profile: {profile!r} has no thresholds of well clear.{did_you_mean(profile, having)} Those that have: "
            f"{', '.join(having)}."
        )
    return Goal(profiles[profile].volume, lookahead_s)


def traffic_goal() -> Goal:
    """The separation that platforms keep of aircraft that are no members, a little more than a minute ahead."""
    return goal_of("traffic-well-clear", 65.0)


def bands(client: Client, unit: str, profile: str = PROFILE, lookahead_s: float = LOOKAHEAD_S) -> Job[BandsPicture]:
    """Ask all platforms where they are and how they move, and this one for the aircraft that it hears.

    Raises:
        NothingFound: no platform is there, or not this one.
        WrongCall: the profile has no thresholds of well clear.
    """
    goal = goal_of(profile, lookahead_s)
    there = yield from all_platforms(client)
    client.pick(unit)
    flying = [view for view in there if view.state != PeerState.ALIVE.value or POSITION in view.labels]
    refused = dict[str, str]()
    asked = dict[tuple[str, str], Dialogue]()
    for label in _FIELDS:
        alive = [view.unit for view in flying if view.state == PeerState.ALIVE.value]
        for name in agreeing(client, label, alive, refused.__setitem__):
            asked[name, label] = _ask(client, name, Query(semantic_label=label))
    if any(view.unit == unit and TRAFFIC in view.labels for view in flying):
        asked[unit, TRAFFIC] = _ask(client, unit, Query(semantic_label=TRAFFIC, op="last", n=_AIRCRAFT))
    yield Wait(lambda: all(dialogue.over for dialogue in asked.values()), _ANSWER_S + GRACE_S)
    now_us = client.now_us()

    def answer(name: str, label: str) -> tuple[list[Reading], int, str]:
        dialogue = asked.get((name, label))
        if dialogue is None:
            return [], 0, refused.get(name, "no answer")
        said = [(act, content) for act, content in dialogue.said if isinstance(content, Samples)]
        answered_us = max((client.centre.clock.federation_us(act.created_us) for act, _ in said), default=0)
        return [one for _, content in said for one in content.samples], answered_us, dialogue.trouble or ""

    others = [_member(view, now_us, partial(answer, view.unit)) for view in flying]
    own = next((one for one in others if one.name == unit), OtherVehicle(unit, "member", None, "it has no position"))
    others = [one for one in others if one.name != unit]
    if own.motion is not None and (unit, TRAFFIC) in asked:
        others += _aircraft(*answer(unit, TRAFFIC)[:2], own.motion.altitude_m)
    return bands_of(own, others, profile, goal, client.federation_us())


def _ask(client: Client, unit: str, query: Query) -> Dialogue:
    return client.say(unit, Performative.QUERY_REF, query, within_s=_ANSWER_S)


def _member(view: PlatformView, now_us: int, answer: Callable[[str], tuple[list[Reading], int, str]]) -> OtherVehicle:
    """A member as it answered."""
    if view.state != PeerState.ALIVE.value:
        why = view.state if view.gone_us is None else gone_text(max(0, now_us - view.gone_us))
        return OtherVehicle(view.unit, "member", None, why)
    fields, ages = list[float](), list[int]()
    for label, names in _FIELDS.items():
        readings, answered_us, why = answer(label)
        values = _numbers(readings[-1].value, names) if readings else None
        if values is None:
            return OtherVehicle(view.unit, "member", None, f"{label}: {why or 'no value'}")
        fields += values
        ages.append(max(0, answered_us - readings[-1].valid_us))
        if ages[-1] > MOST_AGE_US:
            return OtherVehicle(view.unit, "member", None, f"{label} is {print_span(ages[-1])} old")
    latitude_deg, longitude_deg, altitude_m, north, east, down = fields
    altitude_m -= down * (ages[1] - ages[0]) / US_PER_S
    motion = VehicleMotion(latitude_deg, longitude_deg, altitude_m, (north, east, -down), ages[0], max(ages))
    return OtherVehicle(view.unit, "member", motion)


def _aircraft(readings: Iterable[Reading], answered_us: int, own_altitude_m: float) -> list[OtherVehicle]:
    """The aircraft that are no members, by name, as they were heard last; one without an altitude is taken to be at ours."""
    newest = {
        str(reading.value.get("symbol", "")): (reading.valid_us, reading.value)
        for reading in readings
        if isinstance(reading.value, Mapping)
    }
    found = []
    for name, (valid_us, value) in sorted(newest.items()):
        place = _numbers(value, _FIELDS[POSITION])
        ahead_us = max(0, answered_us - valid_us)
        age_us = ahead_us + round(max(0.0, (_numbers(value, ("age_s",)) or [0.0])[0]) * US_PER_S)
        if place is None or value.get("end") is True:
            continue
        if age_us > MOST_AIRCRAFT_AGE_US:
            found.append(OtherVehicle(name, "aircraft", None, f"heard {print_span(age_us)} ago"))
            continue
        [altitude_m] = _numbers(value, ("altitude_m",)) or [own_altitude_m]
        [error_m] = _numbers(value, ("altitude_error_m",)) or [0.0]
        east, north, up = ((_numbers(value, (each,)) or [0.0])[0] for each in ("vx_m_s", "vy_m_s", "vz_m_s"))
        velocity = north, east, up
        motion = VehicleMotion(place[0], place[1], altitude_m, velocity, ahead_us, age_us, max(0.0, error_m))
        found.append(OtherVehicle(name, "aircraft", motion))
    return found


def _numbers(value: object, names: Sequence[str]) -> list[float] | None:
    """The fields of these names; None unless all are finite numbers."""
    found = [value.get(name) for name in names] if isinstance(value, Mapping) else []
    numbers = [float(one) for one in found if isinstance(one, int | float) and not isinstance(one, bool)]
    return numbers if numbers and len(numbers) == len(names) and all(map(isfinite, numbers)) else None


def bands_of(own: OtherVehicle, others: Sequence[OtherVehicle], profile: str, goal: Goal, at_us: int) -> BandsPicture:
    """The bands of the one vehicle among all others, each carried on by its age."""
    if own.motion is None:
        rows = [ClearanceRow(one.name, one.kind, why=one.why) for one in others if one.motion is None]
        return BandsPicture(own.name, at_us, profile, goal, tuple(rows), why=own.why)
    motion, frame = own.motion, LocalFrame(*own.motion[:3])
    (north, east, up), v_own = motion.v_m_s, np.array(motion.v_m_s)
    speed_m_s, altitude_m = hypot(north, east), motion.altitude_m + up * motion.ahead_us / US_PER_S
    rows, kept = list[ClearanceRow](), list[tuple[Goal, Intruders]]()
    for kind, wanted in (("member", goal), ("aircraft", traffic_goal())):
        known = [(one, one.motion) for one in others if one.kind == kind and one.motion is not None]
        s_m = np.array([_offset_m(frame, motion, each) for _, each in known]).reshape(-1, 3)
        v_m_s = np.array([each.v_m_s for _, each in known]).reshape(-1, 3)
        rows += [_row(one, s, v - v_own, wanted) for (one, _), s, v in zip(known, s_m, v_m_s, strict=True)]
        if known:
            kept.append((wanted, Intruders(motion.v_m_s, s_m, v_m_s)))
    rows += [ClearanceRow(one.name, one.kind, why=one.why) for one in others if one.motion is None]
    is_hovering = speed_m_s < LEAST_M_S
    tried_m_s = HOVER_TRACK_M_S if is_hovering else speed_m_s
    speeds = ValueRange(0.0, max(FASTEST_M_S, float(ceil(speed_m_s))), SPEED_STEP_M_S)
    altitudes = ValueRange(altitude_m - ALTITUDES_M, altitude_m + ALTITUDES_M, ALTITUDE_STEP_M)
    return BandsPicture(
        own.name, at_us, profile, goal, tuple(rows), motion.age_us,
        None if is_hovering else round(degrees(atan2(east, north)), 3) % 360.0, speed_m_s, altitude_m, tried_m_s,
        _joined((track_bands(seen, to_keep, TRACK_STEP_DEG, least_m_s=tried_m_s) for to_keep, seen in kept), 0.0, 360.0),
        () if is_hovering else _joined(
            (speed_bands(seen, to_keep, speeds) for to_keep, seen in kept), speeds.low, speeds.high
        ),
        _joined(
            (altitude_bands(seen, to_keep, altitudes, altitude_m) for to_keep, seen in kept), altitudes.low, altitudes.high
        ),
    )  # fmt: skip


def _offset_m(frame: LocalFrame, own: VehicleMotion, other: VehicleMotion) -> tuple[float, float, float]:
    """North, east and up from the own vehicle to the other, both now; an altitude as near ours as it may be."""
    north_m, east_m, _ = frame.to_ned(other.latitude_deg, other.longitude_deg, own.altitude_m)
    up_m = other.altitude_m - own.altitude_m
    up_m -= max(-other.error_m, min(other.error_m, up_m))
    moved = [
        theirs * other.ahead_us / US_PER_S - ours * own.ahead_us / US_PER_S
        for theirs, ours in zip(other.v_m_s, own.v_m_s, strict=True)
    ]
    return north_m + moved[0], east_m + moved[1], up_m + moved[2]


def _row(other: OtherVehicle, s_m: Floats, v_m_s: Floats, goal: Goal) -> ClearanceRow:
    (x, y, z), (vx, vy, vz) = s_m.tolist(), v_m_s.tolist()
    loses_in_s = time_to_violation_s((x, y, z), (vx, vy, vz), goal.thresholds, goal.lookahead_s)
    closing = -(x * vx + y * vy)
    at_s = min(max(closing / (vx * vx + vy * vy), 0.0), goal.lookahead_s) if closing > 0.0 else 0.0
    is_clear = loses_in_s >= goal.lookahead_s
    return ClearanceRow(
        other.name, other.kind, other.motion.age_us if other.motion else None, is_clear,
        None if is_clear else loses_in_s, hypot(x, y), z, at_s, hypot(x + vx * at_s, y + vy * at_s), z + vz * at_s,
    )  # fmt: skip


def _joined(parts: Iterable[Sequence[ConflictBand]], low: float, high: float) -> tuple[ConflictBand, ...]:
    """Bands that keep well clear where all of these do; without any all does."""
    lists = [*parts]
    cuts = sorted({low, high, *(bound for one in lists for band in one for bound in band[:2] if low < bound < high)})
    joined: list[ConflictBand] = []
    for start, end in pairwise(cuts):
        middle = (start + end) / 2.0
        is_clear = all(band.is_clear for one in lists for band in one if band.low <= middle <= band.high)
        if joined and joined[-1].is_clear == is_clear:
            joined[-1] = joined[-1]._replace(high=end)
        else:
            joined.append(ConflictBand(start, end, is_clear))
    return tuple(joined)


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3) + 0.0


def _row_json(row: ClearanceRow) -> dict[str, Any]:
    return {
        name: (_rounded(value) if isinstance(value, float) else value)
        for name, value in row._asdict().items()
        if name != "why" or value
    }


def _bands_json(found: Iterable[ConflictBand]) -> list[dict[str, Any]]:
    return [{"low": round(low, 3), "high": round(high, 3), "clear": is_clear} for low, high, is_clear in found]
