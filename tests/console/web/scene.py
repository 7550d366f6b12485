"""A federation to look at: platforms that fly circles, cars, an alarm, tasks, a mission with a question, speech acts.

`python -m tests.console.web.scene` takes the pictures of the documentation.
"""

import math
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from dyknow.console.picture.picture import Picture
from dyknow.console.web.feeds import RecordedFeed, RecordingViewer
from dyknow.console.web.views import LiveFeed
from dyknow.navigation.geodesy import metres_per_degree
from dyknow.runtime.recordings import foxglove
from dyknow.runtime.recordings import recording_file as kinds
from dyknow.runtime.recordings.recorded import FederationRecording

ORIGIN: Final = (58.4945, 15.1020)
FIGURES: Final = Path(__file__).parents[3] / "docs" / "figures"
RECORDING: Final = Path(__file__).parents[3] / "examples" / "recordings" / "encounter.mcap"
BEGIN_US: Final = 1_700_000_000_000_000
_NORTH_M, _EAST_M = metres_per_degree(ORIGIN[0])
_COLOURS = ("red", "blue", "green", "yellow", "white", "black")


class Scene:
    """Steps a feed by messages as a recorder has them."""

    def __init__(self, platforms: int, cars: int, names: Mapping[int, str] = {}) -> None:
        self.feed = LiveFeed("example", Picture(ORIGIN))
        self.units = [names.get(number, str(number)) for number in range(platforms)]
        self._cars = cars
        self.at_us = BEGIN_US
        for unit in self.units:
            labels = [
                {"label": each, "period_us": 100_000}
                for each in ("heli-position", "heli-altitude", "heli-velocity", "battery")
            ]
            self.put(
                kinds.PLATFORM, {"unit": unit, "state": "alive", "labels": labels, "services": [], "conditions": []}
            )

    def put(self, schema: str, message: Mapping[str, Any]) -> None:
        self.feed.now_us = self.at_us
        self.feed.add("", schema, message, self.at_us)

    def sample(self, unit: str, label: str, **value: Any) -> None:
        record = {"unit": unit, "label": label, "valid_us": self.at_us - 8_000, "value": value}
        self.feed.add("", kinds.SAMPLE, record, self.at_us)

    def step(self, seconds: float = 0.1) -> None:
        """Everybody flies and drives on."""
        self.at_us += round(seconds * 1e6)
        time_s = (self.at_us - BEGIN_US) / 1e6
        for number, unit in enumerate(self.units):
            self._fly(unit, number, time_s)
        for car in range(self._cars):
            self._drive(car, time_s)
        self.feed.now_us = self.at_us

    def _fly(self, unit: str, number: int, time_s: float) -> None:
        radius_m, turns = 60.0 + 35 * (number % 5), 0.05 * (1 if number % 2 else -1)
        angle = number * 2.4 + turns * time_s
        east, north = (
            70 * (number % 8) - 200 + radius_m * math.sin(angle),
            60 * (number // 8) + radius_m * math.cos(angle),
        )
        latitude, longitude = ORIGIN[0] + north / _NORTH_M, ORIGIN[1] + east / _EAST_M
        velocity = radius_m * turns * math.cos(angle), -radius_m * turns * math.sin(angle)
        self.sample(unit, "heli-position", latitude_deg=latitude, longitude_deg=longitude)
        self.sample(unit, "heli-altitude", altitude_m=60.0 + 4 * number + math.sin(time_s / 3))
        self.sample(
            unit, "heli-velocity", east_m_s=velocity[0], north_m_s=velocity[1], down_m_s=-math.cos(time_s / 3) / 3
        )
        self.sample(unit, "battery", fraction=max(0.05, 0.93 - 0.11 * number - time_s / 4000))

    def _drive(self, car: int, time_s: float) -> None:
        speed = 9.0 + car % 5
        x, y = -300 + (car * 47 + speed * time_s) % 600, -40.0 + 18 * (car % 9)
        self.sample(
            self.units[car % len(self.units)], "global-objects", symbol=f"car{car}", x_m=x, y_m=y, vx_m_s=speed, vy_m_s=0.0,
            sd_m=0.8 + car % 3, colour=_COLOURS[car % 6], by="" if car % 7 == 6 else self.units[0], anchored=True, end=False,
        )  # fmt: skip

    def opened(self, monitor: str, one: str, other: str, event: str = "opened") -> None:
        name = f"{monitor}/{one}-{other}"
        because = [f"xy_dist[{one}, {other}] >= 15.0 is false", f"z_dist[{one}, {other}] >= 10.0 is false"]
        values = {f"xy_dist[{one}, {other}]": 11.42, f"z_dist[{one}, {other}]": 4.0}
        alarm = {
            "id": name,
            "event": event,
            "monitor": monitor,
            "by": one,
            "units": [one, other],
            "valid_us": self.at_us,
        }
        self.put(kinds.ALARM, {**alarm, "values": values, "because": because})

    def monitor(self, by: str, name: str, other: str, shows: str, *which: str) -> None:
        entry = {"by": by, "monitor": name, "units": [by, other], "which": [*which], "shows": shows}
        self.put(kinds.MONITOR, {**entry, "verdict": "false" if shows == "alarm" else "undecided", "inputs": "fresh"})

    def act(self, by: str, peer: str, what: str, content: str, number: int) -> None:
        text = f"({what} :sender interface@{by} :receiver interface@{peer} :content {content} :conversation-id cc-{number})"
        for who, whom, way, outcome in ((by, peer, "out", "sent"), (peer, by, "in", "accepted")):
            log = {"by": who, "at_us": self.at_us, "direction": way, "peer": whom, "outcome": outcome, "act": text}
            self.put(kinds.ACT, log)

    def say(self, level: int, text: str) -> None:
        self.put(foxglove.LOG, foxglove.log_entry(self.at_us, level, text, ""))


def busy() -> Scene:
    """Eight platforms, six cars, and one of each thing that the page can show."""
    scene = Scene(8, 6)
    units = scene.units
    for turn in range(450):
        scene.step()
        if turn % 15 == 0:
            for number, unit in enumerate(units):
                other = units[(number + 1) % 8]
                shows = "alarm" if (number == 0 and turn > 400) or (number == 3 and 150 < turn < 230) else "ok"
                scene.monitor(unit, "proximity", other, "unknown" if number == 5 and turn > 380 else shows)
            entry = {"by": "2", "monitor": "slow", "units": ["2"], "which": [], "verdict": "undecided", "shows": "ok"}
            scene.put(kinds.MONITOR, {**entry, "margin": 6.0 + 5 * math.sin(turn / 60)})
            for to in range(8):
                imports = [
                    {"owner": units[(to + step) % 8], "semantic_label": label, "hash": label, "received": turn, "lost": 3 * (to == 5 and step == 1), "missing": 0, "delay_s": 0.008 + 0.004 * to}
                    for step in (1, 2)
                    for label in ("heli-position", "heli-altitude", "heli-velocity")
                ]  # fmt: skip
                scene.put(kinds.IMPORTS, {"by": units[to], "imports": imports})
        if turn == 150:
            scene.opened("proximity", "3", "4")
        if turn == 230:
            scene.opened("proximity", "3", "4", "closed")
        if turn in {150, 230}:
            scene.say(
                foxglove.ERROR if turn == 150 else foxglove.INFO,
                f"proximity of 3, 4 by 3 {'opened' if turn == 150 else 'closed'}",
            )
        if turn in {100, 260, 300, 390}:
            scene.act("cc-7", "0", "request", "(monitor-proximity profile: proximity)", turn)
            scene.step()
            scene.act("0", "cc-7", "agree", "(monitor-proximity)", turn)
            for unit in ("1", "2", "3"):
                scene.act("0", unit, "request", "(create-monitor name: proximity)", turn)
                scene.act(unit, "0", "inform", "(done)", turn)
    scene.act(
        "cc-7",
        "2",
        "request",
        f"(goto latitude_deg: {ORIGIN[0] + 0.0011} longitude_deg: {ORIGIN[1] - 0.0012} altitude_m: 80.0)",
        9,
    )
    scene.act("2", "cc-7", "refuse", "(goto)", 9)
    scene.act("1", "0", "propose", '(avoid alarm: "a" climber: 1 climb_m: 20.0 units: (sequence 0 1))', 10)
    scene.sample(
        "4", "camera-view", x1_m=20.0, y1_m=-60.0, x2_m=110.0, y2_m=-70.0, x3_m=140.0, y3_m=30.0, x4_m=0.0, y4_m=20.0
    )
    scene.sample("6", "camera-attention", symbol="car4", x_m=60.0, y_m=40.0, because="car4 was lost")
    scene.sample(
        "1",
        "believed-objects",
        symbol="w1",
        x_m=-120.0,
        y_m=90.0,
        vx_m_s=0.0,
        vy_m_s=0.0,
        existence=0.62,
        type="truck",
        end=False,
    )
    plans(scene)
    scene.opened("proximity", "0", "1")
    scene.say(foxglove.ERROR, "proximity of 0, 1 by 0 opened")
    scene.monitor("5", "proximity", "6", "unknown", "heli-position[6]")
    tasks = {
        "task": "monitor-proximity",
        "unit": "0",
        "state": "running",
        "delegator": "interface@cc-7",
        "since_us": BEGIN_US,
    }
    scene.put(
        kinds.TASK, {**tasks, "conversation": "cc-7-1a2b-1.0", "by": "0", "monitors": ["proximity", "proximity-warn"]}
    )
    scene.put(kinds.TASK, {**tasks, "conversation": "cc-7-1a2b-2.2", "by": "2", "task": "goto", "unit": "2"})
    question = {
        "number": 1, "text": "carrier1 was not found where it was dropped. Search farther, or leave it out of the plan?",
        "options": ["search", "leave it out", "abort"], "default": "search", "until_us": scene.at_us + 60_000_000,
    }  # fmt: skip
    actions = [
        "0 s  uav0: fly to depot  done",
        "12 s  uav0: attach carrier1  done",
        "15 s  uav0: carry carrier1 to pos3  acting",
        "40 s  uav1: take-off",
    ]
    mission = {
        "mission": "delivery-1",
        "conversation": "cc-7-1a2b-3.1",
        "phase": "asks",
        "since_us": BEGIN_US + 9_000_000,
    }
    scene.put(kinds.MISSIONS, {"by": "1", "missions": [{**mission, "actions": actions, "question": question}]})
    described = {
        "unit": "5",
        "state": "alive",
        "labels": [],
        "services": [],
        "conditions": ["avoidance off: mode LOITER"],
    }
    scene.put(kinds.PLATFORM, described)
    return scene


def place(east_m: float, north_m: float) -> str:
    """As platforms say it."""
    return f"{ORIGIN[0] + north_m / _NORTH_M:.7f} {ORIGIN[1] + east_m / _EAST_M:.7f}"


def plans(scene: Scene) -> None:
    """Where vehicles will fly: a route, an object that is followed, giving way; and within what."""
    limits = {"name": "limits", "centre": place(0, 0), "radius_m": 420.0, "lowest_m": 10.0, "highest_m": 120.0}
    field = {"name": "field", "corners": [place(-350, -210), place(330, -210), place(330, 230), place(-350, 230)]}
    ahead = [place(240, 160), place(60, 200), place(-140, 180)]
    for unit, said in {
        "1": {
            "commander": "avoidance",
            "doing": "gives way: hold at 84 m",
            "ahead": [place(-110, 40)],
            "altitude_m": 84.0,
        },
        "3": {"commander": "route", "doing": "flies its route, place 1 of 3", "ahead": ahead, "again": True},
        "5": {"commander": "order", "doing": "follows car3", "ahead": []},
    }.items():
        scene.put(kinds.FLIGHTS, {"by": unit, "fences": [limits, field], **said})
    for branch, y_m, weight in (("straight on", -130.0, 0.7), ("left", -80.0, 0.3)):
        value = {"symbol": "van1", "x_m": 200.0, "y_m": y_m, "vx_m_s": 9.0, "vy_m_s": 0.0, "sd_m": 3.0, "end": False}
        record = {"unit": "6", "label": "object-tracks", "valid_us": scene.at_us, "value": value}
        scene.put(kinds.SAMPLE, {**record, "prediction": [scene.at_us, branch, weight]})


def intents(scene: Scene) -> None:
    """Where each will be; 1 gives way, and what the autopilots fly on a lost link."""
    for number, unit in enumerate(scene.units):
        east, north = 70.0 * number - 200, 40.0
        at = [float(part) for part in place(east, north).split()]
        far, home = (",".join(place(*spot).split()) for spot in ((east + 160, north + 30), (east - 40, north - 160)))
        source, high_m = ("manoeuvre", 84.0) if unit == "1" else ("route", 60.0 + 4 * number)
        scene.sample(
            unit, "intent", source=source, rank="committed" if unit == "1" else "named", latitude_deg=at[0],
            longitude_deg=at[1], altitude_m=60.0 + 4 * number, north_m_s=0.0, east_m_s=5.0, down_m_s=0.0, speed_m_s=5.0,
            climb_m_s=2.5, descent_m_s=1.5, radius_m=2.0, half_height_m=1.0, legs=f"{far},{high_m}", ending="hover",
            failsafe=f"2.0 land {home},{high_m}",
        )  # fmt: skip


def main() -> None:
    from tests.console.web.served import browsing, serving

    scene = busy()
    with serving(lambda: scene.feed) as page, tempfile.TemporaryDirectory() as folder:
        with browsing(Path(folder) / "desk") as driver:
            driver.get(page.url)
            wait_for(driver, "document.getElementById('chip-fleet').textContent === '8 platforms'")
            driver.execute_script(
                "document.documentElement.dataset.theme === 'dark' && document.getElementById('theme').click()"
            )
            for name in ("alarms", "monitors", "tasks", "acts", "streams", "events", "fleet"):
                driver.execute_script(f"document.getElementById('tab-{name}').click()")
                if name == "acts":
                    driver.execute_script("document.getElementById('theme').click()")
                if name in {"streams", "fleet"}:
                    driver.execute_script("document.getElementById('map').focus()")
                    driver.switch_to.active_element.send_keys("n")
                pause(scene, driver)
                driver.save_screenshot(str(FIGURES / f"web-{name}.png"))
        with browsing(Path(folder) / "tablet", 820, 1180) as driver:
            driver.get(page.url)
            wait_for(driver, "document.getElementById('chip-fleet').textContent === '8 platforms'")
            driver.execute_script("document.getElementById('tab-alarms').click()")
            pause(scene, driver)
            driver.save_screenshot(str(FIGURES / "web-tablet.png"))
    feed = RecordedFeed(FederationRecording(RECORDING), None)
    feed.load()
    with (
        serving(lambda: RecordingViewer(feed, lambda: 0.0)) as page,
        tempfile.TemporaryDirectory() as folder,
        browsing(Path(folder)) as driver,
    ):
        driver.get(page.url)
        wait_for(driver, "document.getElementById('chip-fleet').textContent === '2 platforms'")
        seek = "const s = document.getElementById('slider'); s.value = 92; s.dispatchEvent(new Event('input'))"
        driver.execute_script(seek)
        driver.execute_script("document.getElementById('tab-alarms').click()")
        wait_for(driver, "document.querySelectorAll('.card.bad').length > 1")
        driver.save_screenshot(str(FIGURES / "web-recording.png"))


def wait_for(driver: Any, condition: str, within_s: float = 15.0) -> None:
    """Until a condition of the page holds."""
    from selenium.webdriver.support.ui import WebDriverWait

    WebDriverWait(driver, within_s, 0.02).until(lambda one: one.execute_script(f"return {condition}"))


def pause(scene: Scene, driver: Any) -> None:
    """Have the page draw what there is."""
    scene.feed.add(
        "", foxglove.LOG, foxglove.log_entry(scene.at_us, foxglove.INFO, "platform 7 is there", ""), scene.at_us
    )
    wait = "const done = arguments[0]; setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(done)), 900)"
    driver.execute_async_script(wait)


if __name__ == "__main__":
    main()
