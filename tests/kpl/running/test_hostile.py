"""Specifications that ask for too much meet limits and clear errors, and the instance keeps running."""

from dataclasses import replace

import pytest

from dyknow import Label, Policy, UnitPrototype, of_values
from dyknow.kpl import parse_specification
from dyknow.kpl.checking.specifications import LONGEST_CHAIN
from dyknow.kpl.running.parts import MAX_OF_FAMILIES
from dyknow.kpl.syntax.specification import GeneratorDeclaration, StateStream, StreamTerm
from dyknow.model.errors import TextError, TextErrors
from tests.kpl.instances import Running

BASE = "source number raw\nstrmgen a = raw\nstream out = a\n"
MEMBERS = "source object ids\nstrmgen car_ids = ids\n"


def works(running):
    """Samples still flow."""
    before = len(running.values("out"))
    running.push("raw", 1)
    assert len(running.values("out")) == before + 1


@pytest.fixture
def running():
    return Running(BASE)


def refused(running, declarations, said):
    before = running.state()
    with pytest.raises(TextError) as told:
        if isinstance(declarations, str):
            running.add(declarations)
        else:
            running.instance.add(declarations, 0)
    assert said in str(told.value)
    assert all(len(line) < 400 for line in str(told.value).splitlines())
    assert running.state() == before
    works(running)


