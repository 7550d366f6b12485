"""A running specification is changed while samples flow: nothing is lost, nothing leaks, and what is refused is as it was."""

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow import NO_VALUE, Label, Sample, UnitPrototype, of_values
from dyknow.kpl import parse_specification, print_specification
from dyknow.model.errors import PrototypeExists, Refused, SortError, TextErrors, UnknownPrototype
from tests.kpl.instances import Running, label, source

BASE = """\
source number raw
strmgen a = raw
strmgen b = Double(a)
strmgen c = Add(a, b with max delay 1000)
stream out = c
"""
IDS = """\
source object ids
source number raw
strmgen car_ids = ids
"""


def told(running, text):
    with pytest.raises(TextErrors) as found:
        running.add(text)
    return "\n".join(error.drawn() for error in found.value.errors)


# Added, removed, replaced, restored


def test_samples_flow_through_what_is_declared() -> None:
    running = Running(BASE)
    running.push("raw", 1)
    running.push("raw", 2)
    assert running.values("out") == [3, 4, 6] or running.values("out") == [3, 6, 4, 6] or running.values("out")[-1] == 6
    assert running.instance.sources() == ("raw",)
    assert print_specification(running.instance.specification) == BASE.replace("max delay 1000", "max delay 1000")


def test_the_order_of_declarations_does_not_matter() -> None:
    lines = BASE.splitlines(keepends=True)
    running = Running("".join(reversed(lines)))
    running.push("raw", 1)
    assert running.values("out")[-1] == 3


def test_what_is_added_and_removed_leaves_the_rest_as_it_was() -> None:
    running = Running(BASE)
    running.push("raw", 1)
    before = running.state()
    running.add("strmgen d = Sum(b)\nstream more = d\nstream again = b with sample every 20")
    running.push("raw", 2)
    running.remove("stream more = d\nstrmgen d = Sum(b)\nstream again = b with sample every 20")
    after = running.state()
    assert after["sizes"].keys() == before["sizes"].keys()
    del before["sizes"], after["sizes"]
    assert after == before
    assert [name for name, _ in running.outputs if name != "out"] == ["more", "again"]


def test_a_generator_that_is_made_otherwise_goes_on_under_its_clients() -> None:
    running = Running("source number raw\nstrmgen a = raw\nstrmgen b = Double(a)\nstream out = b\n")
    running.push("raw", 1)
    stream = running.instance.streams["out"]
    running.change("source number raw\nstrmgen a = raw\nstrmgen b = Triple(a)\nstream out = b\n")
    running.push("raw", 1)
    assert running.values("out") == [2, 3]
    assert running.instance.streams["out"] is stream
    assert running.links == [("out", True)]
    running.change("source object raw\nstrmgen a = raw\nstrmgen b = Copy(a)\nstream out = b\n")
    running.push("raw", "x")
    assert running.values("out") == [2, 3, "x"]
    assert running.links == [("out", True), ("out", False), ("out", True)], "of another sort it is another stream"


