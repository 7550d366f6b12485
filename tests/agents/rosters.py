"""A roster of tests: platforms 0, 1 and 2, the command centres cc and cd, and the observer obs."""

from hashlib import sha256

from dyknow.federation.security.trust import Role, Roster, RosterMember, Signer, Trust
from dyknow.sim_uavs.world.world import START_US

ROLES: dict[str, Role] = {
    "0": "uav",
    "1": "uav",
    "2": "uav",
    "cc": "command-centre",
    "cd": "command-centre",
    "obs": "observer",
}
SEEDS = {unit: sha256(unit.encode()).digest() for unit in ROLES}
MEMBERS = {unit: RosterMember(unit, Signer(SEEDS[unit], "default").public_key, ROLES[unit]) for unit in ROLES}


def trust(unit: str) -> Trust:
    """Of a member, with its own key."""
    return Trust.of(Roster(MEMBERS), SEEDS[unit], "default", START_US - 1_000_000)