@pytest.mark.parametrize(
    "count", [pytest.param(10_000, id="tenth"), pytest.param(100_000, id="bar", marks=pytest.mark.full)]
)
def test_a_hundred_thousand_declarations(running, count) -> None:
    (one,) = parse_specification("stream x = a")
    refused(running, [replace(one, name=f"x{i}") for i in range(count + 1)], "an instance holds at most 10000")
    refused(running, "stream x = a\n" * count, "65536 are allowed")
    running.instance.add([replace(one, name=f"x{i}") for i in range(count // 20)], 0)
    works(running)
    running.instance.remove([replace(one, name=f"x{i}") for i in range(count // 20)], 0)
    assert len(running.network.generator(Label("a")).subscriptions) == 1


def test_a_hundred_thousand_errors_are_not_all_told(running) -> None:
    text = "".join(f"stream x{i} = nobody{i}\n" for i in range(2_000))
    before = running.state()
    with pytest.raises(TextErrors) as told:
        running.add(text)
    assert len(str(told.value)) < 1_000_000
    assert running.state() == before


@pytest.mark.parametrize("name", ["x" * 60_000, "x-" * 20_000 + "x", "x" * 513])
def test_names_of_sixty_kilobytes(running, name) -> None:
    for text in (f"source number {name}", f"stream {name} = a", f"monitor {name} = a > 3", f"define {name} = 3"):
        try:
            running.add(text)
        except TextError as told:
            assert len(str(told)) < 2_000
        works(running)
    refused(running, f"stream x = {name}", "nothing makes")
    refused(running, f"strmgen x = {name}(a)", "xxx" if "xxx" in name else "x-x")
    refused(running, f"stream x = a[{name}]", "nothing makes")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("monitor m = " + "(" * 500 + "a" + ")" * 500, "nested more than 200 deep"),
        ("define d = " + "not " * 500 + "a > 3", "nested more than 200 deep"),
        ("monitor m = " + "always " * 30_000, "65536 are allowed"),
        ("monitor m = " + "always " * 9_000 + "a > 3", "nested more than 200 deep"),
        ("strmgen x = Double(" * 100, "`strmgen` is a reserved word"),
        ("stream x = a with " + "any order, " * 5_000 + "any order", "a policy has at most 1024 characters"),
        ("stream x = a with sample every 1us", "cannot be served"),
        ("stream x = a with sample every 0", "must be > 0"),
        ("strmgen x = state(a) with sample every 1us, max delay 1", "cannot be served"),
        ("strmgen x = Double(a with sample every 1us)", "cannot be served"),
        ("monitor m = a > 3 with sample every 1us", "cannot be served"),
        ("stream x = a with max delay 99999999999999999999999999", "is not a duration"),
        ("stream x = a with sample every 1e300", "is not a duration"),
        ("monitor m = a > 3 with close after 1000000000", "a number of states"),
    ],
)
def test_depth_periods_and_times(running, text, said) -> None:
    refused(running, text, said)


def test_chains_have_a_limit_also_through_families_and_within_it_they_run() -> None:
    for length in (LONGEST_CHAIN - 1, LONGEST_CHAIN, 300):
        text = BASE + "strmgen c0 = raw\n" + "".join(f"strmgen c{i + 1} = Double(c{i})\n" for i in range(length))
        families = MEMBERS + "for c in car_ids strmgen f0[c] = raw\n"
        families += "".join(f"for c in car_ids strmgen f{i + 1}[c] = Double(f{i}[c])\n" for i in range(length - 1))
        families += f"strmgen all = merge f{length - 2}[c] for c in car_ids\nstream f = all\n"
        running = Running(BASE)
        both = text.removeprefix(BASE) + f"stream c = c{length}\n" + families
        if length >= LONGEST_CHAIN:
            refused(running, both, f"a chain of more than {LONGEST_CHAIN} processes")
        else:
            running.add(both)
            running.push("ids", ("x",))
            running.push("raw", 1)
            assert running.values("c") == [2**length]
            assert running.values("f") == [2 ** (length - 2)]
            running.push("raw", 1)
            running.add(f"stream past = c{length} with from 0 to oo")


def test_a_chain_of_ten_thousand_processes(running) -> None:
    declarations = []
    for start in range(0, 9_900, 1_100):
        lines = (f"strmgen c{i + 1} = Double({f'c{i}' if i else 'a'})" for i in range(start, start + 1_100))
        declarations += parse_specification("\n".join(lines))
    refused(running, declarations, f"a chain of more than {LONGEST_CHAIN} processes")


def test_a_chain_made_longer_from_its_beginning_is_seen_too(running) -> None:
    running.add(
        "source number other\nstrmgen b0 = other\n" + "".join(f"strmgen b{i + 1} = Double(b{i})\n" for i in range(40))
    )
    running.add("".join(f"strmgen c{i + 1} = Double({f'c{i}' if i else 'a'})\n" for i in range(40)) + "stream c = c40")
    whole = running.instance.specification
    longer = [one for one in whole if one != parse_specification("strmgen c1 = Double(a)")[0]]
    longer += parse_specification("strmgen c1 = Double(b40)")
    before = running.state()
    with pytest.raises(TextErrors, match="a chain of more than"):
        running.instance.change(longer, 0)
    assert running.state() == before


def test_definitions_that_double_what_they_define(running) -> None:
    lines = [f"define d{i + 1} = d{i} and d{i}" for i in range(60)]
    text = "define d0 = a > 3\n" + "\n".join(lines) + "\nmonitor m = d60\n"
    refused(running, text, "with its definitions put in")
    refused(running, text + "".join(f"monitor m{i} = d50\n" for i in range(1_000)), "with its definitions put in")
    refused(running, "define x = y > 3\ndefine y = x > 3\nmonitor m = x > 3", "defined by itself")


@pytest.mark.parametrize(
    "text",
    [
        "for c in car_ids strmgen x[c] = Double(y[c])\nfor d in car_ids strmgen y[d] = Double(x[d])",
        "for c in car_ids strmgen x[c] = Double(x[c])",
        "for c in made strmgen x[c] = Double(a)\nstrmgen all = merge x[c] for c in made\nstrmgen made = Ids(all)",
        "strmgen all = merge x[c] for c in car_ids\nstrmgen x[b] = Double(all)",
        "strmgen one = select x[c] for c in car_ids\nfor c in car_ids strmgen x[c] = Add(a, one)",
    ],
)
def test_cycles_through_families_and_members(running, text) -> None:
    refused(running, MEMBERS + text, "a cycle")


def test_what_only_looks_like_a_cycle_runs(running) -> None:
    running.add(MEMBERS + "for c in car_ids strmgen x[c, b] = Double(x[c])\nstrmgen x[c1] = raw\nstream o = x[c1, b]")
    running.push("ids", ("c1",))
    running.push("raw", 2)
    assert running.values("o") == [4]


def test_a_merge_over_a_hundred_thousand_members_is_told_and_those_before_stay(running) -> None:
    running.add(
        MEMBERS + "for c in car_ids strmgen x[c] = raw\nstrmgen all = merge x[c] for c in car_ids\nstream m = all"
    )
    running.push("ids", ("c1",))
    running.push("ids", tuple(range(100_000)))
    running.push("raw", 1)
    assert running.values("m") == [1]
    assert all("at most 4096 can be members" in said for _, said in running.faults)
    running.push("ids", tuple(range(1_000)))
    running.push("raw", 1)
    assert len(running.values("m")) == 1_001
    running.push("ids", ())
    works(running)
    assert len(running.network.labels()) < 10


def test_families_of_more_members_than_fit_together_are_told_and_those_before_stay(running) -> None:
    families = "".join(f"for c in car_ids strmgen y{i}[c] = Double(a)\n" for i in range(40))
    running.add(MEMBERS + families + "strmgen all = merge y39[c] for c in car_ids\nstream m = all")
    running.push("ids", ("c1",))
    running.push("ids", tuple(range(4_000)))
    assert len(running.network.labels()) < MAX_OF_FAMILIES + 50
    assert any(f"at most {MAX_OF_FAMILIES}" in said for _, said in running.faults)
    works(running)
    running.push("ids", ("c1", "c2"))
    running.push("raw", 1)
    assert running.values("m")[-2:] == [2, 2]
    running.push("ids", ())
    works(running)
    assert len(running.network.labels()) < 10


def test_members_that_change_with_every_sample_leave_nothing_behind(running) -> None:
    running.add(
        MEMBERS + "for c in car_ids strmgen x[c] = raw\nstrmgen all = merge x[c] for c in car_ids\nstream m = all"
    )
    running.push("ids", ())
    before = running.state()
    for n in range(100):
        running.push("ids", tuple(range(50 * n, 50 * n + 50)))
    running.push("raw", 1)
    assert running.values("m") == [1] * 50
    running.push("ids", ())
    kept = {"sizes": None}  # what the merge made stays in its history
    assert running.state() | kept == before | kept


@pytest.mark.parametrize("depth", [2, 3, 6])
def test_nested_quantifiers_over_too_many_members_are_told_and_what_holds_is_unknown(running, depth) -> None:
    quantifiers = "".join(f"forall v{i} in car_ids: " for i in range(depth))
    whole = " and ".join(f"p[v{i}] > 0" for i in range(depth))
    running.add(MEMBERS + f"for c in car_ids strmgen p[c] = raw\nmonitor m = {quantifiers}({whole})\n")
    running.push("ids", ("c1", "c2"))
    running.push("ids", tuple(range(300)))
    assert [said for _, said in running.faults if "expands to more than" in said]
    monitor = running.instance.monitors["m"].monitor
    assert monitor.shows == "unknown"
    works(running)
    running.push("ids", ("c1", "c2"))
    for _ in range(300):
        running.push("raw", 1)
    assert monitor.shows == "ok"
    running.push("ids", tuple(range(300)))
    refused(running, f"monitor n = {quantifiers}({whole})", "expands to more than")


def test_members_that_never_come_again_wear_no_monitor_out(running) -> None:
    parts = " and ".join(f"(eventually[0,1s] p[c] > -{i})" for i in range(20))
    running.add(
        MEMBERS + f"for c in car_ids strmgen p[c] = raw\nmonitor m = always forall c in car_ids growing: {parts}\n"
    )
    for n in range(30):
        running.push("ids", tuple(range(50 * n, 50 * n + 50)), running.now_us + 100_000)
        running.push("raw", 1, running.now_us + 50_000)
        running.push("raw", 1, running.now_us + 50_000)
        running.push("raw", 1, running.now_us + 100_000)
    assert running.faults == []
    assert running.instance.monitors["m"].monitor.shows == "ok"
    works(running)


def test_definitions_that_only_make_each_other_longer(running) -> None:
    for more in ("not d{0}", "d{0} and d{0}", "d{0} or (d{0} and d{0})"):
        text = "define d0 = a > 3\n" + "".join(f"define d{i + 1} = {more.format(i)}\n" for i in range(1_000))
        refused(running, text + "monitor m = d1000", "nested too deep")


@pytest.mark.parametrize("megabytes", [5, pytest.param(50, marks=pytest.mark.full)])
def test_a_text_of_fifty_megabytes(running, megabytes) -> None:
    for text in ("stream x = a\n" * 80_000, "x" * 1_000_000, "# x\n" * 250_000, "(" * 1_000_000):
        refused(running, text * megabytes, "65536 are allowed")


@pytest.mark.parametrize(
    "count", [pytest.param(500, id="tenth"), pytest.param(5_000, id="bar", marks=pytest.mark.full)]
)
def test_a_state_of_five_thousand_inputs(running, count) -> None:
    declarations = []
    for start in range(0, count, 500):
        declarations += parse_specification("".join(f"strmgen s{i} = raw\n" for i in range(start, start + 500)))
    each = Policy.parse("sample every 10, max delay 5")
    made = StateStream(tuple(StreamTerm(Label(f"s{i}"), each) for i in range(count)))
    declarations += [GeneratorDeclaration(Label("st"), made), *parse_specification("stream state = st")]
    running.instance.add(declarations, 0)
    works(running)
    assert [len(value) for value in running.values("state")] == [count]


def test_histories_without_bound() -> None:
    forever = UnitPrototype("Forever", "number", ("number",), lambda: of_values(lambda v: v), history_us=2**70)
    running = Running(BASE + "strmgen b = Forever(a)\nstream o = b", prototypes=[forever], history=100)
    for _ in range(1_000):
        works(running)
    assert running.network.generator(Label("b")).history.get_size() == 100
    refused(running, "stream past = b with from 0 to oo", "earliest possible time")


def test_what_was_owed_since_the_epoch_is_not_made_up_for() -> None:
    now_us = 1_700_000_000_000_000
    running = Running()
    running.network.now_us = now_us
    running.add(BASE)
    works(running)
    text = "with from 0 to oo, sample every 1, max delay 1"
    running.add(f"stream o = a {text}, use most recent\nstrmgen st = state(a) {text}\nstream q = st\n")
    running.push("raw", 2)
    running.add(f"stream p = st\nstrmgen b = Double(a {text}, use most recent)\nstream r = b")
    running.wait(now_us + 1_000_000)
    assert 900 < len(running.values("o")) < 40_000
    works(running)
