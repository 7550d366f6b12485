"""Labels that platforms mean differently are refused between these, and told; visibility says who gets an export."""

import math
from typing import Any

import pytest

from dyknow.compunits import catalogue
from dyknow.federation import keys
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import CreateMulticast, Query, QueryStream, Samples
from dyknow.federation.messages.descriptions import MAX_DEFINITIONS
from dyknow.federation.messages.unpacking import VERSION, pack
from dyknow.federation.sharing.ontology import default_ontology
from dyknow.model.semantic_labels import SemanticLabel
from dyknow.model.values import Sort
from tests.agents.admission.test_hostile import trust
from tests.box import Box, Question

P = Performative
IN_PPM = '[gas-level]\nsort = "gas"\nunit = "ppm"\nmeaning = "gas in the air around the platform"\n'
IN_PERCENT = IN_PPM.replace("ppm", "percent")
SNIFFS = """\
label gas-level : gas in ppm "gas in the air around the platform"
source gas sniffer
strmgen gas[self] = sniffer
{export} = gas[self]
"""
IMPORTS = """\
import gas-level from 7 as gas[uav7] with sample every 500, max delay 1000
stream seen = gas[uav7]
"""
GAS = SemanticLabel("gas-level", Sort("gas", unit="ppm"), "gas in the air around the platform")


def specify(wire: Box, unit: str, text: str) -> None:
    wire.specify(unit, text, f"{unit}.kpl")
    wire.run(0.6)


def sniffing(wire: Box, export: str = "export gas-level") -> None:
    """Platform 7 has a gas sensor."""
    wire.join("7", catalogue=catalogue(["examples/labels/sniffer.py"]).offered)
    specify(wire, "7", SNIFFS.format(export=export))


def joins(wire: Box, unit: str, labels: str = "", file: str = "lab.toml") -> None:
    """A platform that has a file of labels."""
    wire.join(unit, ontology=default_ontology().extended(labels, file))
    wire.run(0.6)


def queried(wire: Box, by: str, unit: str = "7") -> Question:
    asked = wire.question(by, unit, Query(semantic_label="gas-level"), P.QUERY_REF)
    wire.run(1.0)  # what is exported is computed when it is asked for
    return asked


def streamed(wire: Box, by: str, *receivers: str) -> Question:
    content = CreateMulticast(semantic_labels=("gas-level",), sample_period_s=0.5, delay_s=1.0, to_units=receivers)
    return wire.asked(by, "7", content)


def refused(wire: Box, reason: str, unit: str = "7") -> int:
    """How many acts a platform has refused for a reason."""
    return wire.platform(unit).ports.agent.audit_log.refused[reason]


def conditions(wire: Box, at: str, of: str) -> list[str]:
    """What `at` knows that `of` says is not as it should be."""
    entry = wire.platform(at).ports.directory.entry(of)
    return [] if entry is None else [each.text for each in entry.conditions]


# -- agreement ---------------------------------------------------------------------------------------------------


def test_a_label_of_ones_own_is_queried_imported_and_streamed_by_who_has_the_same_definition(wire: Box) -> None:
    sniffing(wire)
    joins(wire, "8", IN_PPM)
    specify(wire, "8", IMPORTS)
    wire.run(5.0)
    [said] = queried(wire, "8").contents
    assert isinstance(said, Samples)
    assert said.samples[0].value.keys() == {"value"}
    seen = [each["value"] for each in wire.nodes["8"].results if each["event"] == "sample" and each["stream"] == "seen"]
    assert len([value for value in seen if value is not None]) >= 5
    assert conditions(wire, "7", "8") == conditions(wire, "8", "7") == []


def test_what_two_mean_differently_is_refused_both_ways_and_both_say_with_which_line_of_theirs(wire: Box) -> None:
    sniffing(wire)
    joins(wire, "8", f"# ours\n{IN_PERCENT}")
    specify(wire, "8", IMPORTS)
    wire.run(3.0)
    asked = queried(wire, "8")
    assert asked.performatives == [P.REFUSE]
    assert asked.contents[0].code == "label-conflict"
    assert "gas in ppm" in asked.reason
    assert "gas in percent" in asked.reason
    assert "7.kpl:1" in asked.reason, "the line of who refuses"
    assert streamed(wire, "8", "8").performatives == [P.REFUSE]
    assert refused(wire, "label conflict") == 2
    assert wire.platform("8").built.gateway.importer.imports.streams == {}
    [here], [there] = conditions(wire, "8", "7"), conditions(wire, "7", "8")
    assert "7.kpl:1" in here
    assert "lab.toml:2" in there
    assert wire.nodes["8"].notes.count(there) == 1, "told once, not at every heartbeat"
    assert wire.asked("8", "7", Query(semantic_label="gas-level"), P.QUERY_REF).performatives == [P.REFUSE]
    assert wire.samples("7") == 0


