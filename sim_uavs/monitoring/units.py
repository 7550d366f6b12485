"""What `traffic.kpl` takes from outside: the map of the scenario's streets, and what an observed state is."""

from typing import Final

from anchoring.traffic.units import road_units
from dyknow import Sample, Value, computational_unit
from sim_uavs.dynamics.scenarios import scenario
from sim_uavs.roads.layouts import network_of
from sim_uavs.streets import roads_of

SURE: Final = 0.9
"""Of an object that is less certainly the one that a percept shows it is not told where it went."""
UNITS = road_units(network_of(roads_of(scenario("traffic"))))


@computational_unit("tracked-object", "tracked-object")
class Observed:
    """States of an object while a percept shows it that can hardly be another, and none while it is predicted.

    `anchored` is the field before the last.
    """

    def __call__(self, _now_us: int, state: Sample) -> Value:
        is_shown = isinstance(state.value, tuple) and state.value[-2] is True
        return state.value if is_shown and state.quality.certainty >= SURE else None
