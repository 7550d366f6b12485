"""A platform that asks all others for a member, and what it may ask for that member (thesis 9.3.3)."""

from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Answers, Query
from tests.agents.specification.test_specification_part import Pair, text_of


def test_a_platform_does_not_hand_on_what_another_exports_to_it_alone():
    exports = text_of("uav1.kpl").replace("export heli-position = pos[self]", "export heli-position = pos[self] to 0")
    pair = Pair(text_of("uav0.kpl"), exports)
    pair.world.add_command_centre()
    pair.world.run_for(5)
    asked = {
        label: pair.world.ask("cc", "0", Query(semantic_label=label, scope="global"), Performative.QUERY_REF)
        for label in ("heli-position", "heli-altitude")
    }
    pair.world.run_for(3)
    answers = {label: dialogue.results[0] for label, dialogue in asked.items()}
    assert all(isinstance(each, Answers) for each in answers.values())
    assert {each.unit for each in answers["heli-altitude"].answers} == {"0", "1"}
    assert {each.unit for each in answers["heli-position"].answers} == {"0"}
    (missing,) = answers["heli-position"].missing
    assert (missing.unit, missing.reason) == ("1", "heli-position is exported to others, not to cc")