def test_only_those_that_differ_are_refused_and_all_else_goes_on(wire: Box) -> None:
    sniffing(wire)
    joins(wire, "8", IN_PERCENT)
    joins(wire, "9", IN_PPM)
    wire.fly("0", 0.0, 0.0)
    wire.run(1.0)
    assert queried(wire, "9").performatives == [P.INFORM]
    assert queried(wire, "0").performatives == [P.INFORM], "it has no definition of its own to differ"
    asked = streamed(wire, "9", "8", "9")
    assert asked.performatives == [P.AGREE, P.INFORM]
    assert any("not exported to 8" in note for note in wire.nodes["7"].notes)
    assert [name[:2] for name in wire.platform("9").built.gateway.importer.imports.streams] == [("7", "gas-level")]
    assert wire.platform("8").built.gateway.importer.imports.streams == {}
    assert wire.asked("8", "0", Query(semantic_label="heli-position"), P.QUERY_REF).performatives == [P.INFORM]


def test_a_stream_ends_when_its_owner_or_its_receiver_changes_the_definition_and_comes_back(wire: Box) -> None:
    sniffing(wire)
    wire.join("8")
    ours = f'label gas-level : gas in ppm "{GAS.meaning}"\n{IMPORTS}'
    specify(wire, "8", ours)
    wire.run(3.0)
    importer = wire.platform("8").built.gateway.importer
    assert len(importer.imports.streams) == 1
    specify(wire, "7", SNIFFS.format(export="export gas-level").replace("ppm", "percent"))
    wire.run(1.0)
    assert importer.imports.streams == {}
    before = wire.samples("7")
    wire.run(3.0)
    assert wire.samples("7") == before, "it sends no more, either"
    specify(wire, "7", SNIFFS.format(export="export gas-level"))
    wire.run(5.0)
    assert len(importer.imports.streams) == 1
    assert wire.samples("7") > before
    assert conditions(wire, "7", "8") == conditions(wire, "8", "7") == []


def test_a_label_whose_definition_is_taken_away_is_unknown_again(wire: Box) -> None:
    sniffing(wire)
    specify(wire, "7", "source gas sniffer\nstrmgen gas[self] = sniffer\n")
    joins(wire, "8")
    wire.run(1.0)
    asked = queried(wire, "8")
    assert asked.performatives == [P.REFUSE]
    assert asked.contents[0].code == "unknown-label"


# -- visibility --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("export", "listed", "code", "said"),
    [
        ("export private gas-level", False, "private", "gas-level is private on 7"),
        ("export gas-level", True, "", ""),
        ("export public gas-level", True, "", ""),
        ("export protected gas-level", True, "", ""),
    ],
)
def test_visibility_says_who_may_ask(wire: Box, export: str, listed: bool, code: str, said: str) -> None:
    sniffing(wire, export)
    joins(wire, "8", IN_PPM)
    offered = {each.label for each in wire.platform("8").ports.directory.entry("7").labels}
    assert ("gas-level" in offered) is listed
    asked, shared = queried(wire, "8"), streamed(wire, "8", "8")
    if code:
        assert (asked.contents[0].code, asked.reason) == (code, said)
        assert shared.performatives == [P.REFUSE]
        assert refused(wire, code) == 2
    else:
        assert asked.performatives == [P.INFORM]
        assert shared.performatives == [P.AGREE, P.INFORM]


