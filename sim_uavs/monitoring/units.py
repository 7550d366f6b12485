"""The source of `traffic.kpl` from outside: the map of the scenario's streets."""

from dyknow.anchoring.traffic.units import road_units
from dyknow.sim_uavs.dynamics.scenarios import scenario
from dyknow.sim_uavs.roads.layouts import network_of
from dyknow.sim_uavs.streets import roads_of

UNITS = road_units(network_of(roads_of(scenario("traffic"))))
