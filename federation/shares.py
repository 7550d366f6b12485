"""Shares in what is limited: counted by the member of the roster behind a name, or one would have as many as it has names."""

from typing import Final, NamedTuple

COMMANDING: Final = 16
"""Shares of a command centre: several of its commands run at once, and its texts are long."""


class MemberShare(NamedTuple):
    """The member whose quota is used, and how many shares of it that member has."""

    owner: str
    shares: int


def own_share(unit: str) -> MemberShare:
    """Without a roster each name counts by itself."""
    return MemberShare(unit, 1)
