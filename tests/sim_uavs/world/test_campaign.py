"""Drawn flights that meet, judged by the true positions: the campaign of `bench/campaign`, and harmless ones of `bench/needless`.

Twenty seeds, spread over the thousand that `-m full` takes.
"""

import pytest

from bench.__main__ import measured
from bench.campaign.drawing import TROUBLES, situation
from bench.campaign.flying import FRAME, CampaignFlight
from bench.campaign.geometries import GEOMETRIES
from bench.campaign.running import LEAST_S, run
from bench.campaign.situations import AUTO, GOTO, HOVER, STATION, DrawnVehicle, Situation, Trouble, Way, are_apart
from bench.campaign.watching import LEAST_M, Watch
from bench.rows import Options
from dyknow.agents.places import FlightLimits
from dyknow.federation.messages.contents import MonitorProximity
from dyknow.navigation.fences import FenceKind, fence_refusal
from dyknow.sim_uavs.dynamics.flight import Mode
from dyknow.sim_uavs.dynamics.quadcopter import AirframeLimits, Vector, Wind
from dyknow.sim_uavs.dynamics.settings import PersonaName, VehicleSettings

SHORT = 20
SEEDS = [pytest.param(seed, marks=() if seed <= SHORT else pytest.mark.full) for seed in range(1, 1001)]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_drawn_flight_keeps_apart_or_tells_and_arrives_or_tells(seed: int) -> None:
    found = run(seed)
    assert found.lasted_s > LEAST_S - 1.0
    assert (found.breaches, found.untold, found.stuck, found.violations) == ([], [], [], []), found.what


def test_a_seed_is_a_run() -> None:
    first, again = run(2), run(2)
    assert (first.track, first.least_m, first.factors) == (again.track, again.least_m, again.factors)
    assert run(5).track != first.track


def head_on(kind: str) -> Situation:
    """Two at one height towards each other, as that order sends both, 12 s from where they meet."""
    ways = [Way(kind, (Vector(-60.0 * sign, 0.0, -40.0), Vector(70.0 * sign, 0.0, -40.0)), 5.0) for sign in (1.0, -1.0)]
    vehicles = tuple(
        DrawnVehicle(way, AirframeLimits(), VehicleSettings(cruise_m_s=5.0), FlightLimits()) for way in ways
    )
    return Situation(0, "head-on", vehicles, (), Wind())


