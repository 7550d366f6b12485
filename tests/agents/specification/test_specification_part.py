"""Platforms that run specifications: what one exports another imports, queries and monitors (language.md, 9.3, 9.4)."""

import re
from itertools import count, pairwise
from pathlib import Path

import pytest

from dyknow import Label, Quality, Sample, SourcePrototype, computational_unit, prototypes_in, source
from dyknow.agents.config import PlatformConfig
from dyknow.agents.effects import HostCame, HostMessage
from dyknow.agents.exchange.subscription_keeper import SubscriptionKeeper
from dyknow.agents.hosts.knowledge_host import KnowledgeHost
from dyknow.agents.hosts.outbox import Outbox
from dyknow.agents.options import Chosen
from dyknow.agents.specification.options import RunOptions
from dyknow.agents.specification.specification_part import SpecificationPart
from dyknow.compunits import catalogue
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import AlarmList, Monitors, Query
from dyknow.kpl import parse_specification, print_specification
from dyknow.sim_uavs.world.world import World

EXAMPLES = Path(__file__).parents[3] / "examples"


def text_of(name):
    return (EXAMPLES / name).read_text("utf-8")


class Pair:
    """Two platforms without vehicles."""

    def __init__(self, *texts):
        self.world = World(1, truth_us=None)
        find = catalogue([str(EXAMPLES / "flights.py")]).offered
        for unit, text in enumerate(texts):
            self.world.add(str(unit), PlatformConfig(str(unit), 0, catalogue=find))
            self.specify(str(unit), text)

    def specify(self, unit, text):
        self.world.specify(unit, text, f"{unit}.kpl")
        self.world.run_for(0.001)

    def told(self, unit, event):
        return [record for record in self.world.nodes[unit].results if record["event"] == event]

    def notes(self, unit):
        return self.world.nodes[unit].notes

    def declared(self, unit):
        return self.world.platform(unit).part(SpecificationPart)


@pytest.fixture
def pair():
    return Pair(text_of("uav0.kpl"), text_of("uav1.kpl"))


def test_an_imported_stream_comes_and_what_is_derived_from_it(pair):
    pair.world.run_for(10)
    distances = [each["value"] for each in pair.told("0", "sample") if each["stream"] == "distance_m"]
    known = [distance for distance in distances if distance is not None]
    assert len(known) >= 15
    assert min(known) < 15
    assert max(known) > 80
    assert pair.notes("0") == []


def test_exported_labels_are_offered_and_queried_like_those_of_a_vehicle(pair):
    pair.world.run_for(3)
    entry = pair.world.platform("0").ports.directory.entry("1")
    assert {label.label: label.period_us for label in entry.labels} == {
        "heli-position": 100_000,
        "heli-altitude": 100_000,
    }
    found = pair.world.platform("1").built.gateway.latest("heli-altitude")
    assert found.value == (121.0,)
    assert pair.world.now_us - found.valid_us <= 200_000


def test_a_declared_monitor_over_units_opens_and_closes_alarms(pair):
    pair.world.run_for(20)
    opened, closed = pair.told("0", "alarm-opened"), pair.told("0", "alarm-closed")
    assert len(opened) >= 2
    assert len(opened) - len(closed) in {0, 1}
    assert {each["monitor"] for each in opened} == {"apart"}
    assert opened[0]["units"] == ["0", "1"]
    assert 5_000_000 < opened[1]["valid_us"] - opened[0]["valid_us"] < 7_000_000, "they meet twice a lap"


def test_a_platform_that_the_specification_lives_on_is_missed_aloud(pair):
    from dyknow.console.commands.texts.run_output import _sample

    pair.world.run_for(5)
    pair.world.freeze("1")
    pair.world.run_for(12)
    assert pair.notes("0")[0] == "platform 1 is gone (no heartbeat for 2.5 s)"
    last = [each for each in pair.told("0", "sample") if each["stream"] == "distance_m"][-1]
    origin = last["origins"]["pos[uav1]"]
    assert origin["manner"] == "most recent"
    assert last["valid_us"] - origin["valid_us"] > 9_000_000
    assert re.search(r"most recent, (9|1\d)\.\d s old", _sample(last).plain)
    pair.world.thaw("1")
    pair.world.run_for(3)
    assert pair.notes("0")[-1] == "platform 1 is back"


