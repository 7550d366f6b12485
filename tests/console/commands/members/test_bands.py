"""`dyknow bands` against platforms on a fake wire: each band is what flying it on, instant by instant, shows."""

from collections.abc import Callable
from math import cos, hypot, radians, sin
from typing import Any

import pytest

from dyknow.console.centre import client
from dyknow.console.command import Call
from dyknow.console.commands.members.bands import bands
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import Output
from dyknow.model.errors import NothingFound, WrongCall
from dyknow.runtime.client import Client, command_centre
from dyknow.runtime.configuration.settings import Settings
from dyknow.runtime.library.pictures.bands import bands as asked_bands
from tests.agents.capabilities.traffic.heard import Straight, listen
from tests.box import EPOCH, Box

Lines = Callable[[], list[dict[str, Any]]]
D_M, Z_M, T_S = 12.0, 8.0, 6.0
PLACES = {"0": (-60.0, 0.0, 5.0), "1": (60.0, 3.0, -5.0), "2": (20.0, 70.0, 0.0)}
"""Metres north and east of the beginning, metres a second north; all as high."""


def is_lost(x: float, y: float, z: float, vx: float, vy: float, vz: float) -> bool:
    """Whether well clear is lost at this instant, as design and reference define it; relative position and velocity."""
    closing = x * vx + y * vy
    range_m, speed_2 = hypot(x, y), vx * vx + vy * vy
    level = range_m <= D_M
    if not level and closing < 0.0:
        at_s = -closing / speed_2
        level = hypot(x + vx * at_s, y + vy * at_s) <= D_M and (D_M**2 - range_m**2) / closing <= T_S
    return level and (abs(z) <= Z_M or (vz != 0.0 and 0.0 <= -z / vz <= T_S))


def loses(at_s: float, velocity: tuple[float, float], up_m: float = 0.0, lookahead_s: float = 30.0) -> float | None:
    """When vehicle 0, flown so from an instant on, loses well clear of any other one; None: it does not."""
    north, east, north_m_s = PLACES["0"]
    for step in range(round(lookahead_s / 0.02)):
        t = step * 0.02
        for other in ("1", "2"):
            there_m, across_m, speed = PLACES[other]
            x = there_m + speed * (at_s + t) - (north + north_m_s * at_s + velocity[0] * t)
            y = across_m - (east + velocity[1] * t)
            if is_lost(x, y, -up_m, speed - velocity[0], -velocity[1], 0.0):
                return t
    return None


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> Box:
    found = Box()
    for unit, place in PLACES.items():
        found.fly(unit, *place)
    monkeypatch.setattr(client, "_client_ports", lambda _call: found.client_ports())
    found.run(2.0)
    return found


def ask(call: Call, unit: str = "0", **given: Any) -> int:
    options: dict[str, Any] = {"lookahead": "30s", "profile": "well-clear", "follow": False, "count": None}
    return bands(call, unit=unit, **{**options, **given})


def verdict(listed: list[dict[str, Any]], value: float, margin: float) -> bool | None:
    """Whether a value keeps well clear; None near an end of a band, where steps and errors of measurement decide."""
    band = next(each for each in listed if each["low"] <= value <= each["high"])
    is_inside = band["low"] + margin <= value <= band["high"] - margin
    return bool(band["clear"]) if is_inside else None


def test_the_bands_of_two_that_converge_are_what_flying_them_shows(world: Box, call: Call, lines: Lines) -> None:
    assert ask(call) == DONE
    [shown] = lines()
    at_s = (shown["at_us"] - EPOCH) / 1e6
    judged = [
        is_clear == (loses(at_s, (5.0 * cos(radians(track)), 5.0 * sin(radians(track)))) is None)
        for track in range(2, 360, 3)
        if (is_clear := verdict(shown["tracks_deg"], track, 2.0)) is not None
    ]
    judged += [
        is_clear == (loses(at_s, (speed, 0.0)) is None)
        for speed in (tenths / 10 for tenths in range(3, 195, 7))
        if (is_clear := verdict(shown["speeds_m_s"], speed, 0.6)) is not None
    ]
    judged += [
        is_clear == (loses(at_s, (5.0, 0.0), up_m) is None)
        for up_m in range(-45, 46, 3)
        if (is_clear := verdict(shown["altitudes_m"], shown["altitude_m"] + up_m, 1.1)) is not None
    ]
    assert all(judged)
    assert len(judged) > 140
    assert {band["clear"] for band in shown["tracks_deg"]} == {True, False}
    assert {band["clear"] for band in shown["altitudes_m"]} == {True, False}