def test_any_configuration_that_was_can_be_restored() -> None:
    running = Running(BASE)
    running.add("stream more = b")
    running.change("source number raw\nstrmgen a = raw\nstream out = a")
    running.push("raw", 5)
    running.instance.restore(1, running.now_us)
    running.push("raw", 7)
    assert running.values("more") == [14]
    assert running.values("out")[0] == 5
    assert print_specification(running.instance.specification) == BASE + "stream more = b\n"
    with pytest.raises(IndexError):
        running.instance.restore(99, running.now_us)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("stream out = a", "out is a stream already, in the running instance"),
        ("strmgen a = raw", "a is a generator already, in the running instance"),
        ("source number raw", "raw is a source or a unit already, in the running instance"),
        ("stream x = a\nstream x = b", "x is a stream already, in line 1"),
        ("monitor m = a > 3\nmonitor m = a > 4", "m is a monitor already"),
        ("stream x = nothing", "nothing makes nothing"),
        ("strmgen d = Double(e)\nstrmgen e = Double(d)", "a cycle: d <- e <- d"),
        ("strmgen d = Double(a, b)", "Double takes 1 stream"),
        ("strmgen d = Copy(a)", "Copy takes object here; a is number"),
        ("stream x = a\nstrmgen z = Double(a with sample every 1us)", "a sample every 1us cannot be served"),
        ("stream x = a with sample every 1us", "a sample every 1us cannot be served"),
        ("for i in a with sample every 1us strmgen z[i] = Double(a)", "a sample every 1us cannot be served"),
        ("strmgen s = state(a, b) with sample every 100", "needs `max delay`"),
        ("monitor m = always a > 3 with sample every 1us", "a sample every 1us cannot be served"),
    ],
)
def test_what_is_refused_leaves_the_instance_exactly_as_it_was(text, said) -> None:
    running = Running(BASE)
    running.push("raw", 1)
    before = running.state()
    assert said in told(running, text)
    assert running.state() == before
    running.push("raw", 2)
    assert running.values("out")[-1] == 6


def test_what_the_rest_needs_is_not_taken_away_and_the_error_shows_who_needs_it() -> None:
    running = Running(BASE)
    running.push("raw", 1)
    before = running.state()
    with pytest.raises(TextErrors) as found:
        running.remove("strmgen b = Double(a)")
    assert "nothing makes b, which the running instance needs" in str(found.value)
    assert "strmgen c = Add(a, b with max delay 1000)" in str(found.value)
    assert running.state() == before
    with pytest.raises(TextErrors, match="raw is no source that is declared"):
        running.remove("source number raw")
    assert running.state() == before


def test_the_same_declarations_twice_are_refused() -> None:
    running = Running(BASE)
    before = running.state()
    for again in (running.instance.specification, parse_specification(BASE)):
        with pytest.raises(TextErrors, match="already"):
            running.instance.add(again, 0)
        assert running.state() == before
    twice = parse_specification("monitor m = a > 3")
    with pytest.raises(TextErrors, match="m is a monitor already"):
        running.instance.add((*twice, *twice), 0)
    assert running.state() == before


# Streams that begin in the past


def test_a_declared_stream_that_begins_in_the_past_brings_what_came_since() -> None:
    running = Running(BASE)
    for value in range(1, 6):
        running.push("raw", value)
    running.add("stream past = b with from 30 to oo")
    assert running.values("past") == [6, 8, 10]
    running.push("raw", 6)
    assert running.values("past") == [6, 8, 10, 12]


def test_a_past_that_cannot_be_served_is_refused_with_its_place_and_all_else_goes_on_untouched() -> None:
    running = Running(BASE + "monitor m = always a < 3 with sample every 10, max delay 10\n", history=4)
    for value in range(1, 300):
        running.push("raw", value)
    assert running.alarms
    before, outputs = running.state(), list(running.outputs)
    lines = ["stream ok = b with from 2980 to oo", "stream past = b with from 30 to oo", "strmgen z = Double(a)"]
    said = told(running, "\n".join(lines))
    assert "a.kpl:2:" in said
    assert "earliest possible time" in said
    assert lines[1] in said
    assert running.state() == before
    assert running.outputs == outputs, "not even what could have begun has told anything"
    with pytest.raises(TextErrors, match="earliest possible time"):
        running.change(BASE.replace("stream out = c", "stream out = b") + lines[1])
    assert running.state() == before
    assert "cannot begin 3.0 s ago" in said
    earliest = re.search(r"write: (from \d+)$", said)[1]  # type: ignore[index]
    running.add(f"stream past = b with {earliest} to oo")
    assert running.values("past")


# Members


