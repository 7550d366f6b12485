"""Objects that links make of percepts, on platforms: members of domains, shared with others, listed, and explained."""

from dyknow.agents.effects import Fed
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import ObjectEvents, ObjectList
from tests.agents.specification.test_specification_part import Pair

OBJECT = (
    "world-object(symbol in text, x_m in m, y_m in m, vx_m_s in m/s, vy_m_s in m/s, colour in text, anchored in bool, "
    "end in bool)"
)
LINKS = f"""
label seen-objects : {OBJECT} "objects in the world that a platform sees"
sort vision-object(symbol in text, x_m in m, y_m in m, colour in text, end in bool)
source vision-object camera
compunit world-object WorldObject(vision-object)
strmgen percepts = camera
strmgen world = link(percepts, WorldObject,
  eventually [1000, oo] true, eventually [0, 1000] xy_dist[from, to] < thresh, true)
for o in world.objects stream x = world.x_m[o]
monitor slow = always forall o in world: speed[o] < 15
export seen-objects = world
"""
IMPORTS = f"""
label seen-objects : {OBJECT} "objects in the world that a platform sees"
import seen-objects from 0 as theirs with max delay 1s
stream there = theirs.objects
monitor calm = always forall o in theirs: speed[o] < 15
"""


class Sight(Pair):
    """A camera that sees one car in turns of three seconds, with two between."""

    def drive(self, seconds, speed_m_s=10.0):
        begin_us = self.world.now_us
        for k in range(round(seconds * 10)):
            at_s, node = k / 10, self.world.nodes["0"]
            track, phase_s = divmod(at_s, 5.0)
            if phase_s < 3.05:
                state = (f"vp{track:.0f}", at_s * speed_m_s, 0.0, "red", phase_s > 2.95)
                self.world._reach(node, Fed(self.world.now_us, "camera", begin_us + k * 100_000, state))
            self.world.run_for(0.1)

    def ask(self, content):
        if "cc" not in self.world.nodes:
            self.world.add_command_centre("cc")
            self.world.run_for(1)
        dialogue = self.world.ask("cc", "0", content, Performative.QUERY_REF)
        self.world.run_for(0.5)
        return dialogue.results


def test_linked_objects_are_a_domain_of_the_platform_and_of_those_it_shares_them_with():
    sight = Sight(LINKS, IMPORTS)
    sight.world.run_for(2)
    sight.drive(8)
    assert sight.notes("0") == sight.notes("1") == []
    named = [each["value"] for each in sight.told("1", "sample") if each["stream"] == "there"]
    assert [value for value in named if value] == [["wo1"]]
    assert len([each for each in sight.told("0", "sample") if each["stream"] == "x-wo1"]) > 60


def test_monitors_over_linked_objects_alarm_here_and_there():
    sight = Sight(LINKS, IMPORTS)
    sight.world.run_for(2)
    sight.drive(4, 20.0)
    sight.world.run_for(1)
    assert [each["monitor"] for each in sight.told("0", "alarm-opened")] == ["slow"]
    assert [each["monitor"] for each in sight.told("1", "alarm-opened")] == ["calm"]


def test_an_object_is_listed_and_explained_with_all_its_links():
    sight = Sight(LINKS, IMPORTS)
    sight.world.run_for(2)
    sight.drive(8)
    (listed,) = sight.ask(ObjectList(type="world-object"))
    (found,) = listed.objects
    assert (found.symbol, found.type, found.stream) == ("wo1", "world-object", "world")
    (explained,) = sight.ask(ObjectEvents(symbol="wo1"))
    assert [(each.event, each.source) for each in explained.events] == [
        ("established", "vp0"),
        ("unlinked", "vp0"),
        ("reestablished", "vp1"),
        ("unlinked", "vp1"),
    ]
    assert "xy_dist[from, to] < thresh" in explained.events[2].because


def test_objects_of_every_level_are_listed_while_only_the_highest_is_wanted():
    above = """
strmgen cars = link(world, WorldObject, eventually [500, oo] true, false, true)
for c in cars.objects stream x = cars.x_m[c]
"""
    declared = "compunit world-object WorldObject(vision-object)\n"
    links = LINKS[: LINKS.index("for o in")].replace(declared, "") + above
    sight = Sight(links, "")
    sight.world.run_for(2)
    sight.drive(2.5)
    (listed,) = sight.ask(ObjectList())
    assert {(each.stream, each.symbol) for each in listed.objects} >= {("world", "wo1"), ("cars", "co1")}
    (world,) = sight.ask(ObjectList(type="world"))[0].objects
    assert world.attributes["x_m"] > 15.0
    sight.world.run_for(35)
    assert {each.stream for said in sight.ask(ObjectList()) for each in said.objects or ()} <= {"percepts"}


def test_a_forgotten_object_leaves_the_domain_wherever_it_is_known():
    sight = Sight(LINKS, IMPORTS)
    sight.world.run_for(2)
    sight.drive(3.2)
    sight.world.run_for(35)
    named = [each["value"] for each in sight.told("1", "sample") if each["stream"] == "there"]
    assert named[-1] == []
    assert "x-wo1" not in sight.declared("0").instance.streams


def test_where_an_object_may_be_that_is_hidden_in_a_crossing_is_listed_with_the_weights_of_its_ways() -> None:
    from dyknow.agents.specification.object_queries import _branches
    from dyknow.anchoring.links.objects import LinkObject
    from dyknow.anchoring.links.prediction import Hypothesis, ObjectPrediction
    from dyknow.anchoring.links.states import ObjectState, diagonal

    def on(link: str, weight: float) -> Hypothesis:
        return Hypothesis(ObjectState(0, 0.0, 0.0, 0.0, 0.0, diagonal(1.0, 1.0), {"route": link}), weight)

    one = LinkObject("co1", "car", 0, on("e1", 1.0).state)
    assert not _branches(one), "it is seen"
    one.expect(ObjectPrediction((on("e1", 0.5), on("e2", 0.3), on("e1", 0.2))))
    assert _branches(one) == "e1 0.70, e2 0.30"
