"""A mission whose leader ends is led on by the next that the command centre's permit names, and by no other."""

from hashlib import sha256

from dyknow.agents.capabilities.missions.leading import MissionLeading
from dyknow.agents.capabilities.missions.performing import Performing
from dyknow.agents.config import PlatformConfig
from dyknow.federation.messages.contents import FlyMission, JoinMission, PermitMission
from dyknow.federation.security.trust import Role, Roster, RosterMember, Signer, Trust
from dyknow.sim_uavs.dynamics.scenarios import scenario
from dyknow.sim_uavs.world.world import START_US, World
from tests.agents.capabilities.missions.flown import DOMAIN, TWO, Noting

ROLES: dict[str, Role] = {"0": "uav", "1": "uav", "2": "uav", "cc": "command-centre"}
THREE = TWO.replace("{uav0, uav1}", "{uav0, uav1, uav2}").replace(
    "ypos(uav1) := 0", "ypos(uav1) := 0, xpos(uav2) := 75, ypos(uav2) := 75"
)
LEADERS = ("0", "1", "2")


def trust(unit: str) -> Trust:
    seeds = {each: sha256(each.encode()).digest() for each in ROLES}
    members = {
        each: RosterMember(each, Signer(seed, "default").public_key, ROLES[each]) for each, seed in seeds.items()
    }
    return Trust.of(Roster(members), seeds[unit], "default", START_US - 1_000_000)


def test_the_next_in_the_permit_leads_on_and_the_vehicles_follow_it() -> None:
    world = World(1, truth_us=None)
    for unit in scenario("hover", 3, 1).units:
        name = str(unit.number)
        vehicle = Noting(unit.vehicle(unit.number + 1, airborne=True), START_US)
        config = PlatformConfig(name, 1, control=True, simulated=True, trust=trust(name))
        world.add(name, config, vehicle)
    world.add_command_centre("cc", trust=trust("cc"))
    world.run_for(2.0)
    for name in LEADERS:
        world.ask("cc", name, PermitMission(mission="m1", leaders=LEADERS, vehicles=LEADERS))
    mission = world.ask("cc", "0", FlyMission(mission="m1", domain=DOMAIN, problem=THREE))
    world.run_for(5.0)
    assert mission.agreed

    def led() -> dict[str, str]:
        return {name: world.platform(name).part(Performing).leader for name in LEADERS if name in here}

    here = set(LEADERS)
    assert led() == {"0": "0", "1": "0", "2": "0"}
    world.kill("0")
    here.remove("0")
    by_the_last = world.ask("2", "1", JoinMission(mission="m1"))
    world.run_for(6.0)
    assert by_the_last.refusal is not None
    assert led() == {"1": "1", "2": "1"}
    assert "m1" in world.platform("1").part(MissionLeading).led
    world.platform("1").part(MissionLeading).led["m1"].end("the test ends it", world.now_us)
    world.run_for(2.0)
    assert led() == {"1": "", "2": ""}
    assert world.platform("2").part(Performing).permits.of("m1", world.now_us) is None