def test_a_changed_definition_reaches_a_running_monitor_over_units(pair):
    pair.world.run_for(10)
    before = pair.told("0", "alarm-opened")
    assert before[0]["values"]["xy_dist[0, 1]"] < 15
    pair.specify("0", text_of("uav0.kpl").replace("MIN_XY = 15.0", "MIN_XY = 40.0"))
    pair.world.run_for(20)
    after = pair.told("0", "alarm-opened")[len(before) :]
    assert 30 < after[-1]["values"]["xy_dist[0, 1]"] < 40


def test_a_monitor_over_units_says_what_its_states_are_made_of(pair):
    pair.world.run_for(3)
    ((apart,), _) = listed_and_told(pair)
    assert parse_specification(apart.states)
    assert apart.states.startswith("strmgen apart_states = state(")
    assert "from 0 to oo" in apart.states
    assert apart.counted.keys() <= {"missing", "out of order", "duplicate", "NaN"}


def test_what_is_taken_back_is_offered_asked_for_and_monitored_no_more(pair):
    pair.world.run_for(3)
    text = text_of("uav0.kpl")
    less = "".join(
        line for line in text.splitlines(keepends=True) if not line.startswith(("import", "monitor", "export"))
    )
    gone = ("dist", "uav1", "both")
    less = "".join(line for line in less.splitlines(keepends=True) if not any(name in line for name in gone))
    pair.specify("0", less)
    pair.world.run_for(3)
    platform = pair.world.platform("0")
    assert platform.part(SubscriptionKeeper).needs() == {}
    assert not platform.built.monitors.named
    assert not pair.world.platform("1").ports.directory.entry("0").labels
    assert not pair.world.platform("1").built.gateway.exporter.exports.streams()
    pair.specify("0", text)
    before = len(pair.told("0", "sample"))
    pair.world.run_for(6)
    assert len(pair.told("0", "sample")) - before >= 8


def test_a_feature_that_nothing_makes_is_told_with_what_may_be_meant(pair):
    added = "monitor near = always (dst[uav1] < 9 or pos.latitude_deg[self] < 9 or xy_dist[self, uav1] < 9)\n"
    pair.specify("0", text_of("uav0.kpl") + added)
    told = [note for note in pair.notes("0") if "nothing here makes" in note]
    assert len(told) == 1
    assert "nothing here makes dst" in told[0]
    assert "write: dist[uav1]" in told[0]


def test_a_wrong_change_is_told_and_what_ran_goes_on(pair):
    pair.world.run_for(2)
    pair.specify("0", text_of("uav0.kpl") + "strmgen x = Nobody(pos[nobody])\n")
    assert "Nobody is no computational unit" in pair.notes("0")[-1]
    assert "the previous one keeps running" in pair.notes("0")[-1]
    before = len(pair.told("0", "sample"))
    pair.world.run_for(4)
    assert len(pair.told("0", "sample")) > before
    assert "Nobody" not in print_specification(pair.declared("0").instance.specification)


def test_a_partner_that_dies_is_told_and_its_streams_come_again_when_it_returns(pair):
    pair.world.run_for(4)
    pair.world.kill("1")
    pair.world.run_for(5)
    monitor = pair.world.platform("0").built.monitors.named["apart"].instances["1"].monitor
    assert monitor.shows == "unknown"
    pair.world.restart("1")
    pair.specify("1", text_of("uav1.kpl"))
    before = len(pair.told("0", "sample"))
    pair.world.run_for(6)
    assert len(pair.told("0", "sample")) - before >= 6
    assert monitor.shows in {"ok", "alarm"}


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("import heli-position from 0 as pos[me]", "that is this platform"),
        ("import heli-colour from 1 as colour[uav1]", "the ontology has no label heli-colour"),
        (f"monitor {'m' * 65} = always pos.latitude_deg[self] != 1", "at most 64 characters, got 65"),
    ],
)
def test_what_a_federation_cannot_do_is_refused_in_words(pair, line, said):
    pair.specify("0", text_of("uav0.kpl") + line + "\n")
    assert said in pair.notes("0")[-1]
    (told,) = pair.told("0", "not-specified")
    assert told["runs"]
    assert said in told["said"]
    assert pair.world.platform("0").ports.network.has(Label("pos", ("0",)))


