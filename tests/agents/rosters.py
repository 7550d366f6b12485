"""A roster of tests: platforms 0, 1 and 2, the command centres cc and cd, and the observer obs."""

from hashlib import sha256

from federation.security.trust import Role, Roster, RosterMember, Signer, Trust
from sim_uavs.world.world import START_US

ROLES: dict[str, Role] = {
    "0": "uav",
    "1": "uav",
    "2": "uav",
    "cc": "command-centre",
    "cd": "command-centre",
    "obs": "observer",
}


def trust(unit: str) -> Trust:
    """Of a member, with its own key."""
    seeds = {each: sha256(each.encode()).digest() for each in ROLES}
    members = {
        each: RosterMember(each, Signer(seed, "default").public_key, ROLES[each]) for each, seed in seeds.items()
    }
    return Trust.of(Roster(members), seeds[unit], "default", START_US - 1_000_000)
