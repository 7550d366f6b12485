"""What is wrong about objects in a specification: told with its place, the cause and a repair."""

import pytest

from dyknow.kpl import parse_specification
from dyknow.model.errors import TextErrors
from tests.kpl.instances import Running

BEFORE = """\
sort car(symbol in text, x_m in m, y_m in m, colour in text)
sort truck(symbol in text, length_m in m, vx_m_s in m/s, vy_m_s in m/s)
source car seen
source truck scale
source number depth
strmgen cars = seen
strmgen trucks = scale
strmgen deep = depth
"""


def errors_of(text: str) -> list[tuple[str, str]]:
    running = Running(BEFORE)
    try:
        running.add(text)
    except TextErrors as told:
        return [(each.message, each.repair) for each in told.errors]
    return []


@pytest.mark.parametrize(
    "text",
    [
        "stream s = cars.objects",
        "stream s = cars[car1]",
        "stream s = cars.colour[car1]",
        "stream s = colour[car1]",
        "stream s = type[car1]",
        "for c in cars.objects stream x = cars.x_m[c]",
        "for c in cars monitor m = always x_m[c] < 3",
        "strmgen s = merge cars.colour[c] for c in cars\nstream t = s",
        'monitor m = always forall c in cars: colour[c] = "red" and type[c] = "car"',
        "monitor m = always forall a in cars: forall b in cars - {a}: xy_dist[a, b] > 3",
        "monitor m = always forall c in cars.objects: xy_dist[self, c] > 3",
        "monitor m = always forall t in trucks: speed[t] < 30 and length_m[t] < 25",
        "monitor m = always exists t in trucks: length_m[t] > 3",
        "define near[a, b] = xy_dist[a, b] < 3\nmonitor m = always forall c in cars: not near[self, c]",
        "for c in cars export heli-altitude = cars.x_m[c]",
    ],
)
def test_what_is_right_about_objects_is_accepted(text: str) -> None:
    assert errors_of(text) == []


@pytest.mark.parametrize(
    ("text", "said", "repair"),
    [
        ("monitor m = always forall c in crs: x_m[c] < 3", "there is no domain crs", "cars"),
        ("for c in crs stream x = cars.x_m[c]", "nothing makes crs", "cars"),
        (
            "for c in deep.objects stream x = cars.x_m[c]",
            "deep is no stream of object states, whose sort begins with `symbol in text`",
            "cars.objects",
        ),
        (
            'monitor m = always forall c in cars: color[c] = "red"',
            "cars are of sort car, which has no color; it has symbol, x_m, y_m, colour",
            "colour[c]",
        ),
        (
            "monitor m = always forall c in cars: length_m[c] < 3",
            "cars are of sort car, which has no length_m; it has symbol, x_m, y_m, colour",
            "",
        ),
        (
            "monitor m = always forall c in cars: speed[c] < 3",
            "speed cannot be derived of cars: their sort car has no vx_m_s and vy_m_s",
            "sort car with these fields; it has symbol, x_m, y_m, colour",
        ),
        ("monitor m = always forall c in trucks: xy_dist[self, c] < 3", "xy_dist cannot be derived of trucks", ""),
        ("monitor m = always forall c in cars: xy_dist[c] > 3", "xy_dist takes 2 objects, here are 1", "xy_dist"),
        ("stream s = cars.color[car1]", "has no field color", "cars.colour[car1]"),
        ("stream s = cars[car1, car2]", "nothing makes cars[car1, car2]", ""),
        ("monitor m = always forall c in cars: colour[c] > 3", "an object has no order", ""),
        ("monitor m = always forall c in deep.x: colour[c] = red", "", ""),
    ],
)
def test_what_is_wrong_about_objects_is_told_with_its_repair(text: str, said: str, repair: str) -> None:
    found = errors_of(text)
    assert found
    assert said in found[0][0]
    assert repair in found[0][1]


def test_a_stream_of_objects_is_not_taken_away_from_under_what_needs_it() -> None:
    running = Running(f"{BEFORE}for c in cars.objects stream x = cars.x_m[c]\nstream y = colour[car1]\n")
    with pytest.raises(TextErrors, match="nothing makes cars"):
        running.remove("strmgen cars = seen\n")


def test_nothing_is_missing_and_nothing_superfluous_in_what_is_right() -> None:
    running = Running()
    text = BEFORE.replace("source number depth\n", "").replace("strmgen deep = depth\n", "")
    text += "for c in cars.objects stream x = cars.x_m[c]\n"
    text += "monitor m = always forall t in trucks: length_m[t] < 25 and speed[t] < 30\n"
    findings = running.instance.findings(parse_specification(text), text=text)
    assert (findings.errors, findings.warnings) == ((), ())