def test_a_derived_feature_of_another_unit_is_imported_while_it_is_wanted(pair):
    """One stream, and one monitor of a formula that speaks of it and of a stream of the instance."""
    lines = (
        "stream d = xy_dist[self, 1]\n"
        "monitor close = always forall u in units - {self} growing: xy_dist[self, u] > 15 or pos.latitude_deg[self] > 90\n"
    )
    pair.specify("0", text_of("uav0.kpl").replace("monitor apart", "# monitor apart") + lines)
    pair.world.run_for(20)
    assert pair.notes("0") == []
    distances = [each["value"] for each in pair.told("0", "sample") if each["stream"] == "d"]
    assert len(distances) > 100
    assert min(distances) < 15 < max(distances)
    opened = pair.told("0", "alarm-opened")
    assert {each["monitor"] for each in opened} == {"close"}
    assert opened[0]["values"].keys() == {"xy_dist[0, 1]", "pos.latitude_deg[0]"}
    needs = pair.world.platform("0").part(SubscriptionKeeper).needs()
    assert ("heli-position", 100_000, 1_000_000) in needs["1"]
    pair.specify("0", "")
    assert pair.world.platform("0").part(SubscriptionKeeper).needs() == {}


def test_what_runs_is_told_with_what_goes_out_and_comes_in(pair):
    (told,) = pair.told("0", "specified")
    assert told["exports"] == ["heli-altitude", "heli-position"]
    assert told["imports"] == [["heli-position", "1"]]
    assert told["declarations"] == len(pair.declared("0").instance.specification)


def test_the_first_specification_may_be_wrong_too():
    wrong = Pair("stream a = b\n")
    (told,) = wrong.told("0", "not-specified")
    assert not told["runs"]
    assert not wrong.told("0", "specified")


def test_two_imports_of_one_stream_under_two_policies_are_both_served(pair):
    pair.specify(
        "0",
        text_of("uav0.kpl")
        + "import heli-position from 1 as slow[uav1] with sample every 1s, max delay 1s\nstream slow = slow[uav1]\n",
    )
    pair.world.run_for(8)
    slow = [each["valid_us"] for each in pair.told("0", "sample") if each["stream"] == "slow"]
    assert len(slow) >= 5
    assert {b - a for a, b in pairwise(slow)} == {1_000_000}


QUALIFIED = """
source position gps_1
strmgen pos[self] = Doubtful(gps[self])
strmgen gps[self] = gps_1
export heli-position = pos[self] with sample every 100
"""
CAREFUL = """
import heli-position from 1 as pos[uav1] with sample every 100, max delay 1000
stream all = pos[uav1]
stream sure = pos[uav1] with min certainty 0.9
stream exact = pos[uav1] with max deviation 0.5
"""


@computational_unit("position", "position")
class Doubtful:
    """Every fourth sample is doubtful, every fifth is far off."""

    def __init__(self):
        self.count = -1

    def __call__(self, now_us, position):
        self.count += 1
        deviation = 2.0 if self.count % 5 == 0 else 0.1
        quality = Quality(0.5 if self.count % 4 == 0 else 0.95, ((deviation**2, 0.0), (0.0, deviation**2)))
        return Sample(now_us, position.valid_us, position.value, quality)


def test_what_is_said_of_a_sample_goes_with_it_to_other_platforms():
    pair = Pair("", "")
    find = catalogue([str(EXAMPLES / "flights.py")]).offered
    ours = {each.name: each for each in prototypes_in([Doubtful])}
    for unit in ("0", "1"):
        pair.declared(unit).instance._catalogue = lambda name: ours.get(name) or find(name)
    pair.specify("1", QUALIFIED)
    pair.specify("0", CAREFUL)
    pair.world.run_for(10)
    counts = {
        name: len([e for e in pair.told("0", "sample") if e["stream"] == name]) for name in ("all", "sure", "exact")
    }
    assert counts["all"] > 60
    assert counts["sure"] == pytest.approx(counts["all"] * 3 / 4, abs=2)
    assert counts["exact"] == pytest.approx(counts["all"] * 4 / 5, abs=2)
    assert pair.notes("0") == []
    newest = pair.world.platform("0").ports.network.generator(Label("pos", ("uav1",))).history.get_latest()
    assert len(newest.quality.covariance) == 2


