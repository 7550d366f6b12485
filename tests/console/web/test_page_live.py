"""The page of a federation that runs, measured: how soon it is there, what it costs, what clicks do to platforms."""

import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

pytest.importorskip("selenium")
pytest.importorskip("uvicorn")

from tests.console.web.scene import Scene, wait_for
from tests.console.web.served import browsing, needs_chromium, serving
from tests.live.command_line.command import Dyknow

pytestmark = [pytest.mark.live, pytest.mark.full, needs_chromium]
SPAN_S = 10.0


@pytest.fixture
def dyknow(tmp_path: Path) -> Iterator[Dyknow]:
    found = Dyknow(tmp_path)
    try:
        yield found
    finally:
        found.close()


def busy_s(driver: Any) -> float:
    """Seconds for which the main thread of the page has worked."""
    metrics = driver.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
    return float(next(one["value"] for one in metrics if one["name"] == "TaskDuration"))


SEEN = """
window.seen = {};
const look = () => { for (const card of document.querySelectorAll('[data-alarm]')) window.seen[card.dataset.alarm] ??= Date.now() * 1000; };
new MutationObserver(look).observe(document.getElementById('panel'), { childList: true });
"""
COUNT_FRAMES = """
const fill = CanvasRenderingContext2D.prototype.fillRect;
window.frames_drawn = 0;
CanvasRenderingContext2D.prototype.fillRect = function (x, y, w, h) { if (this.canvas.id === 'map' && x === 0 && y === 0) window.frames_drawn += 1; return fill.call(this, x, y, w, h); };
"""


def share_of_server(process: psutil.Process, span_s: float) -> float:
    before, since_s = process.cpu_times(), time.monotonic()
    time.sleep(span_s)
    after = process.cpu_times()
    return (after.user + after.system - before.user - before.system) / (time.monotonic() - since_s)


def test_eight_platforms_at_ten_hertz_are_shown_for_a_third_of_a_core_and_obey_clicks(
    dyknow: Dyknow, tmp_path: Path
) -> None:
    dyknow.raw("up", "8", "--scenario", "crossing", "--detach")
    with browsing(tmp_path / "chromium") as driver:
        driver.execute_cdp_cmd("Performance.enable", {})
        begun_s = time.monotonic()
        server = dyknow.start("web", "--json", "--port", "0")
        assert server.stdout is not None
        driver.get(json.loads(server.stdout.readline())["url"])
        wait_for(driver, "document.getElementById('link').textContent === 'live'")
        opened_s = time.monotonic() - begun_s
        wait_for(driver, "document.getElementById('chip-fleet').textContent === '8 platforms'")
        driver.execute_script("document.getElementById('tab-alarms').click()")
        driver.execute_script(SEEN)

        driver.find_element("id", "tab-tasks").click()
        wait_for(driver, "document.getElementById('proximity')")
        driver.find_element("id", "proximity").click()
        driver.find_element("id", "confirm").click()
        wait_for(driver, "document.querySelector('[data-task] .cancel')", 20)
        [task] = [one for one in dyknow.run("tasks") if one["task"] == "monitor-proximity"]
        driver.execute_script("document.getElementById('tab-alarms').click()")
        wait_for(driver, "document.querySelector('[data-alarm]')", 60)
        before_s, since_s = busy_s(driver), time.monotonic()
        share = share_of_server(psutil.Process(server.pid), SPAN_S)
        busy = (busy_s(driver) - before_s) / (time.monotonic() - since_s)
        seen = driver.execute_script("return window.seen")
        detected = {}
        for one in dyknow.run("alarms", code=None):
            if one["event"] == "opened":
                detected[one["id"]] = one["detected_us"]
        late_ms = sorted((seen[name] - detected[name]) / 1000 for name in seen if name in detected)

        driver.find_element("id", "tab-tasks").click()
        wait_for(driver, "document.querySelector('[data-task] .cancel')")
        driver.find_element("css selector", f"[data-task='{task['conversation']}'] .cancel").click()
        driver.find_element("id", "confirm").click()
        wait_for(driver, "document.getElementById('toasts').textContent.includes('ended')")
        assert not [one for one in dyknow.run("tasks", code=None) if one["task"] == "monitor-proximity"]

        dyknow.raw("down")
        wait_for(driver, "!/^8 platforms/.test(document.getElementById('chip-fleet').textContent)", 30)
        dyknow.raw("up", "8", "--scenario", "crossing", "--detach")
        wait_for(driver, "document.getElementById('chip-fleet').textContent === '8 platforms'", 30)
        assert not driver.get_log("browser")
    figures = {
        "opened_s": opened_s,
        "server_share": share,
        "main_thread": busy,
        "late_ms": late_ms,
        "load": psutil.getloadavg()[0],
    }
    print(json.dumps(figures))
    assert late_ms
    shared = max(1.0, psutil.getloadavg()[0] / (psutil.cpu_count() or 1))  # among this many processes
    assert late_ms[len(late_ms) // 2] < 300 * shared
    assert share < 0.3
    assert busy < 0.5
    assert opened_s < 2.0 * shared


def test_fifty_platforms_and_two_hundred_objects_are_drawn_five_times_a_second(tmp_path: Path) -> None:
    scene, is_over = Scene(50, 200), threading.Event()

    def fly() -> None:
        while not is_over.wait(0.1):
            scene.step()

    with serving(lambda: scene.feed) as page, browsing(tmp_path) as driver:
        driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": COUNT_FRAMES})
        driver.execute_cdp_cmd("Performance.enable", {})
        scene.step()
        driver.get(page.url)
        wait_for(driver, "document.getElementById('chip-fleet').textContent === '50 platforms'")
        thread = threading.Thread(target=fly)
        thread.start()
        try:
            driver.execute_script("window.frames_drawn = 0")
            before_s, since_s = busy_s(driver), time.monotonic()
            time.sleep(SPAN_S)
            frames_s = driver.execute_script("return window.frames_drawn") / (time.monotonic() - since_s)
            busy = (busy_s(driver) - before_s) / (time.monotonic() - since_s)
            driver.save_screenshot(str(tmp_path / "many.png"))
        finally:
            is_over.set()
            thread.join()
        print(json.dumps({"frames_s": frames_s, "main_thread": busy, "load": psutil.getloadavg()[0]}))
        assert frames_s >= 5
