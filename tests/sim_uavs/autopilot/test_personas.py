"""What real autopilots did with orders, done by the simulated ones; and what a platform's pilot makes of it."""

import pytest

from dyknow.agents.capabilities.flight.errand import Errand, OrderProgress
from dyknow.model.errors import Refused
from dyknow.sim_uavs.dynamics.flight import Mode
from dyknow.sim_uavs.dynamics.missions import Item, MissionAction
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from dyknow.sim_uavs.dynamics.settings import PersonaName
from tests.sim_uavs.piloted import Piloted

P = OrderProgress
ALL = pytest.mark.parametrize("persona", ["ardupilot", "ardupilot-3.3", "px4"])
MODERN = pytest.mark.parametrize("persona", ["ardupilot", "px4"])


def diversion(flown: Piloted) -> Errand:
    assert flown.pilot.diversion is not None
    return flown.pilot.diversion


def kinds(flown: Piloted) -> list[str]:
    return [message.get_type() for message in flown.sent]


@ALL
def test_an_order_is_seen_in_target_or_motion_within_two_seconds(persona: PersonaName) -> None:
    flown = Piloted(persona)
    flown.divert(75.0)
    assert flown.until(lambda: diversion(flown).progress is P.FLOWN) < 2.0
    flown.until(lambda: flown.height_m > 74.0)
    assert diversion(flown).progress is P.FLOWN


def test_an_old_autopilot_is_told_points_and_modes_in_the_way_it_understands() -> None:
    flown = Piloted("ardupilot-3.3")
    flown.goto(60.0)
    flown.until(lambda: flown.flight.body.position.north > 50.0)
    assert kinds(flown)[:2] == ["COMMAND_INT", "SET_POSITION_TARGET_GLOBAL_INT"]
    assert flown.pilot.errand is not None
    assert flown.pilot.errand.words == "seen in the vehicle's motion"
    flown.goto(0.0)
    flown.run(0.1)
    assert kinds(flown).count("COMMAND_INT") == 1, "what it does not understand is not said to it again"


def test_an_old_autopilot_that_tells_no_home_is_commanded_by_its_height_over_it() -> None:
    flown = Piloted("ardupilot-3.3")
    assert flown.pilot.bounds.home is None
    flown.goto(60.0)
    with pytest.raises(Refused, match="above the ceiling"):
        flown.goto(60.0, 130.0)


@MODERN
def test_the_fence_of_the_autopilot_is_read_and_kept(persona: PersonaName) -> None:
    read = Piloted(persona, fence_m=60.0)
    with pytest.raises(Refused, match="the autopilot's fence of 60 m"):
        read.divert(75.0)
    read.divert(57.0)


@MODERN
def test_a_climb_that_the_autopilots_unread_fence_forbids_is_refused_with_its_word(persona: PersonaName) -> None:
    flown = Piloted(persona, asks=False)
    flown.settings.fence_highest_m, flown.settings.fence_on = 60.0, 1.0
    flown.divert(75.0)
    flown.run(0.1)
    if persona == "px4":
        assert diversion(flown).progress is P.ACKNOWLEDGED, "its navigator refuses in words only"
        flown.run(2.0)
        assert diversion(flown).progress is P.UNSEEN
        assert diversion(flown).reason.endswith("the autopilot says: Reposition is outside geofence")
        return
    words = "autopilot: failed: Refused: outside the fence"
    assert (diversion(flown).progress, diversion(flown).reason) == (P.REFUSED, words)
    before = len(flown.sent)
    flown.run(10.0)
    assert len(flown.sent) == before, "it is not repeated"


@ALL
@pytest.mark.parametrize(("result", "word"), [(2, "denied"), (4, "failed")])
def test_a_refusal_reaches_the_diversion_at_once(persona: PersonaName, result: int, word: str) -> None:
    flown = Piloted(persona)
    flown.inject(f"refuse={result}")
    flown.divert(75.0)
    if persona == "ardupilot-3.3":
        flown.run(2.1)
        assert diversion(flown).progress is P.UNSEEN, "nothing acknowledges its way of saying it"
    else:
        assert diversion(flown).reason == f"autopilot: {word}"
    assert any(note.startswith("goto") for note in flown.notes)


def test_a_temporary_rejection_is_asked_again_and_given_up() -> None:
    flown = Piloted()
    flown.inject("refuse=1", 0.7)
    flown.divert(75.0)
    assert flown.until(lambda: diversion(flown).progress is P.FLOWN) < 2.0
    flown.inject("refuse=1")
    flown.divert(80.0)
    flown.run(3.0)
    assert diversion(flown).reason.startswith("autopilot: temporarily rejected")


@MODERN
@pytest.mark.parametrize("seed", range(10))
def test_with_a_third_of_the_acknowledgements_lost_an_order_is_flown(persona: PersonaName, seed: int) -> None:
    flown = Piloted(persona, seed=seed)
    flown.inject("ack-loss=30")
    for height_m in (75.0, 50.0, 75.0):
        flown.divert(height_m)
        assert flown.until(lambda: diversion(flown).progress is P.FLOWN) < 2.0


def test_without_any_acknowledgement_the_target_shows_the_order() -> None:
    flown = Piloted()
    flown.inject("ack-loss=100")
    flown.divert(75.0)
    assert flown.until(lambda: diversion(flown).progress is P.FLOWN) < 2.0
    assert not diversion(flown).acknowledged


