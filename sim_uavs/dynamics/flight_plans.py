"""From a scenario's route to the plan that a platform's pilot flies."""

from dyknow.agents.places import FlightPlan, Waypoint
from dyknow.sim_uavs.dynamics.routes import Route


def plan_of(route: Route, start_us: int) -> FlightPlan:
    """The route, from `start_us` (federation time) on."""
    return FlightPlan(tuple(Waypoint(*place) for place in route.waypoints), route.speed_m_s, start_us, route.loop)