def test_a_family_makes_one_process_per_member_and_removes_it_with_it() -> None:
    running = Running(IDS + "for c in car_ids strmgen x[c] = raw\nfor c in car_ids strmgen y[c] = Double(x[c])")
    base = running.state()
    running.push("ids", ("a", "b"))
    running.add("stream ya = y[a]")
    running.push("raw", 4)
    assert running.values("ya") == [8]
    running.push("ids", ("b",))
    running.push("raw", 5)
    assert running.values("ya") == [8]
    running.push("ids", ("a", "b"))
    running.push("raw", 6)
    assert running.values("ya") == [8, 12]
    assert running.links == [("ya", True), ("ya", False), ("ya", True)]
    running.remove("stream ya = y[a]")
    running.push("ids", ())
    after = running.state()
    del base["processes at work"], after["processes at work"]
    assert after == base


def test_a_member_may_have_a_declaration_of_its_own_with_another_policy() -> None:
    running = Running(IDS + "strmgen raw1 = raw\nfor c in car_ids strmgen x[c] = Double(raw1)")
    running.push("ids", ("a", "b"))
    running.add("stream xa = x[a]\nstream xb = x[b]")
    own = "strmgen x[a] = Double(raw1 with sample every 20)"
    running.add(own)
    for value in range(1, 5):
        running.push("raw", value)
    assert running.values("xa") == [2, 6]
    assert running.values("xb") == [2, 4, 6, 8]
    running.push("ids", ("b",))
    running.push("raw", 5)
    assert running.values("xa") == [2, 6], "its own declaration is on the grid"
    running.push("ids", ("a", "b"))
    running.remove(own)
    running.push("raw", 6)
    assert running.values("xa")[-1] == 12, "without its own declaration a member is one of the family again"


def test_two_families_over_different_sets_may_share_a_member() -> None:
    running = Running(
        "source object one\nsource object other\nstrmgen ones = one\nstrmgen others = other\n"
        "source number raw\nstrmgen r = raw\n"
        "for i in ones strmgen x[i] = Double(r)\nfor j in others strmgen x[j] = Double(r)"
    )
    running.push("one", ("a",))
    running.push("other", ("a",))
    running.add("stream xa = x[a]")
    running.push("other", ())
    running.push("raw", 1)
    running.push("other", ("a",))
    running.push("one", ())
    running.push("raw", 2)
    assert running.values("xa") == [2, 4]
    running.push("other", ())
    running.push("raw", 3)
    assert running.values("xa") == [2, 4]
    assert running.instance.parts.of_families == {}


def test_select_and_merge_run_from_text() -> None:
    running = Running(
        IDS + "strmgen x[a] = raw\nsource number other\nstrmgen x[b] = other\n"
        "strmgen one = select x[c] for c in car_ids\nstrmgen all = merge x[c] for c in car_ids\n"
        "stream o = one\nstream m = all"
    )
    running.push("ids", "a")
    running.push("raw", 1)
    running.push("other", 2)
    running.push("ids", ("a", "b"))
    running.push("raw", 3)
    running.push("other", 4)
    assert running.values("o") == [1]
    assert running.values("m") == [1, 3, 4]


def test_members_come_from_a_process_too_and_in_any_order_of_the_text() -> None:
    text = "stream m = all\nstrmgen all = merge x[c] for c in made\nfor c in made strmgen x[c] = Double(r)\n"
    running = Running(text + "strmgen made = Ids(r)\nstrmgen r = raw\nsource number raw")
    running.push("raw", 1)
    running.push("raw", 2)
    assert set(running.instance.families.members[label("x[c]")].members) == {("c0",), ("c1",)}
    running.push("raw", 0)
    assert not [name for name in running.network.labels() if name.feature == "x"]


def test_self_is_the_unit() -> None:
    running = Running("source number raw\nstrmgen pos[self] = raw\nstream p = pos[7]\nstream q = pos[self]")
    running.push("raw", 1)
    assert running.values("p") == running.values("q") == [1]
    assert running.network.has(label("pos[7]"))


