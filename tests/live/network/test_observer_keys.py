"""An observer speaks under its own key, by `--key` and by Python's `key=`, and is told at once when a key is not the roster's."""

import re
import secrets
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import dyknow as library
from dyknow.model.errors import Refused, RosterError
from tests.live.command_line.command import Dyknow

pytestmark = pytest.mark.live
AT_ONCE_S = 15.0
"""A command takes a few seconds to start on a busy machine; without an answer it would wait as long for each question."""


@pytest.fixture
def keys(dyknow: Dyknow, tmp_path: Path) -> Iterator[Path]:
    """The keys of a federation with one UAV and an observer, `eye`."""
    roster = tmp_path / "trust" / "roster.toml"
    dyknow.options = ("--roster", str(roster))
    dyknow.run("roster", "init", "0")
    dyknow.run("roster", "add", "eye", "--role", "observer")
    dyknow.run("up", "1", "--scenario", "hover", "--discover", "none", "--detach")
    yield roster.parent / "roster.d" / "keys"


def test_an_observer_asks_by_its_key_and_commands_nothing(
    dyknow: Dyknow, keys: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    key = keys / "eye.key"
    [answer] = dyknow.run("query", "heli-position", "--key", str(key))
    assert answer["unit"] == 0
    [refused] = dyknow.run("delegate", "hold", "--to", "0", "--key", str(key), code=1)
    assert refused["performative"] == "refuse"
    assert "only a command centre" in str(refused)
    roster = keys.parent.with_suffix(".toml")
    with library.connect(dyknow.federation, roster=roster, key=key) as federation:
        assert federation.query("heli-position")
        with pytest.raises(Refused, match="only a command centre"):
            federation.delegate("hold", to="0")


def test_a_key_that_is_not_the_rosters_is_refused_at_once(
    dyknow: Dyknow, keys: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    made_up, open_to_all = keys / "made-up.key", keys / "copy.key"
    made_up.write_text(secrets.token_hex(32))
    made_up.chmod(0o600)
    shutil.copy(keys / "eye.key", open_to_all)
    open_to_all.chmod(0o644)
    roster = keys.parent.with_suffix(".toml")
    for key, why in ((made_up, "no member of .* has this key"), (open_to_all, "can be read by others")):
        begun_s = time.monotonic()
        _, errors = dyknow.raw("query", "heli-position", "--key", str(key), code=2)
        assert re.search(why, " ".join(errors.split()))
        with (
            pytest.raises(RosterError, match=why),
            library.connect(dyknow.federation, roster=roster, key=key) as federation,
        ):
            federation.query("heli-position")
        assert time.monotonic() < begun_s + AT_ONCE_S