def test_an_acknowledgement_that_is_late_belongs_to_its_order() -> None:
    flown = Piloted()
    flown.inject("ack-delay=0.4")
    flown.divert(75.0)
    flown.run(0.2)
    flown.settings.fence_highest_m, flown.settings.fence_on = 60.0, 1.0
    flown.divert(80.0)
    flown.run(0.3)
    assert diversion(flown).progress is P.SENT, "the first one's acknowledgement has come"
    flown.until(lambda: diversion(flown).progress is P.REFUSED, 2.0)


@ALL
def test_an_order_that_is_accepted_and_forgotten_is_not_seen(persona: PersonaName) -> None:
    flown = Piloted(persona)
    flown.inject("forget")
    flown.divert(75.0)
    assert flown.until(lambda: diversion(flown).progress in {P.UNSEEN, P.OVERTAKEN}) <= 2.1


@MODERN
def test_a_ground_station_that_streams_its_target_is_noticed_within_two_seconds(persona: PersonaName) -> None:
    flown = Piloted(persona)
    flown.goto(200.0)
    flown.run(5.0)
    flown.inject("stream-target=1")
    flown.run(1.5)
    flown.divert(75.0)
    assert flown.until(lambda: diversion(flown).progress is P.OVERTAKEN) < 2.1
    assert flown.pilot.resume() == [], "it flies there by the other's will"


def test_where_no_target_is_told_a_stream_of_targets_is_seen_in_the_motion() -> None:
    flown = Piloted("ardupilot-3.3")
    flown.goto(300.0)
    flown.run(5.0)
    flown.inject("stream-target=4")
    flown.run(1.0)
    flown.divert(75.0)
    flown.until(lambda: diversion(flown).progress is P.UNSEEN, 6.0)


@ALL
def test_a_pilot_who_takes_the_vehicle_keeps_it_and_nothing_is_sent_when_it_is_given_back(persona: PersonaName) -> None:
    flown = Piloted(persona)
    flown.goto(200.0)
    flown.run(3.0)
    flown.inject("takeover", 5.0)
    flown.until(lambda: flown.pilot.errand is not None and flown.pilot.errand.progress is P.OVERTAKEN, 2.0)
    before = len(flown.sent)
    flown.run(3.0)
    assert flown.flight.mode is Mode.LOITER
    flown.run(10.0)
    assert flown.flight.mode is Mode.GUIDED
    assert len(flown.sent) == before
    assert any("nothing is sent until you ask for it" in note for note in flown.notes)


@pytest.mark.parametrize("order", ["goto", "hold"])
def test_a_repetition_never_takes_a_px4_from_its_pilot(order: str) -> None:
    flown = Piloted("px4")
    flown.inject("ack-loss=100")
    if order == "goto":
        flown.goto(100.0)
    else:
        flown.divert(None)
    flown.run(0.2)
    flown.inject("takeover", 20.0)
    flown.run(6.0)
    assert flown.flight.mode is Mode.LOITER


@MODERN
@pytest.mark.parametrize("speed_m_s", [5.0, 10.0])
def test_a_vehicle_that_is_told_to_stop_does_not_fly_back(persona: PersonaName, speed_m_s: float) -> None:
    flown = Piloted(persona)
    flown.settings.cruise_m_s = speed_m_s
    flown.goto(900.0)
    flown.until(lambda: flown.flight.body.velocity.north > 0.95 * speed_m_s)
    flown.divert(75.0)
    slowest = 0.0
    for _ in range(200):
        flown.run(0.1)
        slowest = min(slowest, flown.flight.body.velocity.north)
    assert slowest > -0.5
    assert diversion(flown).progress is P.FLOWN


def on_mission(flown: Piloted) -> None:
    """Fly item 2 of a mission of three."""
    points = [Vector(north, 0.0, -50.0) for north in (0.0, 30.0, 300.0)]
    flown.flight.items = tuple(Item(MissionAction.FLY_TO, point) for point in points)
    flown.flight.set_item(1)
    flown.flight.set_mode(Mode.AUTO)
    flown.until(lambda: flown.flight.progress.item == 2)
    flown.run(2.0)


@MODERN
def test_a_mission_is_interrupted_only_by_permission_and_resumed_at_its_item(persona: PersonaName) -> None:
    flown = Piloted(persona)
    on_mission(flown)
    with pytest.raises(Refused, match="a guided mode is needed; --control auto"):
        flown.divert(75.0)
    flown.pilot.missions = True
    flown.divert(75.0)
    assert flown.until(lambda: diversion(flown).progress is P.FLOWN) < 2.0
    assert flown.flight.mode is Mode.GUIDED
    flown.command(flown.pilot.resume())
    flown.until(lambda: flown.flight.mode is Mode.AUTO, 5.0)
    flown.run(3.0)
    assert flown.flight.progress.item == 2
    flown.until(lambda: flown.flight.body.position.north > 290.0)


def test_a_pilot_who_stops_the_mission_meanwhile_is_not_flown_back_into_it() -> None:
    flown = Piloted()
    flown.pilot.missions = True
    on_mission(flown)
    flown.divert(75.0)
    flown.run(1.5)
    flown.inject("takeover", 3.0)
    flown.run(5.0)
    assert flown.flight.mode is Mode.GUIDED
    assert flown.pilot.resume() == []


@ALL
def test_an_autopilot_that_is_killed_says_and_obeys_nothing_and_falls(persona: PersonaName) -> None:
    flown = Piloted(persona)
    flown.goto(200.0)
    flown.run(3.0)
    flown.inject("killed")
    flown.run(5.0)
    assert flown.flight.body.on_ground
    with pytest.raises(Refused, match="no heartbeat for 5"):
        flown.goto(0.0)
