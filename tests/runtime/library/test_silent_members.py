"""A member that describes nothing, or names members that are not there, holds up a program's first questions alone."""

from dyknow.federation.members.command_centre import PATIENT_US
from dyknow.runtime.client import Client, command_centre
from dyknow.runtime.configuration.settings import Settings
from dyknow.runtime.library import jobs
from dyknow.runtime.library.questions import Which
from tests.box import Box, Vehicle
from tests.federation.members.test_one_liar import Liar


def test_one_that_is_silent_and_names_others_that_are_not_there_is_not_waited_for_again_and_again() -> None:
    box = Box()
    for number in range(3):
        box.join(str(number), Vehicle(north_m=100.0 * number))
    box.run(1.0)
    liar = Liar(box)  # type: ignore[arg-type]
    liar.beat(("0", "1", "2"))
    took_us, since_us = list[int](), box.now_us
    with Client(box.client_ports(), command_centre(Settings(), "cc-9")) as client:
        for number in range(20):
            liar.beat((f"invented-{number}", f"more-{number}"))
            began_us = box.now_us
            result = client.run(jobs.query(client, "heli-position", "0", Which(), "2s"))
            assert [each.unit for each in result] == ["0"]
            if began_us > since_us + PATIENT_US:
                took_us.append(box.now_us - began_us)
    assert len(took_us) > 10
    assert max(took_us) < 50_000


def test_a_newcomer_is_waited_for_however_long_the_others_are_known() -> None:
    box = Box()
    box.join("0", Vehicle())
    box.run(1.0)
    with Client(box.client_ports(), command_centre(Settings(), "cc-9")) as client:
        client.run(jobs.platforms(client))
        client.wait_for(lambda: False, 10.0)
        box.join("1", Vehicle(north_m=100.0))
        client.wait_for(lambda: len(client.centre.platforms()) == 2, 5.0)
        there = client.run(jobs.platforms(client))
        assert all(view.entry is not None and view.entry.version for view in there)
        assert {view.unit for view in there} == {"0", "1"}
