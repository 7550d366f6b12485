"""Beliefs as records of a sort, field by field: attributes without a field are left out, fields without a belief have
no value.

symbol, existence, status, type, types, x_m, y_m, vx_m_s, vy_m_s, sd_m, v_sd_m_s, seen_by, known, end,
p_T: the probability of the type T, and the attributes of the model
"""

from collections.abc import Mapping
from math import sqrt
from typing import Final

from dyknow import NO_VALUE, Sort, Value
from dyknow.anchoring.belief.arrays import Floats
from dyknow.anchoring.belief.description import POSITION
from dyknow.anchoring.belief.live.watch import ReportedBelief
from dyknow.anchoring.percepts.records import GEOGRAPHIC
from dyknow.model.sample import Quality
from dyknow.model.values import END, SYMBOL, Field
from dyknow.navigation import LocalFrame

BELIEF: Final = "belief"
BELIEF_SORT: Final = Sort(
    BELIEF,
    (
        Field(SYMBOL, "text"), Field("existence", "fraction"), Field("status", "text"), Field("type", "text"),
        Field("types", "text"), Field("x_m", "m"), Field("y_m", "m"), Field("vx_m_s", "m/s"), Field("vy_m_s", "m/s"),
        Field("sd_m", "m"), Field("v_sd_m_s", "m/s"), Field("colour", "text"), Field("seen_by", "text"),
        Field("known", "text"), Field(END, "bool"),
    ),
)  # fmt: skip
"""The sort of beliefs unless one is declared; that of the semantic label `believed-objects`."""
PROBABILITY: Final = "p_"


class BeliefRecords:
    """Writes beliefs as records of a sort.

    Args:
        frame: of the positions, if it is known where they are 0.
    """

    def __init__(self, sort: Sort, frame: LocalFrame | None) -> None:
        self._names = tuple(each.name for each in sort.fields)
        self._frame = frame if {*GEOGRAPHIC} & {*self._names} else None

    def value(self, reported: ReportedBelief) -> Value:
        """The record of one belief."""
        each = reported.instance
        known: dict[str, Value] = {SYMBOL: each.name, END: reported.ended}
        if not reported.ended:
            known |= {f"{PROBABILITY}{name}": share for name, share in each.type.items()}
            known |= {"existence": each.existence, "status": each.status, "known": each.known or NO_VALUE}
            known |= {
                "type": likeliest(each.type),
                "types": shares_text(each.type),
                "seen_by": " ".join(reported.seen_by),
            }
            known |= self._place(reported)
            known |= {name: likeliest(shares) for name, shares in each.categorical.items()}
        return tuple(known.get(name, NO_VALUE) for name in self._names)

    def _place(self, reported: ReportedBelief) -> dict[str, Value]:
        """Where it is, and all other numbers."""
        found: dict[str, Value] = {}
        for name, (mean, covariance) in reported.instance.gaussian.items():
            if name != POSITION:
                found[name] = float(mean[0])
                continue
            x_m, y_m = mean[:2].tolist()
            found |= {"x_m": x_m, "y_m": y_m, "sd_m": _deviation(covariance, 0)}
            if len(mean) >= 4:
                found |= {"vx_m_s": float(mean[2]), "vy_m_s": float(mean[3]), "v_sd_m_s": _deviation(covariance, 2)}
            if self._frame is not None:
                found |= zip(GEOGRAPHIC, self._frame.level(y_m, x_m, 0.0), strict=True)
        return found


def _deviation(covariance: Floats, first: int) -> float:
    """The standard deviation on each of two axes, in the mean."""
    return sqrt((covariance[first, first] + covariance[first + 1, first + 1]) / 2.0)


def quality_of(reported: ReportedBelief) -> Quality:
    """A belief is as certain as that something is there; that it is given up is certain."""
    return Quality(1.0 if reported.ended else min(1.0, max(0.0, reported.instance.existence)))


def likeliest(shares: Mapping[str, float]) -> str:
    """The value with the greatest probability."""
    return max(shares, key=shares.__getitem__)


def shares_text(shares: Mapping[str, float]) -> str:
    """`car 0.82, truck 0.18`, the likeliest first."""
    ordered = sorted(shares.items(), key=lambda each: -each[1])
    return ", ".join(f"{name} {share:.2f}" for name, share in ordered if share >= 0.005)