def test_attributes_of_records_can_be_asked_for_and_go_with_who_asked() -> None:
    running = Running("source pos gps\nstrmgen pos[u] = gps")
    before = running.state()
    running.add("stream alt = pos.altitude_m[u]\nstrmgen d = Double(pos.altitude_m[u])\nstream twice = d")
    running.push("gps", (1.0, 20.0))
    assert running.values("alt") == [20.0]
    assert running.values("twice") == [40.0]
    with pytest.raises(TextErrors, match=r"nothing makes pos.altitude_m\[u\]"):
        running.remove("strmgen pos[u] = gps")
    running.remove("stream alt = pos.altitude_m[u]\nstrmgen d = Double(pos.altitude_m[u])\nstream twice = d")
    assert running.state() == before


def test_a_sample_of_the_wrong_sort_is_told_and_goes_nowhere() -> None:
    running = Running("source pos gps\nstrmgen pos[u] = gps\nstream p = pos[u]")
    for value in ((1.0, 2.0), 3.0, (1.0,), (1.0, float("nan")), "x", NO_VALUE, (3.0, 4.0)):
        running.push("gps", value)
    assert running.values("p") == [(1.0, 2.0), NO_VALUE, (3.0, 4.0)]
    assert [name for name, _ in running.faults] == ["pos[u]"] * 4


# Prototypes that come and go


def test_what_members_are_to_have_and_no_module_offers_is_known_before_there_are_members() -> None:
    running = Running(
        "source number raw\nstrmgen a = raw\ncompunit object Ids(number)\nstrmgen ids = Ids(a)\n"
        "compunit number Late(number)\nfor i in ids strmgen x[i] = Late(a)\n"
    )
    family = Label("x", ("i",))
    assert running.instance.lacking == {"Late": (family,)}
    running.push("raw", 2)
    assert running.instance.lacking == {"Late": (family,)}
    running.instance.offer([UnitPrototype("Late", "number", ("number",), lambda: of_values(lambda v: v))], 0)
    assert not running.instance.lacking


def test_what_nobody_can_make_yet_waits_and_begins_when_it_is_offered() -> None:
    running = Running(
        BASE.replace("strmgen b", "compunit number Late(number)\nstrmgen b").replace("Double(a)", "Late(a)")
    )
    assert running.instance.lacking == {"Late": (label("b"),)}
    running.push("raw", 1)
    late = UnitPrototype("Late", "number", ("number",), lambda: of_values(lambda v: v * 10))
    running.instance.offer([late], running.now_us)
    assert not running.instance.lacking
    running.push("raw", 2)
    assert running.values("out")[-1] == 22
    running.instance.withdraw(["Late"], running.now_us)
    assert running.instance.lacking == {"Late": (label("b"),)}
    outputs = len(running.outputs)
    running.push("raw", 3)
    running.instance.offer([late], running.now_us)
    running.push("raw", 4)
    assert running.values("out")[-1] == 44
    assert outputs <= len(running.outputs)
    with pytest.raises(PrototypeExists):
        running.instance.offer([late], running.now_us)
    with pytest.raises(UnknownPrototype):
        running.instance.withdraw(["Later"], running.now_us)


def test_what_is_offered_with_other_sorts_than_declared_is_refused() -> None:
    running = Running(
        "source number raw\nstrmgen a = raw\ncompunit number Late(number)\nstrmgen b = Late(a)\nstream o = b"
    )
    for sort, inputs in (("object", ("number",)), ("number", ("number", "number")), ("number", ("object",))):
        with pytest.raises(SortError, match="Late is declared"):
            running.instance.offer([UnitPrototype("Late", sort, inputs, lambda: of_values(abs))], 0)
    with pytest.raises(SortError):
        running.instance.offer([source("Late")], 0)
    assert running.instance.lacking


# Definitions and monitors