def test_what_is_protected_is_for_members_with_a_role_and_an_observer_is_told_so_and_counted(wire: Box) -> None:
    wire.join("0", catalogue=catalogue(["examples/labels/sniffer.py"]).offered, trust=trust("0"))
    for unit in ("cc", "eye"):
        wire.centre(unit, trust=trust(unit))
    wire.run(1.0)
    specify(wire, "0", SNIFFS.format(export="export gas-level"))
    assert queried(wire, "eye", "0").performatives == queried(wire, "cc", "0").performatives == [P.INFORM]
    specify(wire, "0", SNIFFS.format(export="export protected gas-level"))
    assert queried(wire, "cc", "0").performatives == [P.INFORM]
    asked = queried(wire, "eye", "0")
    assert asked.reason == "gas-level is protected on 0: an observer may not ask for it"
    assert asked.contents[0].code == "protected"
    assert refused(wire, "protected", "0") == 1
    stream = wire.asked("eye", "0", QueryStream(stream="gas[self]"), P.QUERY_REF)
    assert stream.performatives == [P.REFUSE]
    assert refused(wire, "role", "0") == 1


def test_an_export_to_some_is_for_them_and_for_no_other_who_is_told_so_and_counted(wire: Box) -> None:
    wire.join("7", catalogue=catalogue(["examples/labels/sniffer.py"]).offered)
    specify(wire, "7", SNIFFS.format(export="export gas-level").rstrip() + " to 1, cc\n")
    for unit in ("1", "2"):
        joins(wire, unit, IN_PPM)
        specify(wire, unit, IMPORTS)
    wire.centre("cc-17")
    wire.run(3.0)
    assert queried(wire, "1").performatives == [P.INFORM]
    assert queried(wire, "cc-17").performatives == [P.INFORM]
    before = refused(wire, "no receiver")
    asked, shared = queried(wire, "2"), streamed(wire, "2", "2")
    assert asked.reason == shared.reason == "7 exports gas-level to 1, cc, and to no other"
    assert asked.contents[0].code == "no-receiver"
    assert refused(wire, "no receiver") == before + 2
    streams = {unit: len(wire.platform(unit).built.gateway.importer.imports.streams) for unit in ("1", "2")}
    assert streams == {"1": 1, "2": 0}
    assert len(wire.acts("2", "7", "create-multicast")) == 1, "who is not meant does not ask by itself"


def test_a_stream_ends_for_who_is_meant_no_longer_and_the_reason_is_told(wire: Box) -> None:
    sniffing(wire)
    joins(wire, "8", IN_PPM)
    asked = streamed(wire, "8", "8")
    wire.run(2.0)
    before = wire.samples("7")
    assert before
    specify(wire, "7", f"{SNIFFS.format(export='export gas-level').rstrip()} to 1\n")
    assert asked.performatives == [P.AGREE, P.INFORM, P.FAILURE]
    assert asked.reason == "7 exports gas-level to 1, and to no other"
    before = wire.samples("7")
    wire.run(2.0)
    assert wire.samples("7") == before
    assert wire.platform("8").built.gateway.importer.imports.streams == {}
    assert wire.platform("7").built.tasks.all() == []


# -- hostile definitions -----------------------------------------------------------------------------------------


def definition(label: str = "gas-level", **other: Any) -> dict[str, Any]:
    return {"label": label, "sort": "gas", "unit": "ppm", "meaning": "gas in the air", **other}


def says(wire: Box, unit: str, *definitions: object, by: int = 1) -> None:
    """A member under its own name tells what it means; `by` is how much newer that is than what is true."""
    about = wire.platform(unit).ports.directory.description()
    told = about.model_dump() | {"version": about.version + by, "definitions": definitions}
    wire.put(keys.announcement(unit), pack((VERSION, told)))
    wire.run(0.05)


DEEP: Any = "ppm"
for _ in range(40):
    DEEP = [DEEP]


