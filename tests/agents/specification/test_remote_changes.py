"""Declarations that come and go on a running platform because another member asks for it (thesis 5.2, 9.3.2)."""

import pytest

from dyknow.agents.config import PlatformConfig
from dyknow.agents.monitoring.coordination import Coordination
from dyknow.agents.specification.remote_changes import CHANGES_BURST
from dyknow.agents.specification.specification_part import OWNER
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import (
    AddDeclarations,
    Alarm,
    AlarmList,
    CreateMonitor,
    LoadSpecification,
    MonitorProximity,
    Monitors,
    NamedText,
    Reason,
    RemoveDeclarations,
    RestoreSpecification,
    SpecificationChanged,
)
from dyknow.federation.messages.contents.parts import ContentError, read
from dyknow.kpl import parse_specification, print_specification
from tests.agents.specification.test_specification_part import Pair, text_of
from tests.federation.expressions import parse_expr

P = Performative


class Changed(Pair):
    """Two platforms and a command centre."""

    def __init__(self, *texts):
        super().__init__(*texts)
        self.world.add_command_centre()
        self.world.run_for(1)

    def ask(self, content, unit="0", by="cc"):
        dialogue = self.world.ask(by, unit, content)
        self.world.run_for(1.5)
        return dialogue

    def changed(self, content, unit="0"):
        (said,) = self.ask(content, unit).results
        assert isinstance(said, SpecificationChanged), said
        return said

    def refused(self, content, unit="0"):
        dialogue = self.ask(content, unit)
        performative, reason = dialogue.refusal
        assert performative is P.REFUSE
        assert isinstance(reason, Reason)
        return reason

    def text(self, unit="0"):
        return print_specification(self.declared(unit).instance.specification)


@pytest.fixture
def pair():
    return Changed(text_of("uav0.kpl"), text_of("uav1.kpl"))


def test_a_declaration_is_added_runs_and_is_removed_and_nothing_else_is_touched(pair):
    monitor = pair.world.platform("0").built.monitors.named["apart"]
    before = pair.text()
    said = pair.changed(AddDeclarations(text="stream far = dist[uav1] with sample every 1s\n"))
    assert (said.number, said.added, said.removed) == (1, ("stream far = dist[uav1] with sample every 1000",), ())
    pair.world.run_for(4)
    assert len([each for each in pair.told("0", "sample") if each["stream"] == "far"]) >= 3
    assert pair.changed(RemoveDeclarations(names=("far",))).removed == said.added
    assert pair.text() == before
    assert pair.world.platform("0").built.monitors.named["apart"] is monitor
    notes = [note for note in pair.notes("0") if note.startswith("cc changed the specification (")]
    assert [note.split(": ", 1)[1] for note in notes] == [f"+ {said.added[0]}", f"- {said.added[0]}"]


def test_every_change_is_in_the_audit_log_with_who_asked_and_what(pair):
    pair.changed(AddDeclarations(text="stream far = dist[uav1]"))
    log = pair.world.platform("0").ports.agent.audit_log.entries
    (entry,) = [each for each in log if each.act and each.act.content and each.act.content.head == "add-declarations"]
    assert (entry.direction, entry.peer, entry.outcome) == ("in", "cc", "accepted")
    assert "stream far" in str(entry.act.content)


def test_a_platform_without_a_specification_gets_one_and_can_have_none_again():
    pair = Changed()
    pair.world.add("0", PlatformConfig("0", 0))
    pair.world.run_for(2)
    assert pair.changed(LoadSpecification(text="stream high = altitude[self]\n")).number == 1
    pair.changed(RestoreSpecification(number=0))
    assert pair.text() == ""


def test_what_is_loaded_replaces_what_is_held_and_is_restored(pair):
    before = pair.text()
    said = pair.changed(LoadSpecification(text=text_of("uav1.kpl")))
    assert any(line.startswith("monitor apart") for line in said.removed)
    assert pair.changed(RestoreSpecification(number=0)).number == 2
    assert pair.text() == before


def test_the_first_configuration_is_restored_however_many_changes_came_after_it(pair):
    instance = pair.declared("0").instance
    more = AddDeclarations(text="stream far = dist[uav1]")
    for _ in range(150):
        instance.add(pair.declared("0").instance.specification[:0], pair.world.now_us)
    for _ in range(150):
        instance.change((), pair.world.now_us)
    assert len(instance.configurations) == 256
    pair.changed(RestoreSpecification(number=0))
    assert "monitor apart" in pair.text()
    pair.changed(more)