def test_a_monitor_over_local_streams_opens_and_closes_an_alarm() -> None:
    running = Running(
        "source number raw\nstrmgen speed[u] = raw\ndefine LIMIT = 5\ndefine fast[x] = speed[x] > LIMIT\n"
        "monitor calm = always not fast[u] with sample every 100, max delay 100, close after 1"
    )
    for at, value in enumerate([1, 9, 1, 1], 1):
        running.push("raw", value, at * 100_000)
    running.wait(1_000_000)
    assert [event.event for event in running.alarms] == ["opened", "closed"]
    assert running.alarms[0].valid_us == 200_000
    running.remove("monitor calm = always not fast[u] with sample every 100, max delay 100, close after 1")
    assert not running.network._timed
    assert running.network.generator(label("speed[u]")).subscriptions == ()


DEFINED = (
    "source number raw\nstrmgen speed[u] = raw\nstrmgen speed[v] = raw\n{}\n"
    "monitor calm = {} with sample every 100, max delay 100\nmonitor other = always speed[u] < 100 with sample every 100"
)


@pytest.mark.parametrize(
    ("formula", "before", "after"),
    [
        ("always speed[u] < LIMIT", "define LIMIT = 100", "define LIMIT = 5"),
        (
            "always not fast[u]",
            "define LIMIT = 100\ndefine above[x] = speed[x] > LIMIT\ndefine fast[y] = above[y]",
            "define LIMIT = 5\ndefine above[x] = speed[x] > LIMIT\ndefine fast[y] = above[y]",
        ),
        (
            "always not fast[u]",
            "define fast[x] = speed[x] > 100",
            "define LIMIT = 5\ndefine fast[x] = speed[x] > LIMIT",
        ),
        ("always speed[u] < 10 - LESS[u]", "define LESS[x] = 0 - 90", "define LESS[x] = speed[x]"),
        ("always eventually[0, HOLD] speed[u] < 5", "define HOLD = 60s", "define HOLD = 300ms"),
        ("always speed[u] < speed[OTHER] + 1", 'define OTHER = "u"', 'define OTHER = "v"\nstrmgen base = raw'),
    ],
)
def test_a_changed_definition_reaches_the_monitors_that_use_it_and_no_others(formula, before, after) -> None:
    running = Running(DEFINED.format(before, formula))
    calm, other = running.instance.monitors["calm"], running.instance.monitors["other"]
    running.push("raw", 9, 100_000)
    running.change(DEFINED.format(after, formula))
    assert running.instance.monitors["calm"] is not calm
    assert running.instance.monitors["calm"].monitor.formula != calm.monitor.formula
    assert running.instance.monitors["other"] is other
    again = running.instance.monitors["calm"]
    running.change(DEFINED.format(f"# as it was\n{after}\ndefine unused = 3", formula))
    assert running.instance.monitors["calm"] is again


def test_a_changed_constant_is_what_a_running_monitor_compares_with() -> None:
    text = DEFINED.format("define LIMIT = 100", "always speed[u] < LIMIT")
    running = Running(text)
    for at in range(1, 6):
        running.push("raw", 9, at * 100_000)
    assert not running.alarms
    running.change(text.replace("= 100\n", "= 5\n"))
    for at in range(6, 11):
        running.push("raw", 9, at * 100_000)
    running.wait(2_000_000)
    assert [event.monitor for event in running.alarms] == ["calm"]


def test_a_definition_that_cannot_be_taken_in_leaves_its_monitors_as_they_were() -> None:
    class Refusing:
        def monitor(self, declaration, formula):
            if declaration.name == "late":
                raise Refused("enough", "too-many")
            return lambda: None, True

    text = DEFINED.format("define LIMIT = 100", "always speed[u] < LIMIT")
    running = Running(text, federation=Refusing())
    before = running.state()
    with pytest.raises(TextErrors):
        running.change(text.replace("define LIMIT = 100\n", ""))
    with pytest.raises(TextErrors):
        running.change(text.replace("= 100\n", "= true\n"))
    assert running.state() == before
    with pytest.raises(TextErrors, match="enough"):  # when it is made, after the others have been
        running.change(f"{text.replace('= 100', '= 5', 1)}\nmonitor late = always speed[v] < LIMIT")
    for at in range(1, 6):
        running.push("raw", 9, at * 100_000)
    running.wait(2_000_000)
    assert not running.alarms


