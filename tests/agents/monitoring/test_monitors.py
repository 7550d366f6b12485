"""The monitors of a platform against one state stream, one transcription of the features and one monitor per pair."""

from collections.abc import Mapping
from math import sqrt
from random import Random

from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow import (
    NO_VALUE,
    SURE,
    Label,
    Network,
    Policy,
    Predicted,
    Quality,
    Sample,
    State,
    StateInput,
    StatePolicy,
    Synchronizer,
    Value,
)
from dyknow.agents.monitoring.monitor_plans import MonitorPlan, PlanBook
from dyknow.agents.monitoring.monitors import UnitMonitors
from dyknow.federation.sharing.ontology import default_ontology
from dyknow.federation.sharing.translation import LabelConversion
from dyknow.reasoning import AlarmEvent, Monitor, builtin_profiles, closest_approach, instantiate, offset_m

UNIT, OTHERS = "0", ("1", "2", "3")
LABELS = ("heli-position", "heli-altitude", "heli-velocity")
PROFILES = ("proximity", "proximity-warn", "separation-20m", "ardupilot-avoidance")
PERIOD_US = 100_000


def features(inputs: Mapping[str, Value], one: str, other: str) -> dict[str, Value]:
    """As FEATURES says, each by itself; `NO_VALUE` where something lacks."""
    here, there = inputs[f"heli-position[{one}]"], inputs[f"heli-position[{other}]"]
    low, high = inputs[f"heli-altitude[{one}]"], inputs[f"heli-altitude[{other}]"]
    u, v = inputs.get(f"heli-velocity[{one}]", NO_VALUE), inputs.get(f"heli-velocity[{other}]", NO_VALUE)
    found: dict[str, Value] = {}
    if NO_VALUE not in (low, high):
        found["z_dist"] = abs(low[0] - high[0])
    if NO_VALUE not in (here, there):
        north_m, east_m = offset_m(here, there)
        found["xy_dist"] = sqrt(north_m * north_m + east_m * east_m)
        if "z_dist" in found:
            found["dist_3d"] = sqrt(found["xy_dist"] * found["xy_dist"] + found["z_dist"] * found["z_dist"])
            if NO_VALUE not in (u, v):
                relative = [b - a for a, b in zip(u, v, strict=True)]
                time_s, xy_m, z_m = closest_approach((north_m, east_m, low[0] - high[0]), relative)
                found |= {"cpa_time": time_s * 1e6, "cpa_xy": xy_m, "cpa_z": z_m}
    return {f"{name}[{one}, {other}]": value for name, value in found.items()}


class OnePair:
    """One monitor of one pair, fed by itself."""

    def __init__(self, plan: MonitorPlan, other: str, network: Network, told: list[AlarmEvent]) -> None:
        assert plan.variable is not None
        formula = instantiate(plan.formula, plan.variable, other)
        self.names = sorted(f"{label}[{unit}]" for label in plan.labels for unit in (UNIT, other))
        self.monitor = Monitor(
            plan.name, formula, (UNIT, other), plan.period_us, plan.max_delay_us, inputs=self.names, since_us=0
        )
        self.other, self.told = other, told
        policy = Policy(change="sample", sample_us=plan.period_us, from_us=0, max_delay_us=plan.max_delay_us)
        exactly = StatePolicy(plan.period_us, plan.max_delay_us, approximation="none")
        whenever = Policy(change="sample", sample_us=plan.period_us, max_delay_us=plan.max_delay_us)
        self.states = Synchronizer([StateInput(name, whenever) for name in self.names], exactly)
        for i, name in enumerate(self.names):
            network.connect(Label.parse(name), policy, lambda sample, i=i: self.on_sample(i, sample))  # type: ignore[misc]

    def on_sample(self, i: int, sample: Sample) -> None:
        self.take(self.states.on_sample(i, sample, sample.available_us), sample.available_us)

    def on_time(self, now_us: int) -> None:
        self.take(self.states.on_time(now_us), now_us)
        self.told += self.monitor.on_time(now_us)

    def take(self, states: list[State], now_us: int) -> None:
        for state in states:
            inputs = dict(zip(self.names, state.values, strict=True))
            lacks = tuple(name for name, value in inputs.items() if value is NO_VALUE)
            values = features(inputs, UNIT, self.other)
            self.told += self.monitor.on_state(state.valid_us, now_us, values, lacks=lacks)


