"""May a member command a vehicle in a mission? A command centre may; another platform only where a command centre says so."""

import pytest

from agents.actions import Role
from agents.admission.mission_permits import MOST, STAND_US, Permits
from dyknow.model.errors import Refused

ROLES = {"cc": Role.COMMAND_CENTRE, "1": Role.DELEGATE, "2": Role.DELEGATE, "eye": Role.OBSERVER}


def refused(permits: Permits, mission: str, sender: str, now_us: int = 0) -> bool:
    try:
        permits.check(mission, sender, now_us)
    except Refused as why:
        assert why.code == "role"
        return True
    return False


def test_a_platform_leads_only_what_a_command_centre_has_permitted_and_for_an_hour() -> None:
    permits = Permits("0", ROLES.__getitem__, lambda _unit: False)
    assert not refused(permits, "m", "cc")
    assert refused(permits, "m", "1")
    permits.permit("m", ("1",), 0)
    assert not refused(permits, "m", "1")
    assert refused(permits, "m", "2")
    assert refused(permits, "other", "1")
    assert refused(permits, "m", "1", STAND_US)
    permits.end("m")
    assert refused(permits, "m", "1")


def test_a_successor_is_obeyed_only_when_all_before_it_are_gone() -> None:
    here = {"1", "2"}
    permits = Permits("0", {**ROLES, "3": Role.DELEGATE}.__getitem__, here.__contains__)
    permits.permit("m", ("1", "2", "3"), 0)
    permits.check("m", "1", 0)
    for sender in "23":
        with pytest.raises(Refused) as why:
            permits.check("m", sender, 0)
        assert why.value.code == "succession"
    here.remove("1")
    permits.check("m", "2", 0)
    with pytest.raises(Refused):
        permits.check("m", "3", 0)


def test_permits_do_not_grow_without_end() -> None:
    permits = Permits("0", ROLES.__getitem__, lambda _unit: False)
    for number in range(MOST + 1):
        permits.permit(f"m{number}", ("1",), 0)
    assert refused(permits, "m0", "1")
    assert not refused(permits, f"m{MOST}", "1")


@pytest.mark.parametrize(("chain", "sender"), [(("cc", "1"), "2"), (("cc", "0", "1"), "1")])
def test_a_chain_ends_with_its_sender_and_has_no_circle(chain: tuple[str, ...], sender: str) -> None:
    with pytest.raises(Refused) as why:
        Permits("0", ROLES.__getitem__, lambda _unit: False).check_chain(chain, sender)
    assert why.value.code == "chain"