@pytest.mark.parametrize(
    "definitions",
    [
        pytest.param([definition(f"gas-{number}") for number in range(MAX_DEFINITIONS + 1)], id="too many"),
        pytest.param([definition(meaning="a" * 100_000)], id="a meaning of 100 kB"),
        pytest.param([definition(unit="", fields=[(f"a{n}", "m") for n in range(1000)])], id="1000 fields"),
        pytest.param([definition(unit="p" * 1000)], id="a unit of 1 kB"),
        pytest.param([definition("a" * 10_000)], id="a name of 10 kB"),
        pytest.param([definition(meaning="gas\x1b[2J")], id="control characters in the meaning"),
        pytest.param([definition(meaning="gas\u202e")], id="text direction in the meaning"),
        pytest.param([definition(meaning=" ")], id="no meaning"),
        pytest.param([definition("gas\n")], id="a line in the name"),
        pytest.param([definition(sort="gas\x07")], id="a bell in the sort"),
        pytest.param([definition(unit="pp\x9bm")], id="control characters in the unit"),
        pytest.param([definition(unit="", fields=[("a\x1b", "m")])], id="control characters in a field"),
        pytest.param([definition(unit="", fields=[("a", "m"), ("a", "km")])], id="one field twice"),
        pytest.param([definition(unit="")], id="neither unit nor fields"),
        pytest.param([definition(unit=math.nan)], id="no number as a unit"),
        pytest.param([definition(unit=DEEP)], id="nested"),
        pytest.param([definition(unit=None)], id="nothing as a unit"),
        pytest.param([definition(factor=math.inf)], id="a key that is none"),
        pytest.param([definition(), definition(unit="percent")], id="two definitions of one label"),
        pytest.param([definition(fields=[("a", "m")])], id="unit and fields"),
        pytest.param(["gas"], id="a word"),
        pytest.param({"gas": "ppm"}, id="a table"),
    ],
)
def test_a_definition_that_is_none_is_refused_and_counted_and_what_was_said_before_stands(
    wire: Box, definitions: Any
) -> None:
    sniffing(wire)
    joins(wire, "8", IN_PPM)
    known = wire.platform("8").ports.directory.entry("7")
    assert known.definitions == {"gas-level": GAS}
    counts = wire.platform("8").ports.directory.refused.copy()
    says(wire, "7", *definitions) if isinstance(definitions, list) else says(wire, "7", definitions)
    assert wire.platform("8").ports.directory.refused - counts, "counted"
    assert wire.platform("8").ports.directory.entry("7").definitions == {"gas-level": GAS}
    assert queried(wire, "8").performatives == [P.INFORM]


def test_who_redefines_what_is_built_in_loses_that_label_and_nobody_else_does(wire: Box) -> None:
    for number, unit in enumerate(("0", "1", "2")):
        wire.fly(unit, 0.0, 300.0 * number)
    wire.run(2.0)
    altitude = {"label": "heli-altitude", "sort": "altitude", "fields": [("altitude_ft", "ft")], "meaning": "how high"}
    says(wire, "2", altitude)

    def asked(by: str, unit: str, label: str) -> list[Performative]:
        return wire.asked(by, unit, Query(semantic_label=label), P.QUERY_REF).performatives

    assert asked("2", "0", "heli-altitude") == [P.REFUSE]
    assert asked("2", "0", "heli-position") == [P.INFORM]
    assert asked("1", "0", "heli-altitude") == [P.INFORM]
    wire.run(1.5)
    [told] = conditions(wire, "1", "0")
    assert "heli-altitude is not shared with 2" in told
    assert "built in" in told


def test_who_changes_its_mind_without_end_makes_nobody_speak_without_end(wire: Box) -> None:
    sniffing(wire)
    joins(wire, "8", IN_PPM)
    before = wire.platform("8").ports.directory.description().version
    for turn in range(200):
        words = [definition(f"gas-{n}", meaning=f"gas {turn}") for n in range(20)]
        says(wire, "7", definition(meaning=f"gas {turn}"), *words, by=turn + 1)
    assert wire.platform("8").ports.directory.description().version - before <= 15, "ten seconds, about one a second"
    assert len([each for each in wire.nodes["8"].notes if each.startswith("label ")]) <= 64
    assert len(conditions(wire, "7", "8")) == 1
    assert all(len(each) <= 200 for each in conditions(wire, "7", "8"))


def test_a_stream_under_another_definition_than_it_says_is_refused(wire: Box) -> None:
    """It says what we say, and offers something else."""
    sniffing(wire)
    joins(wire, "8", IN_PPM)
    about = wire.platform("7").ports.directory.description()
    told = about.model_dump() | {"version": about.version + 1}
    told["labels"] = [each | {"type_hash": "00000000"} for each in told["labels"] if each["label"] == "gas-level"]
    wire.put(keys.announcement("7"), pack((VERSION, told)))
    wire.run(1.5)
    [why] = conditions(wire, "7", "8")
    assert "it offers a stream of another definition, which it does not give" in why