class Flights:
    """Some UAVs that fly straight and turn now and then, near each other or far; `rough`: how much does not arrive."""

    def __init__(self, seed: int, spread_deg: float, rough: float) -> None:
        self.random, self.rough = Random(seed), rough
        vary = self.random.uniform
        self.network, ontology = Network(history=64), default_ontology()
        for name in LABELS:
            for unit in (UNIT, *OTHERS):
                self.network.add_source(Label(name, (unit,)), ontology[name].sort, 64)
        self.at = {
            unit: (58.4 + vary(-spread_deg, spread_deg), 15.5 + vary(-spread_deg, spread_deg), vary(90, 115))
            for unit in (UNIT, *OTHERS)
        }
        self.velocity = dict.fromkeys(self.at, (0.0, 0.0, 0.0))

    def fly(self, number: int) -> list[tuple[int, str, int, Value]]:
        """What is measured at one instant: (when it arrives, label, valid time, value)."""
        random, found = self.random, []
        for unit, (latitude, longitude, altitude_m) in self.at.items():
            if random.random() < 0.1:
                self.velocity[unit] = random.uniform(-20, 20), random.uniform(-20, 20), random.uniform(-3, 3)
            north, east, down = self.velocity[unit]
            self.at[unit] = latitude + north / 1_113_200, longitude + east / 583_000, altitude_m - down / 10
            for name, value in zip(LABELS, (self.at[unit][:2], self.at[unit][2:], self.velocity[unit]), strict=True):
                late_us = random.randrange(20_000, 30_000)
                if random.random() < self.rough:
                    late_us = random.randrange(20_000, 900_000)
                if random.random() >= self.rough / 2:
                    found.append((number * PERIOD_US + late_us, f"{name}[{unit}]", number * PERIOD_US, value))
        return found


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([0.0005, 0.002, 0.02]), st.sampled_from([0.0, 0.05, 0.3]))
def test_the_alarms_are_those_of_a_monitor_for_each_pair_by_itself(seed: int, spread: float, rough: float) -> None:
    flights, told, expected = Flights(seed, spread, rough), list[AlarmEvent](), list[AlarmEvent]()
    network, book = flights.network, PlanBook(UNIT, builtin_profiles())
    ours = UnitMonitors(UNIT, network, lambda name, of: (Label(name, (of,)), LabelConversion(None)), told.append)
    for other in OTHERS:
        ours.join(other, 0)
    pairs = []
    for plan in map(book.named, PROFILES):
        ours.create(plan, "test", 0)
        pairs += [OnePair(plan, other, network, expected) for other in OTHERS]
    for at_us, name, valid_us, value in sorted(each for number in range(1, 70) for each in flights.fly(number)):
        network.push(Label.parse(name), Sample(at_us, valid_us, value))
        for each in (network, ours, *pairs):
            each.on_time(at_us)
    assert sorted(told, key=repr) == sorted(expected, key=repr)
    for pair in pairs:
        monitor = ours.named[pair.monitor.name].instances[pair.other].monitor
        for name in ("verdict", "shows", "inputs", "inputs_since_us", "counted"):
            assert getattr(monitor, name) == getattr(pair.monitor, name), name


def test_an_alarm_names_the_valid_time_of_every_sample_of_its_state() -> None:
    network, told = Network(history=64), list[AlarmEvent]()
    for unit in (UNIT, "1"):
        for name in LABELS:
            network.add_source(Label(name, (unit,)), default_ontology()[name].sort, 64)
    ours = UnitMonitors(UNIT, network, lambda name, of: (Label(name, (of,)), LabelConversion(None)), told.append)
    ours.join("1", 0)
    ours.create(PlanBook(UNIT, builtin_profiles()).named("proximity"), "test", 0)
    for number, metres in enumerate((300, 300, 5, 300, 300)):
        at_us = number * PERIOD_US
        for unit, north_m in ((UNIT, 0), ("1", metres)):
            network.push(Label("heli-position", (unit,)), Sample(at_us + 5, at_us, (58.4 + north_m / 111_320, 15.5)))
            network.push(Label("heli-altitude", (unit,)), Sample(at_us + 9, at_us, (50.0,)))
    names = {f"{name}[{unit}]" for name in LABELS[:2] for unit in (UNIT, "1")}
    assert [(each.event, each.valid_us, each.samples_us) for each in told] == [
        ("opened", 200_000, dict.fromkeys(names, 200_000)),
        ("closed", 300_000, dict.fromkeys(names, 300_000)),
    ]
    assert told[0].units == (UNIT, "1")
    assert set(told[0].values) == {f"xy_dist[{UNIT}, 1]", f"z_dist[{UNIT}, 1]"}


def test_an_alarm_of_a_pair_that_rests_on_predicted_samples_is_marked_with_when_these_were_made() -> None:
    network, ontology, told = Network(history=64), default_ontology(), list[AlarmEvent]()
    for name in LABELS:
        for unit in (UNIT, "1"):
            network.add_source(Label(name, (unit,)), ontology[name].sort, 64)
    ours = UnitMonitors(UNIT, network, lambda name, of: (Label(name, (of,)), LabelConversion(None)), told.append)
    ours.create(PlanBook(UNIT, builtin_profiles()).named("closest-approach"), "task", 0)
    ours.join("1", 0)

    def fly(t_us: int, *, other: Quality) -> None:
        """Towards each other at 20 m/s, 29 s apart at first."""
        for unit, longitude_deg, east_m_s, quality in ((UNIT, 15.0, 10.0, SURE), ("1", 15.01, -10.0, other)):
            for name, value in zip(LABELS, ((58.4, longitude_deg), (100.0,), (0.0, east_m_s, 0.0)), strict=True):
                network.push(Label(name, (unit,)), Sample(t_us, t_us, value, quality))
        ours.on_time(t_us)

    fly(PERIOD_US, other=Quality(prediction=Predicted(made_us=-4_900_000)))
    [event] = told
    assert (event.event, event.monitor, event.made_us) == ("opened", "closest-approach", -4_900_000)
    ours.remove("closest-approach", "task")
    ours.create(PlanBook(UNIT, builtin_profiles()).named("closest-approach"), "task", 0)
    fly(3 * PERIOD_US, other=SURE)
    assert [each.made_us for each in told if each.event == "opened"] == [-4_900_000, None]
