"""Tracks, identities and rows of the picture as values of their semantic labels."""

import math
from typing import Any, Final, get_args

import numpy as np

from dyknow import NO_VALUE, US_PER_S, Label, Sample, Sort, Value
from dyknow.anchoring.cooperation.attributes import LONGEST, ObjectAttribute
from dyknow.anchoring.cooperation.manoeuvres import EventKind, Pair, PairEvent, PairRelation
from dyknow.anchoring.cooperation.reports import IdentityClaim, TrackReport
from dyknow.anchoring.cooperation.rows import PictureRow
from dyknow.anchoring.links.states import UNMEASURED, ObjectState

TRACKS: Final = "object-tracks"
IDENTITIES: Final = "object-identities"
PICTURE: Final = "global-objects"
RELATIONS: Final = "pair-relations"
EVENTS: Final = "pair-events"
ATTRIBUTES: Final = "object-attributes"
"""Semantic labels."""
_NOTHING: Final = float("nan")


def track_report(unit: str, sample: Sample, sort: Sort) -> TrackReport | None:
    """The report of a sample of `object-tracks`; None: none."""
    if sample.value is NO_VALUE:
        return None
    fields = dict(zip((each.name for each in sort.fields), sample.value, strict=True))
    x_m, y_m, xx_m2, xy_m2, yy_m2 = (_number(fields[name]) for name in ("x_m", "y_m", "xx_m2", "xy_m2", "yy_m2"))
    vx_m_s, vy_m_s, sd_m_s = (_number(fields[name]) for name in ("vx_m_s", "vy_m_s", "v_sd_m_s"))
    is_moving = math.isfinite(vx_m_s) and math.isfinite(vy_m_s)
    variance = sd_m_s * sd_m_s if is_moving and math.isfinite(sd_m_s) else UNMEASURED
    covariance = np.array(
        [[xx_m2, xy_m2, 0.0, 0.0], [xy_m2, yy_m2, 0.0, 0.0], [0.0, 0.0, variance, 0.0], [0.0, 0.0, 0.0, variance]]
    )
    velocity = (vx_m_s, vy_m_s) if is_moving else (0.0, 0.0)
    attributes = {} if fields["colour"] is NO_VALUE else {"colour": fields["colour"]}
    state = ObjectState(sample.valid_us, x_m, y_m, *velocity, covariance, attributes)
    return TrackReport(unit, str(fields["symbol"]), state, fields["anchored"] is True, fields["end"] is True)


def identity_claim(unit: str, value: Value) -> IdentityClaim | None:
    """The claim of a sample of `object-identities`; None: none, or an impossible one."""
    if value is NO_VALUE:
        return None
    symbol, identity, born_s, since_s, *_ = value
    if NO_VALUE in (born_s, since_s):
        return None
    return IdentityClaim(unit, str(symbol), str(identity), round(born_s * US_PER_S), round(since_s * US_PER_S))


def claim_value(claim: IdentityClaim) -> Value:
    """A claim as a value of `object-identities`."""
    return claim.symbol, claim.identity, claim.born_us / US_PER_S, claim.since_us / US_PER_S, False


def row_value(row: PictureRow) -> Value:
    """A row as a value of `global-objects`."""
    state = row.state
    deviation_m = math.sqrt((state.covariance[0, 0] + state.covariance[1, 1]) / 2)
    colour = state.attributes.get("colour", NO_VALUE)
    return (
        row.name, state.x_m, state.y_m, state.vx_m_s, state.vy_m_s, deviation_m, colour, " ".join(row.by), bool(row.by), False
    )  # fmt: skip


def ended_value(name: str) -> Value:
    """The last value of an object of `global-objects`."""
    return name, *(NO_VALUE,) * 5, NO_VALUE, "", False, True


def attributes_of(row: PictureRow) -> dict[str, Any]:
    """The attributes of a row in an answer."""
    state = row.state
    deviation_m = math.sqrt((state.covariance[0, 0] + state.covariance[1, 1]) / 2)
    found = {
        "x_m": state.x_m, "y_m": state.y_m, "vx_m_s": state.vx_m_s, "vy_m_s": state.vy_m_s, "sd_m": deviation_m
    }  # fmt: skip
    return {name: round(float(value), 3) for name, value in found.items()} | dict(state.attributes)


def relation_value(relation: PairRelation) -> Value:
    """A relation as a value of `pair-relations`."""
    return _pair_name(relation.pair), *relation.pair, *relation.record, False


def pair_relation(sample: Sample) -> PairRelation | None:
    """The relation of a sample of `pair-relations`; None: none, or an impossible one."""
    if sample.value is NO_VALUE:
        return None
    _, one, other, *record, _ = sample.value
    return PairRelation(sample.valid_us, (one, other), tuple(each is True for each in record)) if one != other else None


def event_value(event: PairEvent) -> Value:
    """An event as a value of `pair-events`: several of one pair may be of one time."""
    return f"{_pair_name(event.pair)}-{event.kind}", *event.pair, event.kind, False


def pair_event(sample: Sample) -> PairEvent | None:
    """The event of a sample of `pair-events`; None: none, or an impossible one."""
    if sample.value is NO_VALUE:
        return None
    _, one, other, kind, _ = sample.value
    return PairEvent(sample.valid_us, (one, other), kind) if kind in get_args(EventKind) and one != other else None


def attribute_value(attribute: ObjectAttribute) -> Value:
    """A value of an attribute as one of `object-attributes`."""
    label = attribute.label
    one, other = (*label.objects, "")[:2]
    return str(label), label.feature, one, other, attribute.value, attribute.since_us / US_PER_S, False


def object_attribute(sample: Sample) -> ObjectAttribute | None:
    """The attribute of a sample of `object-attributes`; None: none, or an impossible one."""
    if sample.value is NO_VALUE or NO_VALUE in sample.value:
        return None
    _, feature, one, other, value, since_s, _ = sample.value
    since_us = round(since_s * US_PER_S)
    is_short = all(0 < len(each) <= LONGEST for each in (feature, one, value)) and len(other) <= LONGEST
    if not is_short or one == other or since_us > sample.valid_us:
        return None
    return ObjectAttribute(Label(feature, (one, other) if other else (one,)), value, since_us, sample.valid_us)


def _pair_name(pair: Pair) -> str:
    return f"{pair[0]}-{pair[1]}"


def _number(value: Value) -> float:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else _NOTHING
