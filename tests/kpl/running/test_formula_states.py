"""What a formula takes is said in KPL, and that is what it takes (thesis 7.5, 7.8)."""

import json

import pytest

from dyknow.kpl import parse_specification, print_formula, print_specification
from dyknow.kpl.introspection.drawings import as_json, as_text
from dyknow.kpl.introspection.graph import graph_of
from dyknow.kpl.running.asking import read_over
from dyknow.model.errors import TextErrors
from tests.kpl.instances import Running

BASE = """
source number raw
source number other
source object cars
strmgen v[car1] = raw
strmgen v[car2] = other
strmgen w[2, car1] = other
strmgen car_ids = cars
define LIMIT = 5
define fast[c] = v[c] > LIMIT
"""


@pytest.mark.parametrize(
    "policy",
    [
        "",
        " with sample every 50",
        " with sample every 70, max delay 20, importance 3",
        " with sample every 50, max delay 200, delay before approximation 30, from 100 to 900",
        " with sample every 20, no approximation",
        " with sample every 60, from 0, max delay 40, use most recent",
        " with sample every 61, from 0, max delay 40, max age 4",
    ],
)
def test_a_monitor_says_in_kpl_which_states_it_is_made_of(policy: str) -> None:
    """The streams never fall silent, whose values a monitor forgets, and a state stream does not."""
    running = Running(f"{BASE}monitor calm = always (not fast[car1] and w[2, car1] < v[car2]){policy}\n")
    made: list[tuple[object, ...]] = []
    calm = running.instance.monitors["calm"]
    calm.listeners.append(lambda state: made.append((state.valid_us, *state.values.values())))
    said = print_specification(calm.states.declarations("calm"))
    running.add(f"{said}stream told = calm_states\n")
    for n in range(240):
        running.push("raw", n % 7, 10_000 * n + 3_000 * (n % 3))
        running.push("other", n % 5, 10_000 * n + 3_000 * (n % 3) + 1)
    running.wait(2_400_000)
    told = [(sample.valid_us, *sample.value) for name, sample in running.outputs if name == "told"]
    assert len(told) > 8
    assert told == made[: len(told)]


def test_what_is_taken_is_shown_in_the_graph_with_domains_and_what_did_not_come() -> None:
    running = Running(
        f"{BASE}monitor calm = always forall c in car_ids: not fast[c] with sample every 100, max delay 50\n"
    )
    running.push("cars", ("car1", "car2"))
    for _ in range(30):
        running.push("raw", 1)
    running.wait(1_000_000)
    graph = graph_of(running.instance)
    node = next(each for each in as_json(graph)["nodes"] if each["name"] == "calm")
    assert json.loads(json.dumps(node["states"])).splitlines() == [
        "strmgen calm_states = state(v[car1] with max delay 50, v[car2] with max delay 50) with sample every 100, max delay 50",
        "stream calm_car_ids = car_ids",
    ]
    parse_specification(node["states"])
    assert node["counted"]["missing"] > 0
    assert f"    states missing: {node['counted']['missing']}\n" in as_text(graph)
    assert "    stream calm_car_ids = car_ids\n" in as_text(graph)


def test_a_formula_of_somebody_who_asks_means_what_it_means_in_the_specification() -> None:
    running = Running(BASE)
    before = running.state()
    assert print_formula(read_over(running.instance, "always fast[car1]")) == "always v[car1] > 5"
    assert running.state() == before


@pytest.mark.parametrize(
    ("text", "said", "repair"),
    [
        ("always fst[car1]", "nothing here makes fst", "fast[car1]"),
        ("always v[car11] > 3", "car11 is free", "car1"),
        ("always v[2] > 3", "nothing here makes v[2]", "v[car2]"),
        ("always forall c in carids: fast[c]", "there is no domain carids", "car_ids"),
        ("always fastt[car1]", "nothing here makes fastt", "fast[car1]"),
        ("occurred(chronicle[turns])", "nothing here makes chronicle[turns]", ""),
    ],
)
def test_what_nobody_makes_is_told_with_what_may_have_been_meant(text: str, said: str, repair: str) -> None:
    running = Running(BASE)
    before = running.state()
    with pytest.raises(TextErrors) as raised:
        read_over(running.instance, text)
    assert said in raised.value.message
    assert raised.value.repair == repair
    assert running.state() == before