@pytest.mark.parametrize(
    ("content", "code", "said"),
    [
        (
            AddDeclarations(text="stream far = dst[uav1]", file="far.kpl"),
            "text",
            "far.kpl:1:14: nothing makes dst[uav1]",
        ),
        (AddDeclarations(text="stream far = "), "text", "declarations of cc:1:13: expected a name"),
        (AddDeclarations(text="stream distance_m = dist[uav1]"), "text", "distance_m is a stream already"),
        (AddDeclarations(text="strmgen x = Nobody(pos[self])"), "text", "Nobody is no computational unit"),
        (
            AddDeclarations(text="monitor proximity = always pos.latitude_deg[self] > 0"),
            "text",
            "another name is needed",
        ),
        (
            AddDeclarations(text="monitor low = always pos.latitude_deg[self] > 0 with starts avoidance"),
            "text",
            "it is about pairs of platforms: write it as always forall other in units - {self} growing",
        ),
        (AddDeclarations(text='chronicle file "/etc/passwd"'), "text", "does not come with the specification"),
        (AddDeclarations(text='roads "/etc/passwd"'), "text", "does not come with the specification"),
        (
            AddDeclarations(
                text='roads "a"', files=(NamedText(path="a", text="<!DOCTYPE x [<!ENTITY a 'b'>]><osm/>"),)
            ),
            "text",
            "declarations of cc:1:1: a:",
        ),
        (
            AddDeclarations(text='roads "a"', files=(NamedText(path="a", text="[" * 60),)),
            "text",
            "declarations of cc:1:1: a:",
        ),
        (RemoveDeclarations(names=("alt[self]",)), "text", "nothing makes alt[self], which the running instance needs"),
        (RemoveDeclarations(names=("distance",)), "unknown-name", "Did you mean 'distance_m'?"),
        (RestoreSpecification(number=7), "unknown-number", "expected a number from 0 to 0, got 7"),
    ],
)
def test_what_cannot_be_is_refused_with_the_reason_and_changes_nothing(pair, content, code, said):
    before = pair.text()
    reason = pair.refused(content)
    assert (reason.code, said in reason.text) == (code, True), reason.text
    assert pair.text() == before
    assert len(pair.declared("0").instance.configurations) == 1


def test_a_name_of_several_kinds_is_removed_with_its_kind(pair):
    pair.changed(AddDeclarations(text='label gas : gas in ppm "Gas."\n'))
    pair.changed(AddDeclarations(text="stream apart = dist[uav1]\nstream gas = alt[self]"))
    assert "write: 'monitor apart'" in pair.refused(RemoveDeclarations(names=("apart",))).text
    reason = pair.refused(RemoveDeclarations(names=("gas",)))
    assert reason.code == "ambiguous-name"
    pair.changed(RemoveDeclarations(names=("stream  apart", "stream gas", "label gas")))
    assert pair.text() == print_specification(pair.declared("0").instance.configurations[0].specification)


def test_code_of_units_does_not_come_with_a_change_and_the_answer_says_what_to_do(pair):
    said = pair.changed(AddDeclarations(text="compunit distance Twice(position)\nstrmgen twice = Twice(pos[self])\n"))
    (warning,) = said.warnings
    assert warning.startswith("nothing here offers Twice: the code of units is not sent; offer it with dyknow host")


def test_a_file_that_the_text_names_comes_with_it(pair):
    turns = "chronicle t[?u] { event(alt.altitude_m[?u]:(?a, ?b), t1) }"
    pair.changed(
        AddDeclarations(
            text='chronicle file "t.chr" with max delay 100\nstream turned = chronicle[t]\n',
            files=(NamedText(path="t.chr", text=turns),),
        )
    )
    assert "stream turned" in pair.text()


def test_a_monitor_that_a_task_needs_does_not_go(pair):
    monitors = pair.world.platform("0").built.monitors
    task = pair.ask(CreateMonitor(name="apart"))
    assert task.agreed
    other = text_of("uav0.kpl").replace("always forall", "eventually forall")
    for content in (RemoveDeclarations(names=("apart",)), LoadSpecification(text=""), LoadSpecification(text=other)):
        reason = pair.refused(content)
        assert reason.code == "in-use"
        name = task.conversation
        assert f"belongs to task {name}, which would lose it; cancel that first (dyknow cancel {name})" in reason.text
    pair.world.speak("cc", lambda member, now_us: member.acts.cancel("0", name, now_us))
    pair.world.run_for(1)
    pair.changed(RemoveDeclarations(names=("apart",)))
    assert not monitors.named


def test_a_flood_of_changes_is_refused_and_the_platform_lives(pair):
    asked = [pair.world.ask("cc", "0", AddDeclarations(text=f"stream s{n} = dist[uav1]")) for n in range(20)]
    pair.world.run_for(1.5)
    refused = [each for each in asked if each.refusal is not None]
    assert len(asked) - len(refused) in {int(CHANGES_BURST), int(CHANGES_BURST) + 1}
    assert {each.refusal[1].code for each in refused} == {"too-many-changes"}
    pair.world.run_for(2)
    pair.changed(RemoveDeclarations(names=("s0",)))