@pytest.mark.parametrize(
    ("options", "shows"),
    [
        ("sample every 100, max delay 200", "unknown"),
        ("from 0, sample every 100, max delay 200, use most recent", "ok"),
    ],
)
def test_what_has_fallen_silent_is_not_known_to_hold_unless_values_stay_until_another_comes(options, shows) -> None:
    running = Running(f"source number raw\nstrmgen a = raw\nmonitor calm = always a < 5 with {options}")
    for at in range(1, 11):
        running.push("raw", 1, at * 100_000)
    watched = running.instance.monitors["calm"].monitor
    running.wait(1_200_000)
    assert watched.shows == "ok"
    running.wait(3_000_000)
    assert watched.shows == shows


def test_a_monitor_over_members_follows_them() -> None:
    running = Running(
        IDS + "source number one\nstrmgen v[a] = raw\nstrmgen v[b] = one\n"
        "monitor calm = always forall car in car_ids growing: v[car] < 5 with sample every 100, max delay 50, close after 1"
    )
    running.push("ids", ("a",), 10_000)
    for at in range(1, 4):
        running.push("raw", 1, at * 100_000)
        running.push("one", 9, at * 100_000 + 1)
    assert not running.alarms, "b is no member"
    running.push("ids", ("a", "b"), 310_000)
    for at in range(4, 8):
        running.push("raw", 1, at * 100_000)
        running.push("one", 9, at * 100_000 + 1)
    running.wait(900_000)
    assert [event.event for event in running.alarms][:1] == ["opened"]


def test_a_member_that_leaves_after_a_violation_does_not_hide_it() -> None:
    """The state of 100 is made when what c1 brings late is there, and c1 is named no more by then."""
    running = Running(
        "source object ids\nstrmgen car_ids = ids\nsource number raw\nsource number late\n"
        "strmgen v[c0] = raw\nstrmgen v[c1] = late\n"
        "monitor calm = always forall car in car_ids growing: v[car] < 5 with sample every 100, max delay 90, close after 1"
    )
    running.push("ids", ("c0", "c1"), 0)
    for at_ms in (1, 100):
        running.push("raw", 1, 1000 * at_ms)
    running.push("late", 1, 1_000)
    running.push("ids", ("c0",), 150_000)
    running.instance.push("late", Sample(160_000, 100_000, 9))
    for at_ms in range(200, 1000, 100):
        running.push("raw", 1, 1000 * at_ms)
    assert [(each.event, each.valid_us) for each in running.alarms] == [("opened", 100_000), ("closed", 200_000)]


