"""The examples, tables and figures of section 7.8: speed(uav1) and winch(uav1), and the states made of them."""

from typing import Any, NamedTuple

import pytest

from dyknow import History, Label, Network, Policy, PolicyError, Sample, Sort, StateInput, StatePolicy, Synchronizer
from dyknow.kpl import parse_specification
from dyknow.network.process import Input
from dyknow.states.state_streams import StateStreamProcess
from tests.kpl.instances import Running
from tests.thesis.streams import state_pseudocode as thesis
from tests.thesis.streams.stream_definitions import stream

MS = 1_000
SPEED = stream([(1010, 1000, "s1"), (1110, 1100, "s2"), (1280, 1200, "s3"), (1320, 1300, "s4")])  # Table 7.1
WINCH = stream([(1120, 1050, "w1"), (1170, 1150, "w2"), (1260, 1250, "w3")])
ARRIVALS = sorted([(0, s) for s in SPEED] + [(1, s) for s in WINCH], key=lambda arrival: arrival[1].available_us)
SAMPLED = Policy.parse("sample every 100, max delay 100")
ANY = Sort("any", is_open=True)
Shown = tuple[float, float, tuple[Any, ...]]


def shown(available_us: int, valid_us: int, values: Any) -> Shown:
    return available_us / MS, valid_us / MS, values


