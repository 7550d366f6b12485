"""One platform that answers for all, its derived streams, and its directory as it changes."""

import pytest

from tests.live.command_line.command import Dyknow, lines

pytestmark = pytest.mark.live


def test_one_platform_answers_for_all_and_its_directory_is_followed(dyknow: Dyknow) -> None:
    dyknow.run("up", "2", "--scenario", "hover", "--detach")
    assert {each["unit"] for each in dyknow.run("query", "heli-altitude", "--via", "1")} == {0, 1}
    [mean] = dyknow.run("query", "heli-altitude", "--via", "1", "--merge", "mean")
    assert (mean["units"], mean["merge"]) == ([0, 1], "mean")
    [newest] = dyknow.run("query", "heli-altitude", "--via", "1", "--select", "newest")
    assert newest["unit"] in {0, 1}
    _, err = dyknow.raw("query", "heli-altitude", "--via", "1", "--unit", "0", code=2)
    assert "give it without --unit" in err
    [distance] = dyknow.run("query", "xy_dist[0, 1]", "--unit", "0")
    assert distance["unit"] == 0
    assert 0 < distance["value"]["value"] < 1000

    followed = dyknow.start("ls", "--follow", "--json")
    said = lines(followed)
    assert [next(said)["unit"] for _ in range(2)] == [0, 1]
    dyknow.run("up", "3", "--scenario", "hover", "--detach")
    appeared = next(line for line in said if line.get("unit") == 2)
    assert (appeared["event"], appeared["by"]) == ("platform-appeared", 0)
    label = next(line for line in said if line.get("event") == "label-appeared" and line["what"] == "heli-altitude")
    assert label["unit"] == 2
