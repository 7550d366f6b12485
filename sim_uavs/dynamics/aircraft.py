"""Aircraft that are no members and fly over a vehicle on a straight line, for its receivers to hear. Pure, NED of its home.

The faults `helicopter=60` and `drone=15` have one come from the east at that speed in metres a second, at the height that the vehicle has when
they begin, over the place where it is then.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

from dyknow.model.instants import US_PER_S
from dyknow.sim_uavs.dynamics.faults import ActiveFaults
from dyknow.sim_uavs.dynamics.quadcopter import Vector

AWAY_S: Final = 110.0
"""How long an aircraft flies until it is over the vehicle."""
_KINDS: Final = ("helicopter", "drone")


class PassingAircraft(NamedTuple):
    """One of them at a time; a helicopter broadcasts ADS-B, a drone Remote ID."""

    kind: str
    position: Vector
    velocity: Vector


class PassingTraffic:
    """The aircraft that fly past one vehicle while such a fault holds, heard once a second."""

    def __init__(self) -> None:
        self._over: dict[str, tuple[int, Vector]] = {}
        self._heard_us = 0

    def heard(self, now_us: int, faults: ActiveFaults, own: Vector) -> list[PassingAircraft]:
        """The aircraft received now; empty between two broadcasts."""
        if now_us < self._heard_us:
            return []
        self._heard_us = now_us - now_us % US_PER_S + US_PER_S
        return list(self._flying(now_us, faults, own))

    def _flying(self, now_us: int, faults: ActiveFaults, own: Vector) -> Iterator[PassingAircraft]:
        for kind in _KINDS:
            speed_m_s = faults.amount(kind, now_us)
            if speed_m_s is None:
                self._over.pop(kind, None)
                continue
            begun_us, over = self._over.setdefault(kind, (now_us, own))
            to_fly_m = speed_m_s * (AWAY_S - (now_us - begun_us) / US_PER_S)
            yield PassingAircraft(kind, over.plus(Vector(0.0, to_fly_m, 0.0)), Vector(0.0, -speed_m_s, 0.0))
