"""Map tiles of a folder are drawn where they lie; the page is part of what is installed."""

import struct
import subprocess
import tomllib
import zlib
from pathlib import Path

import pytest

pytest.importorskip("selenium")
pytest.importorskip("uvicorn")

from dyknow.console.web.access import PAGE
from tests.console.web.scene import Scene, wait_for
from tests.console.web.served import browsing, needs_chromium, serving

ROOT = Path(__file__).parents[3]
MAGENTA = 255, 0, 255
DRAWN = """() => {
  const map = document.getElementById('map'), at = [map.width / 2 + 20, map.height / 2 + 20, 1, 1];
  const [red, green, blue] = map.getContext('2d').getImageData(...at).data;
  return red > 250 && green < 5 && blue > 250;
}"""


def tile(folder: Path, *, z: int, x: int, y: int) -> None:
    """A tile of one colour, as PNG."""
    row = b"\0" + bytes(MAGENTA) * 256
    parts = (
        (b"IHDR", struct.pack(">IIBBBBB", 256, 256, 8, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(row * 256)),
        (b"IEND", b""),
    )
    path = folder / str(z) / str(x) / f"{y}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    chunks = (
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in parts
    )
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))


@pytest.mark.live
@pytest.mark.full
@needs_chromium
def test_tiles_of_a_folder_are_drawn_under_the_map(tmp_path: Path) -> None:
    scene = Scene(0, 0)
    for x in range(4):
        for y in range(4):
            tile(tmp_path / "tiles", z=2, x=x, y=y)
    with (
        serving(lambda: scene.feed, tiles=tmp_path / "tiles") as page,
        browsing(tmp_path / "chromium", 1280, 800) as driver,
    ):
        driver.get(page.url)
        wait_for(driver, "document.getElementById('link').textContent === 'live'")
        driver.execute_script("document.getElementById('zoom-in').click()")
        wait_for(driver, f"({DRAWN})()")


def test_the_files_of_the_page_are_in_what_is_installed() -> None:
    """The wheel has all that is under version control in its packages, and leaves nothing out."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        wheel = tomllib.load(file)["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert set(wheel) == {"packages", "sources"}
    assert {"console", "dyknow"} <= set(wheel["packages"])
    files = subprocess.run(
        ["git", "ls-files", "console", "dyknow"], cwd=ROOT, check=True, capture_output=True, text=True
    )
    gathered = set(files.stdout.split())
    wanted = {f"console/web/page/{path.lstrip('/') or 'page.html'}" for path in PAGE}
    assert wanted | {"dyknow/library.pyi", "dyknow/py.typed", "console/py.typed"} <= gathered