def test_of_each_other_one_it_says_when_well_clear_is_lost_and_how_near_it_passes(
    world: Box, call: Call, lines: Lines
) -> None:
    assert ask(call) == DONE
    [shown] = lines()
    at_s = (shown["at_us"] - EPOCH) / 1e6
    first, second = shown["others"]
    assert (first["unit"], first["is_clear"]) == (1, False)
    assert first["loses_in_s"] == pytest.approx(loses(at_s, (5.0, 0.0)), abs=0.1)
    assert first["passes_in_s"] == pytest.approx(12.0 - at_s, abs=0.1)
    assert first["passes_m"] == pytest.approx(3.0, abs=0.5)
    assert first["passes_above_m"] == pytest.approx(0.0, abs=0.5)
    assert (second["unit"], second["is_clear"], second["loses_in_s"]) == (2, True, None)
    assert second["passes_m"] == pytest.approx(70.0, abs=0.5)
    assert 0 <= first["age_us"] < 300_000


def test_what_is_old_or_gone_is_unknown_and_in_no_band(world: Box, call: Call, lines: Lines) -> None:
    world.vehicle("1").is_silent = True
    world.run(3.5)
    assert ask(call) == DONE
    [shown] = lines()
    [silent] = [each for each in shown["others"] if each["unit"] == 1]
    assert (silent["is_clear"], silent["loses_in_s"], silent["apart_m"]) == (None, None, None)
    assert "old" in silent["why"]
    assert verdict(shown["tracks_deg"], 5.0, 1.0), "it is in no band"
    world.kill("1")
    world.run(4.0)
    assert ask(call) == DONE
    [gone] = [each for each in lines()[0]["others"] if each["unit"] == 1]
    assert gone["why"].startswith("gone ")


def test_without_its_own_motion_all_is_unknown(world: Box, call: Call, lines: Lines) -> None:
    world.vehicle("0").is_silent = True
    world.run(4.0)
    assert ask(call) == NO
    [shown] = lines()
    assert "old" in shown["why"]
    assert (shown["tracks_deg"], shown["altitudes_m"], shown["track_deg"]) == ([], [], None)


def test_one_that_hovers_has_no_track_and_its_tracks_are_tried_at_a_speed(world: Box, call: Call, lines: Lines) -> None:
    assert ask(call, "2") == DONE
    [shown] = lines()
    assert (shown["track_deg"], shown["tried_at_m_s"], shown["speeds_m_s"]) == (None, 5.0, [])
    assert {band["clear"] for band in shown["tracks_deg"]} == {True, False}


def test_aircraft_that_are_no_members_are_kept_farther_away(world: Box, call: Call, lines: Lines) -> None:
    listen(world, "0", 3.0, Straight(east_m=3000.0, east_m_s=-60.0, altitude_m=100.0), begun_us=world.now_us)
    assert ask(call) == DONE
    [shown] = lines()
    [aircraft] = [each for each in shown["others"] if each["kind"] == "aircraft"]
    assert (aircraft["unit"], aircraft["is_clear"]) == ("adsb-4ca123", False)
    assert aircraft["loses_in_s"] == pytest.approx((aircraft["apart_m"] - 609.6) / 60.0, abs=2.0)
    assert [band["clear"] for band in shown["altitudes_m"]] == [False]


def test_it_is_shown_again_every_second_as_a_table(world: Box, capsys: pytest.CaptureFixture[str]) -> None:
    began_us = world.now_us
    assert ask(Call(Settings(federation="test"), Output(json_lines=False)), follow=True, count=2) == DONE
    shown = capsys.readouterr().out
    assert shown.count("loses well clear") == 2
    assert "lost in" in shown
    assert "clear" in shown
    assert world.now_us - began_us >= 1_000_000


@pytest.mark.parametrize(
    ("given", "error"),
    [
        ({"profile": "energy"}, WrongCall),
        ({"profile": "well-claer"}, WrongCall),
        ({"lookahead": "soon"}, WrongCall),
        ({"unit": "7"}, NothingFound),
    ],
)
def test_what_cannot_be_is_refused(world: Box, call: Call, given: dict[str, Any], error: type[Exception]) -> None:
    with pytest.raises(error):
        ask(call, **given)


def test_a_program_gets_the_same(world: Box) -> None:
    with Client(world.client_ports(), command_centre(Settings(), "cc-9")) as program:
        picture = program.run(asked_bands(program, "0"))
    assert [row.unit for row in picture.others] == ["1", "2"]
    assert picture.tracks[0].low == 0.0
    assert picture.tracks[-1].high == 360.0
    assert {type(bound) for band in picture.altitudes for bound in band[:2]} == {float}
    assert not picture.why