def test_a_governed_platform_may_listen_to_its_governor_from_the_first_specification_on():
    pair = Pair()
    pair.world.add("0", PlatformConfig("0", 0, options=Chosen(RunOptions(govern="50ms"))))
    pair.specify("0", "stream told = refinements\nstream late = stream_delay[worst]\n")
    pair.world.run_for(1)
    assert pair.notes("0") == []
    assert {each["stream"] for each in pair.told("0", "sample")} == {"late"}


@source("level")
def ticks(from_us):
    return ((valid_us, 1.0) for valid_us in count(-(-from_us // 100_000) * 100_000, 100_000))


@source("place")
def places(from_us):
    return ((valid_us, (58.4, "x" * 5000)) for valid_us in count(-(-from_us // 100_000) * 100_000, 100_000))


@source("altitude")
def beside(from_us):
    """Every 100 ms, 37 ms after the points of everybody's grid."""
    return ((valid_us, (100.0,)) for valid_us in count(-(-from_us // 100_000) * 100_000 + 37_000, 100_000))


BESIDE = "source altitude beside\nstrmgen alt[self] = beside\nexport heli-altitude = alt[self]"
TAKING = "import heli-altitude from 1 as alt[uav1] with sample every 200, max delay 1s\nstream alt = alt[uav1]\n"


def test_an_import_all_of_whose_samples_lie_off_the_grid_is_told_within_two_seconds_with_the_remedy():
    pair = Pair("", "")
    pair.declared("1").instance.offer(prototypes_in([beside]), 0)
    pair.specify("1", BESIDE + "\n")
    pair.world.run_for(3)
    pair.specify("0", TAKING)
    pair.world.run_for(2)
    assert pair.told("0", "sample") == []
    (note,) = pair.notes("0")
    assert "no sample of heli-altitude comes from platform 1: the newest lies 137ms off the grid of 200ms" in note
    remedy = re.search("`(.*)`", note)[1]
    pair.world.run_for(1)
    shown = pair.world.platform("1").ports.directory.entry("0").conditions
    assert [each.text for each in shown] == [note]
    pair.world.run_for(20)
    assert pair.notes("0") == [note], "said once, however often the stream is asked for"
    assert "use linear" in remedy
    pair.specify("1", f"{BESIDE} with {remedy}\n")
    pair.world.run_for(5)
    assert len(pair.told("0", "sample")) > 10, "the remedy helps"
    assert pair.world.platform("1").ports.directory.entry("0").conditions == ()


def listed_and_told(pair):
    asked = [pair.world.ask("1", "0", each, Performative.QUERY_REF) for each in (Monitors(), AlarmList())]
    pair.world.run_for(1)
    monitors, alarms = (each.results[0] for each in asked)
    return monitors.monitors, alarms.alarms


def test_a_monitor_over_streams_of_its_own_is_listed_like_those_over_units():
    pair = Pair("", "")
    pair.world.platform("0").part(SpecificationPart).instance.offer(prototypes_in([ticks]), 0)
    pair.specify("0", "source level ticks\nstrmgen level[self] = ticks\nmonitor low = always level[self] < 0\n")
    pair.world.run_for(4)
    monitors, alarms = listed_and_told(pair)
    assert [(each.name, each.shows, each.inputs) for each in monitors] == [("low", "alarm", "fresh")]
    assert [(each.monitor, list(each.values)) for each in alarms] == [("low", ["level[0]"])]
    assert monitors[0].states.startswith(
        "strmgen low_states = state(level[0] with max delay 1000) with sample every 100"
    )
    assert monitors[0].counted == {}


def test_an_alarm_with_more_than_can_be_told_is_told_as_far_as_it_can():
    pair = Pair("", "")
    pair.world.platform("0").part(SpecificationPart).instance.offer(prototypes_in([ticks, places]), 0)
    many = " or ".join(f"level[c{i}] < 0" for i in range(300))
    lines = [f"strmgen level[c{i}] = ticks" for i in range(300)]
    text = "\n".join(["source level ticks", "source place places", "strmgen place[self] = places", *lines])
    pair.specify("0", f"{text}\nmonitor many = always ({many})\nmonitor home = always place[self] = 3\n")
    pair.world.run_for(2)
    assert not pair.notes("0")
    _, alarms = listed_and_told(pair)
    assert {each.monitor: len(each.values) for each in alarms} == {"many": 256, "home": 1}


def test_what_needs_the_stream_of_a_host_is_taken_when_the_host_comes():
    pair = Pair("", "")
    pair.specify("0", "stream seen = picture[self]\n")
    (told,) = pair.told("0", "not-specified")
    assert "nothing makes picture[self]" in told["said"]
    assert told["awaits"] == ["picture[self]"]
    assert "until a host offers picture[self]" in pair.notes("0")[-1]
    outbox = Outbox()
    outbox.put(
        KnowledgeHost([SourcePrototype("camera", "picture", label="picture[self]")], 1, "camera.py").registration()
    )
    declared, now_us = pair.declared("0"), pair.world.now_us
    declared.on_host(HostCame(now_us, 1), now_us)
    for payload in outbox.take():
        declared.on_host(HostMessage(now_us, 1, payload), now_us)
    assert [str(each.label) for each in declared.instance.streams.values()] == ["picture[0]"]


@pytest.mark.parametrize(
    "more", ["strmgen x = Unknown(place[self])", "source place places\nstrmgen pictures[self] = places"]
)
def test_what_is_wrong_besides_waits_for_no_host(more):
    pair = Pair("", "")
    pair.specify("0", f"stream seen = picture[self]\n{more}\n")
    (told,) = pair.told("0", "not-specified")
    assert told["awaits"] == []


def test_nothing_is_asked_for_or_computed_elsewhere_that_nobody_takes():
    idle = "import heli-position from 1 as pos[uav1] with sample every 100, max delay 1000\n"
    pair = Pair(idle, text_of("uav1.kpl"))
    platform, other = pair.world.platform("0"), pair.world.platform("1")
    pair.world.run_for(3)
    assert platform.part(SubscriptionKeeper).needs() == {}
    assert not other.built.gateway.exporter.exports.streams()
    assert not other.ports.network.process(Label("pos", ("1",))).running
    pair.specify("0", idle + "monitor near = always pos.latitude_deg[uav1] < 90\n")
    pair.world.run_for(3)
    assert other.built.gateway.exporter.exports.streams()
    assert other.ports.network.process(Label("pos", ("1",))).running
    pair.specify("0", idle)
    pair.world.run_for(3)
    assert platform.part(SubscriptionKeeper).needs() == {}
    assert not other.built.gateway.exporter.exports.streams()
    assert not other.ports.network.process(Label("pos", ("1",))).running


def test_each_monitor_of_an_imported_stream_has_its_own_rate_and_the_last_one_ends_it_on_both_platforms():
    imports = "".join(
        f"import heli-position from 1 as {name}[uav1] with sample every {period}, max delay 1000\n"
        for name, period in (("pos", "100"), ("slow", "1s"))
    )
    fast = "monitor fast = always pos.latitude_deg[uav1] < 90 with sample every 100\n"
    less = "monitor less = always pos.latitude_deg[uav1] < 90 with sample every 500\n"
    rare = "monitor rare = always slow.latitude_deg[uav1] < 90 with sample every 1s\n"
    pair = Pair(imports + fast + less + rare, text_of("uav1.kpl"))
    platform, other = pair.world.platform("0"), pair.world.platform("1")

    def rates(*names):
        """Seconds between states, of each monitor."""
        times = {name: [] for name in names}
        for name in names:
            listeners = platform.part(SpecificationPart).instance.monitors[name].listeners
            listeners.append(lambda state, into=times[name]: into.append(state.valid_us))
        pair.world.run_for(6)
        return [{(b - a) / 1e6 for a, b in pairwise(times[name])} for name in names]

    def asked():
        return {period_us for _, period_us, _ in platform.part(SubscriptionKeeper).needs().get("1", ())}

    pair.world.run_for(2)
    assert rates("fast", "less", "rare") == [{0.1}, {0.5}, {1.0}]
    assert asked() == {100_000, 1_000_000}
    assert len(other.built.gateway.exporter.exports.streams()) == 2
    pair.specify("0", imports + less + rare)
    assert rates("less", "rare") == [{0.5}, {1.0}]
    assert asked() == {100_000, 1_000_000}
    pair.specify("0", imports + rare)
    assert rates("rare") == [{1.0}]
    assert asked() == {1_000_000}
    assert len(other.built.gateway.exporter.exports.streams()) == 1
    assert other.ports.network.process(Label("pos", ("1",))).running
    pair.specify("0", imports)
    pair.world.run_for(3)
    assert asked() == set()
    assert not other.built.gateway.exporter.exports.streams()
    assert not other.ports.network.process(Label("pos", ("1",))).running
    assert not platform.ports.network.process(Label("pos", ("uav1",))).running


@source("position")
def camera(now_us):
    """Where the red car is, ten times a second, while somebody wants to know."""
    for n in range(1_000_000):
        yield (now_us // 100_000 + 1 + n) * 100_000, (58.0, 15.0 + n * 1e-6)


SEEING = "source position camera\nstrmgen seen = camera\nexport heli-position = seen with sample every 100\n"


def asks(pair, op="latest", seconds=1.5, **times):
    query = Query(semantic_label="heli-position", op=op, **times)
    dialogue = pair.world.ask("0", "1", query, Performative.QUERY_REF)
    pair.world.run_for(seconds)
    return dialogue.said[-1][1]


def test_a_query_rouses_what_rests_and_its_first_sample_is_the_answer():
    pair = Pair("", "")
    ours = {each.name: each for each in prototypes_in([camera])}
    pair.declared("1").instance._catalogue = ours.get
    pair.specify("1", SEEING)
    pair.world.run_for(2)
    network = pair.world.platform("1").ports.network
    assert not network.process(Label("seen")).running
    first = asks(pair)
    (reading,) = first.samples
    assert pair.world.now_us - reading.valid_us < 2_000_000
    assert network.process(Label("seen")).running, "who asks once asks again"
    asked_us = pair.world.now_us
    past = asks(pair, "between", from_us=asked_us - 1_000_000, to_us=asked_us)
    assert len(past.samples) >= 9
    pair.world.run_for(32)
    assert not network.process(Label("seen")).running


def test_a_query_of_what_brings_nothing_is_told_so():
    pair = Pair("", "source position gps_9\nstrmgen seen = gps_9\nexport heli-position = seen with sample every 100\n")
    pair.world.run_for(2)
    said = asks(pair)
    assert "none came within 1 s" in said.text


def test_a_duration_that_is_over_is_told_on_a_platform_and_one_from_now_on_has_samples():
    text = "source number gps\nstrmgen pos[uav] = gps\n"
    pair = Pair(f"{text}stream old = pos[uav] with from 300 to 400\nstream some = pos[uav] with from now to +1s\n")
    assert [note.splitlines()[0] for note in pair.notes("0") if "`to 400` was" in note]
    begins_us = pair.declared("0").instance.streams["some"].policy.from_us
    assert begins_us is not None
    assert 0 <= pair.world.now_us - begins_us <= 1_000


def test_alarms_that_are_open_end_when_their_monitors_are_removed_or_replaced_and_that_is_told(pair):
    low = "pos.latitude_deg[self] < 0"
    near = "monitor near = always forall other in units - {self} growing: xy_dist[self, other] > 100000\n"
    own = "".join(f"{line}\n" for line in text_of("uav0.kpl").splitlines() if not line.startswith("monitor"))
    pair.specify("0", f"{own}{near}monitor low = always {low}\n")
    pair.world.run_for(6)
    _, opened = listed_and_told(pair)
    assert {(each.monitor, each.event) for each in opened} == {("near", "opened"), ("low", "opened")}
    pair.specify("0", f"{own}monitor low = always ({low} and pos.latitude_deg[self] < 1)\n")
    pair.world.run_for(2)
    _, alarms = listed_and_told(pair)
    ended = {each.id: each for each in alarms if each.event == "ended"}
    assert ended.keys() == {each.id for each in opened}
    assert all(each.valid_us == each.detected_us and not each.values for each in ended.values())
    assert [each.monitor for each in alarms if each.event == "opened" and each.id not in ended] == ["low"]
    assert {record["id"] for record in pair.told("0", "alarm-ended")} == ended.keys()
    pair.specify("0", own)
    pair.world.run_for(1)
    _, alarms = listed_and_told(pair)
    opened_ids, ended_ids = ({each.id for each in alarms if each.event == event} for event in ("opened", "ended"))
    assert opened_ids == ended_ids


def test_a_monitor_over_a_stream_that_this_platform_has_not_is_told_when_another_joins():
    pair = Pair("", "")
    pair.specify("0", "monitor near = always forall other in units - {self} growing: xy_dist[self, other] > 5\n")
    pair.world.run_for(6)
    note, *_ = [each for each in pair.notes("0") if "monitor near over 1" in each]
    assert "no stream generator for 'heli-position[0]'" in note