@pytest.mark.parametrize(
    ("kind", "task", "found"),
    [
        (STATION, MonitorProximity(avoidance=False), "breaches"),
        (AUTO, None, "untold"),
        (AUTO, MonitorProximity(), "told"),
    ],
)
def test_two_that_pass_through_each_other_are_a_breach_if_they_could_be_commanded_and_else_told_or_not(
    kind: str, task: MonitorProximity | None, found: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if task is None:
        monkeypatch.setattr(CampaignFlight, "_delegate", lambda _flight: None)
    else:
        monkeypatch.setattr("bench.campaign.flying.MonitorProximity", lambda: task)
    result = run(0, head_on(kind))
    assert result.least_m < LEAST_M
    assert [name for name in ("breaches", "untold", "told") if getattr(result, name)] == [found]
    assert len(getattr(result, found)) == 1
    assert result.factors == pytest.approx([1.0, 1.0], abs=0.1)


def test_a_vehicle_that_waits_for_ever_is_stuck_and_what_raises_is_a_violation(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.campaign.flying.CampaignFlight._send_to", waits_among_others)
    assert len(run(0, head_on(GOTO)).stuck) == 2
    monkeypatch.setattr("bench.campaign.watching.manoeuvre", lambda platform: platform.nothing)
    (violation,) = run(0, head_on(STATION)).violations
    assert violation.startswith("raised AttributeError")


def waits_among_others(flight: CampaignFlight, number: int, place: Vector) -> None:
    if flight.is_alone:
        flight.vehicles[number].flight.go_to(place.minus(flight.offsets[number]))


def hovering(trouble: Trouble, settings: VehicleSettings, persona: PersonaName, *, is_wired: bool) -> CampaignFlight:
    """Two that hover far apart, 10 s after setting out; the trouble and the settings are those of the first."""
    vehicles = tuple(
        DrawnVehicle(
            Way(HOVER, (Vector(north_m, 0.0, -40.0),), 5.0), AirframeLimits(), each, FlightLimits(), persona=persona
        )
        for north_m, each in ((0.0, settings), (300.0, VehicleSettings()))
    )
    flight = CampaignFlight(Situation(0, "hovering", vehicles, (trouble,), Wind(), is_wired))
    watch = Watch(flight)
    while flight.seconds() < 10.0:
        flight.world.run_for(0.1)
        watch.step()
    assert watch.violations == []
    return flight


@pytest.mark.parametrize("is_wired", [False, True])
@pytest.mark.parametrize(("persona", "action", "mode"), [("ardupilot", 1.0, Mode.RTL), ("px4", 3.0, Mode.LAND)])
@pytest.mark.parametrize(("kind", "fault"), [("process dies", ""), ("autopilot is silent", "silence")])
def test_a_vehicle_whose_process_dies_or_whose_link_is_cut_does_what_its_parameters_say(
    kind: str, fault: str, persona: PersonaName, action: float, mode: Mode, is_wired: bool
) -> None:
    settings = VehicleSettings(link_loss_action=action, link_loss_s=5.0, station_id=254.0)
    flight = hovering(Trouble(kind, 0, 2.0, None, fault=fault), settings, persona, is_wired=is_wired)
    assert [vehicle.flight.mode for vehicle in flight.vehicles] == [mode, Mode.GUIDED]


@pytest.mark.parametrize("is_wired", [False, True])
@pytest.mark.parametrize(
    ("clock", "ahead_us"), [((3_000_000, 0.0), 3_000_000), ((-3_000_000, 0.0), -3_000_000), ((0, 1_000.0), 8_000)]
)
def test_a_clock_begins_to_lie_in_flight(clock: tuple[int, float], ahead_us: int, is_wired: bool) -> None:
    flight = hovering(
        Trouble("clock begins to lie", 0, 2.0, None, clock=clock), VehicleSettings(), "ardupilot", is_wired=is_wired
    )
    now_us, node = flight.world.now_us, flight.world.nodes["0"]
    assert node.clock.node_us(now_us) - now_us == pytest.approx(ahead_us, abs=100)
    flight.world.run_for(10.0)
    assert not node.frozen
    flight.world.kill("0")
    flight.world.restart("0")
    assert node.clock.node_us(flight.world.now_us) - flight.world.now_us == clock[0], "UTC is wrong then as it was"


def test_areas_leave_a_vehicle_its_own_way_and_those_that_hem_it_in_are_few() -> None:
    drawn = [vehicle for seed in range(1, 401) for vehicle in situation(seed).vehicles]
    fenced = [vehicle for vehicle in drawn if vehicle.fence]
    for vehicle in fenced:
        places = [FRAME.from_ned(*place)[:2] for place in vehicle.way.places]
        for start, end in zip(places, places[1:] or places, strict=False):
            assert fence_refusal(vehicle.fence, start, end, margin_m=5.0) is None
    assert 0.05 < len(fenced) / len(drawn) < 0.25
    assert sum(vehicle.is_hemmed for vehicle in fenced) < len(fenced) / 3
    assert {area.kind for vehicle in fenced for area in vehicle.fence} == set(FenceKind)


def test_all_geometries_and_all_troubles_are_drawn_and_no_two_set_out_near_each_other() -> None:
    drawn = [situation(seed) for seed in range(1, 401)]
    assert {each.geometry for each in drawn} == set(GEOMETRIES)
    kinds = {trouble.kind for each in drawn for trouble in each.troubles}
    assert len(kinds) == len(TROUBLES) - 1, "those that refuse do so for a while or for good"
    assert 0.4 < sum(bool(each.troubles) for each in drawn) / len(drawn) < 0.6
    assert 0.4 < sum(each.is_wired for each in drawn) / len(drawn) < 0.6
    failsafes = {vehicle.failsafe for each in drawn for vehicle in each.vehicles}
    assert failsafes == {
        "",
        *(f"FS_GCS_ENABLE {at}" for at in range(1, 6)),
        *(f"NAV_DLL_ACT {at}" for at in range(1, 4)),
    }
    for each in drawn:
        assert are_apart([vehicle.way.start for vehicle in each.vehicles])
        assert 2 <= len(each.vehicles) <= 6
        assert all(
            11.0 < -place.down < 120.0 or place == vehicle.way.end
            for vehicle in each.vehicles
            for place in vehicle.way.places
        )


@pytest.mark.parametrize("row", ["b19", "b20", "b21"])
def test_its_rows_of_the_benchmark_run(row: str) -> None:
    found = measured(row, Options(rounds=1, effort=0.01))
    assert {bar["what"] for bar in found["bars"]}