def changes(when: Any) -> list[Any]:
    """States per change of the streams of Figure 7.8: as if nothing were delayed."""
    network, labels, got = Network(), (Label("speed", ("uav1",)), Label("winch", ("uav1",))), list[Sample]()
    for label in labels:
        network.add_source(label, ANY)
    network.add_process(Label("state"), ANY, StateStreamProcess([Input(label) for label in labels], None, when))
    network.connect(Label("state"), Policy(), got.append)
    for i, s in sorted(ARRIVALS, key=lambda arrival: arrival[1].valid_us):
        network.push(labels[i], Sample(s.valid_us, s.valid_us, s.value))
    return [(s.valid_us // MS, s.value) for s in got]


def test_example_7_8_1_figures_7_8_and_7_9_a_state_per_change_of_any_input_or_of_all() -> None:
    assert changes("any change") == [
        (1050, ("s1", "w1")), (1100, ("s2", "w1")), (1150, ("s2", "w2")),
        (1200, ("s3", "w2")), (1250, ("s3", "w3")), (1300, ("s4", "w3")),
    ]  # fmt: skip
    assert changes("all changed") == [(1050, ("s1", "w1")), (1150, ("s2", "w2")), (1250, ("s3", "w3"))]


def test_example_7_8_1_a_state_is_the_speed_and_the_winch_of_one_uav() -> None:
    running = Running(
        "source number s\nsource number w\nstrmgen speed[uav1] = s\nstrmgen winch[uav1] = w\n"
        "strmgen state1[uav1] = state(speed[uav1], winch[uav1]) with any change\nstream out = state1[uav1]"
    )
    running.push("s", 29.7)
    running.push("w", 31.8)
    assert running.values("out") == [(29.7, 31.8)]


def asked(until: int) -> list[History]:
    """What is held of the streams of Table 7.1 when a snapshot query (5.3.2) is made."""
    network, labels = Network(), [Label("speed", ("uav1",)), Label("winch", ("uav1",))]
    for label in labels:
        network.add_source(label, ANY)
    for i, s in ARRIVALS:
        if s.available_us <= until * MS:
            network.push(labels[i], s)
    return [network.snapshot(label) for label in labels]


def test_table_7_1_and_figure_7_11_what_is_asked_for_too_early_or_too_late_is_not_the_state() -> None:
    """7.8.1: the newest sample at the time point, or a maximum delay later, is of another valid time."""

    def newest(at: int) -> list[Any]:
        return [held.get_latest_vtime().value if held.get_size() else None for held in asked(at)]

    assert [newest(t) for t in (1050, 1150, 1250, 1350)] == [["s1", None], ["s2", "w1"], ["s2", "w2"], ["s4", "w3"]]
    assert [newest(t) for t in (1130, 1230, 1330)] == [["s2", "w1"], ["s2", "w2"], ["s4", "w3"]]


def test_figure_7_12_the_basic_algorithm_asks_for_what_was_most_recent_a_maximum_delay_later() -> None:
    """The product makes the same states by the improved algorithm, and none of them later."""
    points = [1050, 1150, 1250]
    basic = [tuple(held.most_recent_at(t * MS, (t + 80) * MS).value for held in asked(t + 80)) for t in points]
    improved, _ = synchronized(
        "sample every 100, from 1050 to 1250, max delay 80", Policy.parse("sample every 100, max delay 80")
    )
    assert [s[1:] for s in improved] == list(zip(points, basic, strict=True))
    assert basic == [("s1", "w1"), ("s2", "w2"), ("s3", "w3")]
    assert all(s[0] <= t + 80 for s, t in zip(improved, points, strict=True))


def synchronizer(text: str, of: Policy = SAMPLED) -> Synchronizer:
    wanted = Policy.parse(text)
    assert wanted.max_delay_us is not None
    times = (wanted.sample_us, wanted.max_delay_us, wanted.delay_before_us, wanted.from_us, wanted.to_us)
    return Synchronizer([StateInput("speed", of), StateInput("winch", of)], StatePolicy(*times))


class Row(NamedTuple):
    """What is there after one event: buffers with (valid, value), categories, and the state made by it."""

    now: int
    sync: int
    speed: list[tuple[float, str]]
    of_speed: str
    winch: list[tuple[float, str]]
    of_winch: str
    state: Shown | None = None


def buffered(states_of: Synchronizer, i: int) -> list[tuple[float, str]]:
    buffer = states_of._inputs[i].buffer
    return [(s.valid_us // MS, s.value) for s in (buffer.best, *buffer.later) if s is not None]


def synchronized(text: str, of: Policy = SAMPLED) -> tuple[list[Shown], list[Row]]:
    """All states, and after each event the row of the table; a state is in the row before the point moves on."""
    states_of = synchronizer(text, of)
    found, table = [], []

    def note(now: int) -> None:
        if states_of.sync_us is not None:
            (speed, winch) = (buffered(states_of, i) for i in range(2))
            names = [category.name for category in states_of.categories]
            table.append(Row(now, states_of.sync_us // MS, speed, names[0], winch, names[1]))

    events = [(1000 * MS, None), *((s.available_us, (i, s)) for i, s in ARRIVALS)]
    states_of.on_time(events[0][0])
    note(1000)
    for at_us, arrival in events[1:]:
        while (due_us := states_of.deadline_us) is not None and due_us < at_us:
            found += states_of.on_time(due_us)
        if arrival is not None and states_of.sync_us is not None:
            found += states_of.on_sample(*arrival, at_us)
            note(at_us // MS)
    while (due_us := states_of.deadline_us) is not None:
        found += states_of.on_time(due_us)
    return [shown(*s[:3]) for s in found], table


S1, S2, S3, W1, W2, W3 = (1000, "s1"), (1100, "s2"), (1200, "s3"), (1050, "w1"), (1150, "w2"), (1250, "w3")
STATES = [(1120, 1050, ("s1", "w1")), (1170, 1150, ("s2", "w2")), (1280, 1250, ("s3", "w3"))]
TABLE_7_2 = [
    Row(1000, 1050, [], "NOAPRX_MORE", [], "NOAPRX_MORE"),
    Row(1010, 1050, [S1], "APRX_FINAL", [], "NOAPRX_MORE"),
    Row(1110, 1050, [S1, S2], "APRX_FINAL", [], "NOAPRX_MORE"),
    Row(1120, 1050, [S1, S2], "APRX_FINAL", [W1], "EXACT", STATES[0]),
    Row(1120, 1150, [S2], "APRX_FINAL", [W1], "APRX_MORE"),
    Row(1170, 1150, [S2], "APRX_FINAL", [W2], "EXACT", STATES[1]),
    Row(1170, 1250, [S2], "APRX_MORE", [W2], "APRX_MORE"),  # the table prints w1, which w2 made obsolete
    Row(1260, 1250, [S2], "APRX_MORE", [W3], "EXACT"),
    Row(1280, 1250, [S3], "APRX_FINAL", [W3], "EXACT", STATES[2]),  # the table prints s2 for s3
]
POLICY_OF_TABLE_7_2 = "from 1050 to 1250, sample every 100, delay before approximation 100, max delay 100"


@pytest.mark.parametrize("number", range(1, 10))
def test_table_7_2_row_by_row(number: int) -> None:
    """A row with a state is what the pseudo-code sees in the moment it makes it; the product has then moved on."""
    row = TABLE_7_2[number - 1]
    states, table = synchronized(POLICY_OF_TABLE_7_2)
    if row.state is None:
        assert row in table
    else:
        assert row.state in states
        assert row.state[:2] == (row.now, row.sync)
    wanted = thesis.Wanted(1050 * MS, 1250 * MS, 100 * MS, 100 * MS, 100 * MS)
    made, steps = thesis.sampled_synchronized_state_stream([SAMPLED] * 2, ARRIVALS, wanted, 1000 * MS)
    names = [(s.now_us // MS, s.sync_us // MS, *(category.name for category in s.categories)) for s in steps]
    assert (row.now, row.sync, row.of_speed, row.of_winch) in names
    assert row.state is None or row.state in [shown(*s[:3]) for s in made]


def test_figure_7_13_the_states_of_the_improved_algorithm_are_the_optimal_ones() -> None:
    states, table = synchronized(POLICY_OF_TABLE_7_2)
    assert states == STATES
    assert [row for row in table if row.state is None] == [row for row in TABLE_7_2 if row.state is None]


def test_example_7_8_2_synchronised_every_100_from_1050_to_1250() -> None:
    running = Running(
        "source number s\nsource number w\nstrmgen speed[uav1] = s\nstrmgen winch[uav1] = w\n"
        "strmgen both[uav1] = state(speed[uav1] with sample every 100, winch[uav1] with sample every 100)\n"
        "    with sample every 100, from 1050 to 1250, max delay 80\nstream out = both[uav1]"
    )
    for i, s in ARRIVALS:
        running.wait(s.available_us)
        running.instance.push("sw"[i], Sample(s.available_us, s.valid_us, int(s.value[1])))
    running.wait(2_000 * MS)
    found = [(s.valid_us // MS, s.value) for _, s in running.outputs]
    assert found == [(1050, (1, 1)), (1150, (2, 2)), (1250, (3, 3))]


def test_example_7_8_2_the_period_is_the_greatest_common_divisor_of_the_inputs() -> None:
    hundred, seventy_five = Policy.parse("sample every 100"), Policy.parse("sample every 75")
    two = [StateInput("speed", hundred), StateInput("winch", hundred)]
    assert Synchronizer(two, StatePolicy(None, 80_000)).period_us == 100_000
    assert Synchronizer([two[0], StateInput("winch", seventy_five)], StatePolicy(None, 80_000)).period_us == 25_000
    with pytest.raises(PolicyError, match="sample every"):
        Synchronizer([two[0], StateInput("clicks", Policy())], StatePolicy(None, 80_000))


@pytest.mark.parametrize(
    ("patience", "left", "value"), [(10, 1160, "w1"), (20, 1170, "w2"), (21, 1170, "w2"), (100, 1170, "w2")]
)
def test_example_7_8_3_how_long_to_wait_before_an_old_value_is_used(patience: int, left: int, value: str) -> None:
    text = f"from 1150 to 1150, sample every 100, delay before approximation {patience}, max delay 100"
    states, table = synchronized(text)
    at = {row.now: (row.of_speed, row.of_winch) for row in table}
    assert at[1110] == ("APRX_FINAL", "NOAPRX_MORE"), "the next speed is valid at 1200"
    assert at[1120] == ("APRX_FINAL", "APRX_MORE"), "the next winch is expected to be valid at 1150"
    assert states == [(left, 1150, ("s2", value))]


def test_definition_7_8_6_the_declaration_printed_there() -> None:
    text = (
        "strmgen s = state(f1, f2) with from 1050 to 1250, sample every 100, use most recent, "
        "delay before approximation 100, max delay 100"
    )
    (declaration,) = parse_specification(text)
    policy = declaration.made.policy  # type: ignore[union-attr]
    assert (policy.from_us, policy.to_us, policy.sample_us) == (1050 * MS, 1250 * MS, 100 * MS)
    assert (policy.delay_before_us, policy.max_delay_us, policy.approximation) == (100 * MS, 100 * MS, "most recent")