@pytest.mark.parametrize(
    "text",
    [
        f'(add-declarations text: "{"x" * 8193}")',
        '(add-declarations text: "a\x9b")',
        "(remove-declarations names: (sequence))",
        f"(remove-declarations names: (sequence {' '.join('abc' for _ in range(65))}))",
    ],
)
def test_what_is_too_long_or_empty_is_not_understood(text):
    with pytest.raises(ContentError):
        read(parse_expr(text))


def test_a_file_that_changes_tells_what_it_replaces(pair):
    pair.changed(AddDeclarations(text="stream far = dist[uav1]"))
    pair.specify("0", text_of("uav0.kpl"))
    assert pair.notes("0")[-1] == "0.kpl replaces what other members had added: stream far = dist[uav1]"


NEAR = "monitor near = always forall other in units - {self} growing: xy_dist[self, other] >= 5 with starts avoidance\n"
SLOW = "monitor slow = always dist[uav1] > 15\n"


def test_a_declared_monitor_is_a_named_one_that_a_task_sets_up_everywhere_and_it_may_start_avoidance(pair):
    for unit in ("0", "1"):
        pair.changed(AddDeclarations(text=NEAR), unit)
    task = pair.ask(MonitorProximity(profile="near"))
    assert task.agreed
    for unit in ("0", "1"):
        platform = pair.world.platform(unit)
        named = platform.built.monitors.named["near"]
        assert named.owners == {OWNER, task.conversation}
        assert named.plan.profile.starts_avoidance
        assert platform.part(Coordination).keeps_apart()
    reason = pair.refused(RemoveDeclarations(names=("near",)), "1")
    assert reason.code == "in-use"
    pair.world.speak("cc", lambda member, now_us: member.acts.cancel("0", task.conversation, now_us))
    pair.world.run_for(1)
    assert pair.world.platform("1").built.monitors.named["near"].owners == {OWNER}


def test_a_declared_monitor_over_streams_of_the_instance_is_a_named_one_too(pair):
    pair.changed(AddDeclarations(text=SLOW))
    task = pair.ask(MonitorProximity(profile="slow"))
    assert task.agreed
    pair.world.run_for(15)
    alarms = [said for said in task.results if isinstance(said, Alarm)]
    opened = next(each for each in alarms if each.event == "opened")
    assert opened.monitor == "slow"
    (reason,) = opened.because
    assert (reason.part, reason.holds, list(reason.samples)) == ("dist[uav1] > 15", False, ["dist[uav1]"])
    assert reason.samples["dist[uav1]"] <= 15
    assert all(not each.because for each in alarms if each.event == "closed")
    assert pair.refused(LoadSpecification(text="")).code == "in-use"
    assert "no monitor is called 'slow' here" in pair.refused(CreateMonitor(name="slow"), "1").text
    again = pair.refused(CreateMonitor(name="slow", sample_period_s=7.0))
    assert "slow is monitored here already, as sample every" in again.text


def test_a_monitor_in_alarm_is_explained_on_request(pair):
    pair.changed(
        AddDeclarations(
            text="monitor under = always alt.altitude_m[self] < -1000\nmonitor over = always alt.altitude_m[self] > -1000\n"
        )
    )
    pair.world.run_for(3)
    plain, explained = (pair.world.ask("cc", "0", each, P.QUERY_REF) for each in (Monitors(), Monitors(explain=True)))
    pair.world.run_for(1)
    assert not any(each.because for each in plain.results[0].monitors)
    reasons = {each.name: each.because for each in explained.results[0].monitors}
    [reason] = reasons["under"]
    assert (reason.part, reason.holds, list(reason.samples)) == (
        "alt.altitude_m[0] < -1000",
        False,
        ["alt.altitude_m[0]"],
    )
    assert reasons["over"] == ()


def test_what_starts_avoidance_is_printed_and_read_back(pair):
    pair.changed(AddDeclarations(text=NEAR))
    assert "with starts avoidance" in pair.text()
    assert parse_specification(pair.text()) == pair.declared("0").instance.specification


def test_an_alarm_over_units_says_which_part_of_the_formula_opened_it_with_its_samples(pair):
    pair.world.run_for(20)
    dialogue = pair.world.ask("cc", "0", AlarmList(), P.QUERY_REF)
    pair.world.run_for(1)
    (listed,) = dialogue.results
    opened = [each for each in listed.alarms if each.event == "opened"]
    assert opened
    for alarm in opened:
        reasons = {each.part: each for each in alarm.because}
        assert set(reasons) == {"xy_dist[0, 1] >= 15.0", "z_dist[0, 1] >= 10.0"}
        assert all(not each.holds and each.samples for each in reasons.values())
        assert all(value == alarm.values[name] for each in reasons.values() for name, value in each.samples.items())
