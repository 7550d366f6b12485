"""Vehicles that SUMO drove: its floating car data (`sumo --fcd-output FILE`), in place of traffic of our own.

`<timestep time="0.1"> <vehicle id="v0" x="5.1" y="-1.6" angle="90" speed="3.2" type="truck" lane="e1_0"/>`: metres of the middle
of the front bumper, degrees clockwise from north; lanes whose edge begins with `:` are inside of a junction. Links and
crossings are those of the network as `dyknow.anchoring.roads` reads it. SUMO itself is not needed.
"""

from collections.abc import Iterator
from math import cos, isfinite, nan, pi, radians, sin
from xml.etree.ElementTree import Element

from dyknow.anchoring.roads.files.problems import Problems
from dyknow.anchoring.roads.files.xml_elements import elements
from dyknow.model.errors import WrongCall
from dyknow.sim_uavs.roads.drivers import BUILDS, RoadKind, RoadState

_KINDS: tuple[RoadKind, ...] = ("motorcycle", "truck", "car")


def floating_cars(text: str | bytes) -> Iterator[tuple[int, list[RoadState]]]:
    """(valid time, vehicles) of each timestep.

    Raises:
        WrongCall: the text is no floating car data, or a number is missing; it is raised where that is met.
    """
    problems = Problems("timestep")
    for element in elements(text, "fcd-export", problems):
        states = [_state(vehicle) for vehicle in element.iter("vehicle")]
        yield round(_number(element, "time") * 1e6), states
    if problems.has_errors:
        raise WrongCall(f"floating car data of SUMO: {problems.survey(None).problems[0].drawn}")


def _state(vehicle: Element) -> RoadState:
    x, y, speed = (_number(vehicle, name) for name in ("x", "y", "speed"))
    heading = radians(90.0 - _number(vehicle, "angle"))
    kind: RoadKind = next((each for each in _KINDS if each in vehicle.get("type", "").lower()), "car")
    back = BUILDS[kind].length_m / 2.0
    edge = vehicle.get("lane", "").rpartition("_")[0]
    inside = edge.startswith(":")
    return RoadState(
        vehicle.get("id", ""), kind, "grey", x - back * cos(heading), y - back * sin(heading),
        (heading + pi) % (2.0 * pi) - pi, speed, None if inside or not edge else edge, 1,
        edge[1:].rpartition("_")[0] if inside else None, None,
    )  # fmt: skip


def _number(element: Element, name: str) -> float:
    text = element.get(name, "")
    try:
        number = float(text)
    except ValueError:
        number = nan
    if not isfinite(number):
        place = f"{element.tag} {element.get('id', '')}".strip()
        raise WrongCall(f'floating car data of SUMO: {place} has {name}="{text}"; write it with --fcd-output')
    return number
