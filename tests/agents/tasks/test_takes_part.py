"""Which members are heard in a conversation: its two sides, and those that the task makes participants. All others are refused."""

import pytest

from dyknow.federation import keys
from dyknow.federation.members.command_centre import CommandCentre
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.contents import (
    Content,
    DivideArea,
    Done,
    EndStream,
    FlyMission,
    Hold,
    MonitorProximity,
    PermitMission,
    Progress,
    Reason,
    Stream,
)
from dyknow.federation.messages.protocols import OPENING
from tests.agents.rosters import trust
from tests.box import Box, Vehicle

P = Performative
AREA = ("58.40 15.60", "58.40 15.61", "58.41 15.61", "58.41 15.60")
ANSWERS = sorted(set(P) - OPENING - {P.CANCEL})
REFUSED = "not its conversation"


@pytest.fixture
def fed() -> Box:
    wire = Box(1)
    for unit in "012":
        wire.join(unit, Vehicle(north_m=3000.0 * int(unit)), trust=trust(unit), control=True)
    for unit in ("cc", "cd", "obs"):
        wire.centre(unit, trust=trust(unit))
    wire.run(2)
    return wire


def say(
    wire: Box, by: str, conversation: str | None, content: Content | None, performative: Performative = P.INFORM
) -> None:
    """A member says something to the command centre in a conversation."""

    def send(member, now_us):
        act = Act(
            performative, AgentName("interface", by), AgentName("interface", "cc"),
            None if content is None else content.expr(), conversation,
        )  # fmt: skip
        member.acts._handle(member.acts.conversations.send(act, now_us)[1], now_us)

    wire.speak(by, send)
    wire.run(0.05)


def centre(wire: Box) -> CommandCentre:
    process = wire.nodes["cc"].process
    assert isinstance(process, CommandCentre)
    return process


def steps(question, since: int = 0) -> list[tuple[str, str | None]]:
    return [(each.step, each.unit) for each in question.contents[since:] if isinstance(each, Progress)]


@pytest.mark.parametrize("performative", ANSWERS)
@pytest.mark.parametrize("by", ["1", "cd", "obs"])
def test_what_another_answers_is_not_believed(fed: Box, by: str, performative: Performative) -> None:
    fed.freeze("0")
    asked = fed.question("cc", "0", Hold(), within_us=60_000_000)
    contents = (Progress(step="done"), Progress(step="done", unit="0"), Done(), Reason(text="no"), None)
    for content in contents:
        say(fed, by, asked.conversation, content, performative)
    assert asked.answers == []
    assert asked.failed is None
    assert centre(fed).refused[REFUSED] == len(contents)
    assert not [act for act in fed.acts("cc", by) if act.performative is P.CANCEL], "it has begun nothing for us"
    fed.thaw("0")
    fed.run(2)
    assert P.INFORM in asked.performatives


@pytest.mark.parametrize("content", [MonitorProximity(), DivideArea(area=AREA)], ids=["monitors", "division"])
def test_a_participant_speaks_of_itself_and_others_not_at_all(fed: Box, content: Content) -> None:
    asked = fed.asked("cc", "0", content)
    fed.run(2)
    since = len(asked.answers)
    for by in ("cd", "obs"):
        for unit in (None, by, "0"):
            say(fed, by, asked.conversation, Progress(step="monitoring ended", unit=unit))
    say(fed, "1", asked.conversation, Progress(step="of the delegate", unit="0"))
    assert steps(asked, since) == []
    assert centre(fed).refused[REFUSED] == 7
    say(fed, "1", asked.conversation, Progress(step="of itself", unit="1"))
    assert steps(asked, since) == [("of itself", "1")]


def test_another_is_not_heard_when_the_delegate_is_gone_and_its_successor_is(fed: Box) -> None:
    asked = fed.asked("cc", "0", MonitorProximity())
    fed.run(2)
    fed.kill("0")
    fed.run(3)
    since = len(asked.answers)
    say(fed, "obs", asked.conversation, Progress(step="all is well", unit="1"))
    assert steps(asked, since) == []
    fed.run(8)
    say(fed, "1", asked.conversation, Progress(step="its monitor has stopped", unit="2"))
    assert steps(asked, since) == [("its monitor has stopped", "2")], "it coordinates, and reports of what others do"


def test_in_a_mission_those_are_heard_that_its_permit_names(fed: Box) -> None:
    for unit in "01":
        fed.asked("cc", unit, PermitMission(mission="m", leaders=("0", "1"), vehicles=("0", "1")))
    fed.freeze("0")
    asked = fed.question("cc", "0", FlyMission(mission="m", domain="x", problem="y"))
    centre(fed).follow(asked.dialogue, "m")
    since = len(asked.answers)
    for name in ("m", asked.conversation):
        for by in ("2", "cd", "obs"):
            say(fed, by, name, Progress(step="leads: the vehicle obeys", unit=by))
    assert steps(asked, since) == []
    assert centre(fed).refused[REFUSED] == 6
    say(fed, "1", "m", Progress(step="leads: the vehicle obeys 1", unit="1"))
    assert steps(asked, since) == [("leads: the vehicle obeys 1", "1")]


def test_a_stream_is_announced_and_ended_by_its_owner(fed: Box) -> None:
    imports = centre(fed).member.imports
    mine = Stream(owner="0", semantic_labels=("battery",), policy="sample every 1000", hash="ab12cd34")
    for by in ("1", "obs"):
        say(fed, by, None, mine)
    assert not imports.streams
    say(fed, "0", None, mine)
    assert len(imports.streams) == 1
    say(fed, "1", None, EndStream(owner="0", semantic_labels=("battery",), hash="ab12cd34"))
    assert len(imports.streams) == 1
    assert centre(fed).refused["not its stream"] == 3
    assert keys.EVERYBODY not in {name[0] for name in imports.streams}
