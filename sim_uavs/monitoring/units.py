"""The source of `traffic.kpl` from outside: the map of the scenario's streets."""

from anchoring.traffic.units import road_units
from sim_uavs.dynamics.scenarios import scenario
from sim_uavs.roads.layouts import network_of
from sim_uavs.streets import roads_of

UNITS = road_units(network_of(roads_of(scenario("traffic"))))
