"""Chronicles over streams of an instance, and formulas that ask whether one was recognised (thesis 8.7.3, 8.7.5)."""

import pytest

from dyknow import Network, Sample
from dyknow.kpl import Hooks, Instance, parse_specification, print_specification
from dyknow.kpl.introspection.drawings import as_text
from dyknow.kpl.introspection.graph import graph_of
from dyknow.model.errors import SourceText, TextErrors

MS = 1000
TURNS = """
attribute link[?car]
message in_crossing[?car, ?crossing]

chronicle enters[?car, ?from, ?to] {
    event(link[?car]:(?from, no_link), t1)
    event(in_crossing[?car, ?x], t2)
    event(link[?car]:(no_link, ?to), t3)
    t1 <= t2 <= t3
    t3 - t1 <= 10s
}
"""
STREAMS = """
source text links
source text others
source object cars
source text crossings
strmgen car_ids = cars
for car in car_ids strmgen link[car] = links
strmgen link[lorry] = others
strmgen in_crossing[a, x2] = crossings
chronicle file "turns.chr" with max delay 100
stream turned = chronicle[enters]
stream lorry_turned = chronicle[enters, lorry, l1, l2]
"""


class Run:
    """An instance that is fed, and what came of it; times in ms."""

    def __init__(self, text=STREAMS, chronicles=TURNS):
        self.told, self.faults, self.alarms, self.chronicles = [], [], [], chronicles
        self.network = Network()
        hooks = Hooks(
            lambda name, sample: self.told.append((name, sample)),
            on_alarm=self.alarms.append,
            on_fault=lambda label, said: self.faults.append(f"{label}: {said}"),
        )
        self.instance = Instance(self.network, hooks=hooks)
        self.change(text)

    def change(self, text, at_ms=0):
        text = SourceText(text, "run.kpl")
        found = parse_specification(text, lambda _path: self.chronicles)
        self.instance.change(found, at_ms * MS, text)

    def at(self, now_ms):
        while (due_us := self.network.deadline_us) is not None and due_us <= now_ms * MS:
            self.network.on_time(due_us)
        self.network.on_time(now_ms * MS)

    def feed(self, source, valid_ms, value, now_ms=None):
        now_ms = valid_ms if now_ms is None else now_ms
        self.at(now_ms)
        self.instance.push(source, Sample(now_ms * MS, valid_ms * MS, value))


def drive(run, source="links"):
    run.feed(source, 1000, "l1")
    run.feed(source, 2000, "no_link")
    run.feed(source, 2500, "no_link")
    run.feed("crossings", 3000, True)
    run.feed(source, 4000, "l2")
    run.at(4099)
    before = len(run.told)
    run.at(4100)
    return before


def test_changes_of_streams_are_events_and_what_is_recognised_is_a_stream():
    run = Run()
    run.feed("cars", 0, ("a",))
    assert drive(run) == 0, "samples may be 100 ms late"
    ((name, sample),) = run.told
    assert name == "turned"
    assert sample.valid_us == 4_000_000
    arguments, bindings, instants = sample.value
    assert arguments == ("a", "l1", "l2")
    assert dict(bindings) == {"?car": "a", "?from": "l1", "?x": "x2", "?to": "l2"}
    assert instants == (("t1", 2000), ("t2", 3000), ("t3", 4000))
    assert run.faults == []


def test_samples_that_come_in_another_order_than_they_are_valid_are_told_in_that():
    run = Run()
    run.feed("cars", 0, ("a",))
    run.feed("links", 1000, "l1")
    run.feed("crossings", 2010, True, 2011)
    run.feed("links", 2000, "no_link", 2050)
    run.feed("links", 4000, "l2")
    run.at(5000)
    assert [name for name, _ in run.told] == ["turned"]


def test_arguments_choose_among_what_is_recognised_and_members_come_and_go():
    other = STREAMS.replace("in_crossing[a, x2]", "in_crossing[lorry, x2]")
    run = Run(other)
    drive(run, "others")
    assert sorted(name for name, _ in run.told) == ["lorry_turned", "turned"]
    run.feed("cars", 5000, ("a", "b"))
    held = run.instance.chronicles["turns.chr"].watch.proxies
    assert {str(label) for label in held} == {"link[a]", "link[b]", "link[lorry]", "in_crossing[lorry, x2]"}
    run.feed("cars", 6000, ("b",))
    assert {str(label) for label in held} == {"link[b]", "link[lorry]", "in_crossing[lorry, x2]"}


def test_a_formula_may_say_that_one_occurred():
    text = STREAMS + "monitor none = always not occurred(chronicle[enters]) with sample every 100, max delay 200\n"
    run = Run(text)
    run.feed("cars", 0, ("a",))
    drive(run)
    assert run.alarms == []
    run.at(4400)
    assert [(alarm.event, alarm.valid_us) for alarm in run.alarms] == [("opened", 4_000_000), ("closed", 4_100_000)]


