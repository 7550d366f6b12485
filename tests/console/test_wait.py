"""`--wait` may stand without a value, and anywhere; with `arrival` it belongs to goto."""

from typing import Any

import pytest
from typer.main import get_command

from dyknow.console.command import Call
from dyknow.console.main import app
from dyknow.model.errors import WrongCall


@pytest.mark.parametrize(
    ("written", "wait", "pairs"),
    [
        (["delegate", "goto", "latitude_deg=1", "--wait"], "acceptance", ["latitude_deg=1"]),
        (["delegate", "--wait", "goto", "latitude_deg=1"], "acceptance", ["latitude_deg=1"]),
        (["delegate", "goto", "-w", "latitude_deg=1", "--to", "0"], "acceptance", ["latitude_deg=1"]),
        (["delegate", "goto", "latitude_deg=1", "--wait", "arrival", "--to", "0"], "arrival", ["latitude_deg=1"]),
        (["delegate", "goto", "latitude_deg=1", "--wait=arrival"], "arrival", ["latitude_deg=1"]),
        (["delegate", "goto", "latitude_deg=1"], None, ["latitude_deg=1"]),
    ],
)
def test_it_may_have_a_value(written: list[str], wait: str | None, pairs: list[str]) -> None:
    root: Any = get_command(app)
    context = root.make_context("dyknow", list(written))
    _, called, rest = root.resolve_command(context, written)
    parsed = called.make_context("delegate", list(rest), parent=context).params
    assert (parsed["wait"], parsed["pairs"], parsed["task"]) == (wait, pairs, "goto")


def test_arrival_belongs_to_goto(call: Call) -> None:
    from dyknow.console.commands.members.delegate import delegate

    with pytest.raises(WrongCall, match="expected goto, got land"):
        delegate(call, "land", [], to="0", wait="arrival")