def test_members_are_those_of_the_time_of_the_state_however_often_they_change() -> None:
    """A value above the limit alarms if and only if its car is named at its time."""
    running = Running(
        "source object ids\nstrmgen car_ids = ids\nsource number fast\nsource number slow\n"
        "strmgen v[c0] = slow\nstrmgen v[c1] = fast\n"
        "monitor calm = always forall car in car_ids growing: v[car] < 5 with sample every 100, max delay 250, close after 1"
    )
    named = [n % 3 != 1 for n in range(30)]
    for n, is_named in enumerate(named):
        running.push("ids", ("c0", "c1") if is_named else ("c0",), 100_000 * n)
        running.push("slow", 1, 100_000 * n)
        running.push("fast", 9, 100_000 * n)
    running.wait(5_000_000)
    changes = [n for n in range(1, 30) if named[n] != named[n - 1]]
    found = [(each.event, each.valid_us // 100_000) for each in running.alarms if each.valid_us <= 2_900_000]
    assert found == [("opened", 0), *(("opened" if named[n] else "closed", n) for n in changes)]


@pytest.mark.parametrize(
    "members", [("a", "with"), "x" * 60_000, ("true",), -1, 10**5000, 2.5, ("a", None)], ids=range(7)
)
def test_members_that_cannot_be_leave_the_instance_running(members) -> None:
    running = Running(
        IDS + "for c in car_ids strmgen x[c] = raw\nstrmgen all = merge x[c] for c in car_ids\nstream m = all\n"
        "monitor calm = always forall car in car_ids growing: x[car] < 5"
    )
    running.push("ids", ("a",))
    running.push("ids", members)
    running.push("raw", 3)
    running.push("ids", ("b",))
    running.push("raw", 4)
    assert running.values("m") == [3, 4]
    assert running.faults


# Bar 3: nothing leaks

POOL = [
    "strmgen b{i} = Double(a)", "strmgen c{i} = Add(a, b{j} with max delay 50)", "stream s{i} = b{j} with sample every 20",
    "stream t{i} = c{j} with from 0 to oo, sample every 10, max delay 30, use most recent", "strmgen st{i} = state(a with sample every 20, b{j} with sample every 20) with max delay 40",
    "stream u{i} = st{j}", "monitor m{i} = always b{j} < 5", "define d{i}[x] = b{j} > 3", "source number extra{i}", "strmgen e{i} = extra{j}",
    "compunit number Lacking{i}(number)", "strmgen f{i} = Lacking{j}(a)", "for k in ids strmgen g{i}[k] = Double(b{j})",
    "strmgen h{i} = merge g{j}[k] for k in ids", "stream v{i} = h{j}", "stream w{i} = g{j}[c1]", "strmgen i{i} = select g{j}[k] for k in ids",
    "stream y{i} = pos.altitude_m[u]", "strmgen z{i} = Double(pos.altitude_m[u] with any change)", "stream x{i} = z{j}", "export label{i} = b{j}",
]  # fmt: skip
LASTING = "source number raw\nsource pos gps\nstrmgen a = raw\nstrmgen ids = Ids(a)\nstrmgen pos[u] = gps\nstream ids = ids\nstream a = a\n"


def churn(running, steps, seed):
    """Random declarations come and go while samples flow; many changes are refused, since what they need is not there."""
    import random

    rng = random.Random(seed)
    there = {}
    changed = 0
    for _ in range(steps):
        text = rng.choice(POOL).format(i=rng.randrange(3), j=rng.randrange(3))
        try:
            if there and rng.random() < 0.45:
                text = rng.choice(list(there))
                running.instance.remove([there[text]], running.now_us)
                del there[text]
            elif text not in there:
                (there[text],) = parsed = parse_specification(text)
                running.instance.add(parsed, running.now_us)
            changed += 1
        except TextErrors:
            if running.instance.symbols.find(there[text]) is None:
                del there[text]
        if rng.random() < 0.2:
            running.push("raw", rng.randrange(4))
            running.push("gps", (1.0, float(rng.randrange(4))))
    while there:
        for text in list(there):
            try:
                running.instance.remove([there[text]], running.now_us)
                del there[text]
            except TextErrors:
                continue
    return changed


@given(st.integers(0, 2**32))
@settings(max_examples=20)
def test_removing_what_was_added_restores_the_instance_exactly(seed) -> None:
    running = Running(LASTING)
    running.push("raw", 2)
    running.push("gps", (0.0, 0.0))
    before = running.state()
    assert churn(running, 60, seed)
    after = running.state()
    del before["sizes"], after["sizes"]
    assert after == before


@pytest.mark.parametrize("steps", [1_000, pytest.param(10_000, marks=pytest.mark.full)])
def test_over_many_steps_nothing_leaks(steps) -> None:
    import gc

    import psutil

    running = Running(LASTING, history=64)
    process = psutil.Process()
    churn(running, steps // 10, 1)
    running.outputs.clear()
    before = running.state()
    gc.collect()
    early = process.memory_info().rss
    for part in range(9):
        churn(running, steps // 10, part + 2)
        running.outputs.clear()
        running.links.clear()
        running.alarms.clear()
    gc.collect()
    after = running.state()
    assert len(gc.garbage) == 0
    del before["sizes"], after["sizes"]
    assert after == before
    assert process.memory_info().rss - early < 8_000_000