def test_what_is_no_symbol_is_told_once_and_ends_nothing():
    run = Run()
    run.feed("cars", 0, ("a",))
    for at_ms in range(0, 500, 100):
        run.feed("links", at_ms, 1.5)
    drive(run)
    (fault,) = run.faults
    assert "link[a]: 1.5 is no symbol" in fault
    assert [name for name, _ in run.told] == ["turned"]


def test_taking_a_file_back_leaves_nothing_and_another_text_is_another_chronicle():
    run = Run()
    run.feed("cars", 0, ("a",))
    labels = len(run.network.labels())
    rest = "\n".join(line for line in STREAMS.splitlines() if "chronicle" not in line)
    run.change(rest, 10)
    assert not run.instance.chronicles
    assert not any(label.feature == "chronicle" for label in run.network.labels())
    run.change(STREAMS, 20)
    assert len(run.network.labels()) == labels
    run.chronicles = TURNS.replace("10s", "1s")
    run.change(STREAMS, 30)
    drive(run)
    assert run.told == []


def test_it_is_printed_as_it_was_written():
    run = Run()
    assert 'chronicle file "turns.chr" with max delay 100' in print_specification(run.instance.specification)


@pytest.mark.parametrize(
    ("chronicles", "line", "said"),
    [
        (TURNS.replace("?car, ?x]", "?car]"), "", "in_crossing"),
        (TURNS, "stream x = chronicle[leaves]\n", "nothing makes chronicle[leaves]"),
        (TURNS, 'chronicle file "more.chr"\n', "enters is a chronicle already"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(chronicles, line, said):
    refused(STREAMS + line, chronicles, said)


@pytest.mark.parametrize(
    ("chronicles", "policy", "said"),
    [
        (TURNS, "sample every 100", "chronicles know max delay, max age"),
        ("domain d = {a}\n", "max delay 1s", "declares no chronicle"),
    ],
)
def test_what_cannot_be_recognised_is_refused(chronicles, policy, said):
    refused(f'chronicle file "turns.chr" with {policy}\n', chronicles, said)


def refused(text, chronicles, said):
    with pytest.raises(TextErrors) as wrong:
        Run(text, chronicles)
    assert said in " ".join(str(each) for each in wrong.value.errors)


def test_a_file_that_cannot_be_read_is_told_where_it_is_named():
    def missing(path):
        raise FileNotFoundError(path)

    with pytest.raises(TextErrors) as wrong:
        parse_specification(SourceText(STREAMS, "run.kpl"), missing)
    (error,) = wrong.value.errors
    assert "turns.chr cannot be read" in str(error)
    assert error.line == STREAMS.splitlines().index('chronicle file "turns.chr" with max delay 100') + 1


CHANGED = """
attribute lit[?lamp]

chronicle switched[?lamp] {
    event(lit[?lamp]:(?, on), t1)
    event(lit[?lamp]:(on, off), t2)
    t1 < t2
}
"""


def switched(options, *samples):
    text = f'source text lamp\nstrmgen lit[a] = lamp\nchronicle file "l.chr" with max delay 100{options}\nstream s = chronicle[switched]\n'
    assert parse_specification(print_specification(parse_specification(text))) == parse_specification(text)
    run = Run(text, CHANGED)
    for valid_ms, value in samples:
        run.feed("lamp", valid_ms, value)
    run.at(60_000)
    return [dict(sample.value[2]) for name, sample in run.told if name == "s"]


def test_first_values_are_changes_at_their_time_or_have_been_so_since_ever():
    samples = (1000, "on"), (2000, "off")
    assert switched("", *samples) == [{"t1": 1000, "t2": 2000}]
    (since_ever,) = switched(", first values since ever", *samples)
    assert (since_ever["t1"] < -(2**40), since_ever["t2"]) == (True, 2000)
    assert switched(", first values of lit since ever", *samples) == [since_ever]


TWO = """
attribute map.left[?way] { ?value in {true, false} }
attribute link[?car]

chronicle turns[?car, ?way] {
    event(map.left[?way]:(?, true), t1)
    event(link[?car]:(?, ?way), t2)
    event(link[?car]:(?way, away), t3)
    t1 < t2
    t2 < t3
}
"""


@pytest.mark.parametrize(("of", "count"), [("", 0), (" of map", 1), (" of map, link", 0), (" of link", 0)])
def test_what_a_map_says_has_been_so_since_ever_and_what_cars_do_has_not(of, count):
    text = f"""source bool map
source text car
strmgen map.left[l1] = map
strmgen link[c] = car
chronicle file "l.chr" with max delay 100, max age 5s, first values{of} since ever
stream s = chronicle[turns]
"""
    assert parse_specification(print_specification(parse_specification(text))) == parse_specification(text)
    run = Run(text, TWO)
    for name, valid_ms, value in [("map", 1000, True), ("car", 20_000, "l1"), ("car", 22_000, "away")]:
        run.feed(name, valid_ms, value)
    run.at(60_000)
    assert len([name for name, _ in run.told if name == "s"]) == count


def test_with_a_maximum_age_longer_instances_are_not_recognised_and_what_is_older_is_forgotten():
    samples = (1000, "on"), (3000, "off"), (10_000, "on"), (20_000, "off")
    assert [each["t2"] for each in switched("", *samples)] == [3000, 20_000, 20_000]
    assert [each["t2"] for each in switched(", max age 5s", *samples)] == [3000]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (", max age 5s, max age 6s", "one such option"),
        (", first values since ever, first values since ever", "one such option"),
        (", first values of lit since ever, first values since ever", "one such option"),
        (", first values of lid since ever", "l.chr has no attribute of lid"),
        (", max age 0s", "lasts no time"),
        (", any change", "chronicles know max delay, max age and first values since ever"),
    ],
)
def test_options_of_chronicles_that_cannot_be_are_told_with_their_place(options, said):
    with pytest.raises(TextErrors) as refused:
        switched(options)
    (wrong,) = refused.value.errors
    assert (wrong.line, said in wrong.message) == (3, True)


PARTIAL = STREAMS + "stream may_turn = partial[enters]\n"


def lists(run):
    """The lists of partial instances that came: when, and of each its variables, instants and end."""
    return [
        (sample.available_us // MS, [(dict(bound), dict(at), dies) for bound, at, _, dies in sample.value])
        for name, sample in run.told
        if name == "may_turn"
    ]


def test_what_may_become_an_instance_is_a_stream_that_changes_when_it_grows_and_when_it_is_given_up():
    run = Run(PARTIAL)
    run.feed("cars", 0, ("a",))
    drive(run)
    run.at(4500)
    left = ({"?car": "a", "?from": "l1"}, {"t1": 2000}, 12001)
    crossed = ({"?car": "a", "?from": "l1", "?x": "x2"}, {"t1": 2000, "t2": 3000}, 12001)
    found = lists(run)
    assert found[0] == (0, [])
    assert (2100, [left]) in found, "100 ms after it was valid, as what is recognised"
    assert all(left in each for at_ms, each in found if 2100 <= at_ms < 4100)
    assert any(crossed in each for at_ms, each in found if at_ms >= 3100)
    missing = {one for name, sample in run.told if name == "may_turn" for _, _, each, _ in sample.value for one in each}
    assert missing >= {"event(in_crossing[?car, ?x], t2)", "event(link[?car]:(no_link, ?to), t3)"}
    run.at(20_000)
    at_ms, last = lists(run)[-1]
    assert last == [], "nothing is expected when the ten seconds are over"
    assert at_ms > 12_000


def test_partial_instances_are_looked_for_while_they_are_wanted_and_end_with_their_file():
    run = Run(PARTIAL)
    (watch,) = (each.watch for each in run.instance.chronicles.values())
    assert len(watch.listeners) == 1
    run.change(STREAMS)
    assert not watch.listeners
    run.change(PARTIAL)
    run.chronicles = TURNS.replace("10s", "5s")
    run.change(PARTIAL)
    (watch,) = (each.watch for each in run.instance.chronicles.values())
    assert len(watch.listeners) == 1
    run.feed("cars", 100, ("a",))
    run.feed("links", 1000, "l1")
    run.feed("links", 2000, "no_link")
    run.at(2300)
    assert [dies for _, _, dies in lists(run)[-1][1]] == [7001]
    with pytest.raises(TextErrors, match="nothing makes"):
        run.change(STREAMS + "stream s = partial[other]\n")


def test_samples_that_are_too_late_are_counted_reported_and_in_the_graph():
    run = Run()
    run.feed("cars", 0, ("a",))
    for n in range(30):
        run.feed("links", 1000 * n, f"l{n}", 1000 * n + 500)
        run.feed("others", 1000 * n + 500, 0.5)
    (watch,) = (each.watch for each in run.instance.chronicles.values())
    assert watch.ignored["late"] == 30
    assert watch.ignored["no symbol"] >= 29
    told = [each for each in run.faults if "ignored until now" in each]
    assert len(told) == 2, "the first, and ten times as many"
    node = next(each for each in graph_of(run.instance).nodes if each.kind == "chronicles")
    assert node.counted == watch.ignored
    assert "ignored no symbol: 29, late: 30" in as_text(graph_of(run.instance))
