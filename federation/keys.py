"""Every key of a federation, relative to its namespace `dyknow/<federation>`: built here, parsed back here.

The sender is a chunk of the key at a fixed place, so that access control can bind it to a certificate:

    @df/v1/<zid>/<unit>/P/<kind>/<version>                 token: the platform is alive
    @df/v1/<zid>/<unit>/S/<service>/<version>              token: one of its services
    @df/v1/<zid>/<unit>/L/<label>/<type hash>/<period us>  token: a semantic label it exports
    <unit>/df                                              queryable: its description
    hb/<unit>                                              its heartbeat
    acl/<receiver>/<sender>/<agent>                        a speech act; receiver `all` is every platform
    x/<owner>/<label>/<policy hash>                        a stream for all that requested that policy, and others that
                                                           the same receivers get
    q/<owner>/<label>                                      queryable: the history of a stream
    time/<unit>                                            queryable: clock ping

Builders raise NameRefused for a name that cannot be one chunk; Zenoh itself would let NUL, newlines, `..`, wildcards
and 70 kB through. `parse_key` gives the meaning of a received key, or None.
"""

import re
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias

from dyknow.model.errors import NameRefused
from dyknow.model.semantic_labels import LABEL_NAME

EVERYBODY = "all"
"""The receiver of a broadcast act. No unit is called so."""

_MAX_KEY = 320  # the longest key the builders below can make is shorter
_RESERVED = frozenset({"acl", "all", "df", "hb", "q", "time", "x"})  # the scheme's own words

_UNIT = re.compile(r"(?=.{1,32}\Z)(0|[1-9][0-9]*|[a-z][a-z0-9_]*(-[a-z0-9_]+)*)")
_CONVERSATION = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,95}")
_FEDERATION = re.compile(r"(?=.{1,64}\Z)[a-z0-9]+([_-][a-z0-9]+)*")
_HASH = re.compile(r"[0-9a-f]{8}")
_ZID = re.compile(r"[0-9a-f]{1,32}")
_COUNT = re.compile(r"0|[1-9][0-9]{0,17}")


def _matching(pattern: re.Pattern[str], name: str, what: str) -> str:
    if not isinstance(name, str) or not pattern.fullmatch(name):
        raise NameRefused(f"{name!r:.80} cannot be {what}")
    return name


@lru_cache(maxsize=4096)
def unit(name: str) -> str:
    """`name` if it can name a platform: a number, or a-z 0-9 _ with hyphens inside, at most 32 characters."""
    if name in _RESERVED:
        raise NameRefused(f"{name!r} cannot name a unit: keys use the word; choose another")
    return _matching(_UNIT, name, "a unit: a number, or a-z 0-9 _ with hyphens inside, 32 characters")


@lru_cache(maxsize=4096)
def label(name: str) -> str:
    """`name` if it can be a semantic label."""
    return _matching(LABEL_NAME, name, "a semantic label: hyphenated lower-case words, 64 characters")


@lru_cache(maxsize=4096)
def agent(name: str) -> str:
    """`name` if it can name an agent, a service or a kind of platform."""
    return _matching(LABEL_NAME, name, "an agent or a service: hyphenated lower-case words, 64 characters")


def conversation(name: str) -> str:
    """`name` if it can identify a conversation or a contract."""
    return _matching(_CONVERSATION, name, "a conversation: letters, digits and _ . - inside, 96 characters")


def namespace(federation: str) -> str:
    """The root of all keys of `federation`, for the configuration of the session."""
    return f"dyknow/{_matching(_FEDERATION, federation, 'a federation: a-z 0-9 with _ or - inside, 64 characters')}"


def _hash(name: str) -> str:
    return _matching(_HASH, name, "a hash: 8 hexadecimal digits")


def _zid(name: str) -> str:
    return _matching(_ZID, name, "a Zenoh identity: up to 32 hexadecimal digits")


def _count(number: int) -> str:
    return _matching(_COUNT, str(number), "a count: a whole number from 0")


class ActKey(NamedTuple):
    """A speech act from a unit to an agent of the receiver (`all`: of everybody)."""

    receiver: str
    sender: str
    agent: str


class StreamKey(NamedTuple):
    owner: str
    label: str
    policy_hash: str


class HistoryKey(NamedTuple):
    owner: str
    label: str


class DescribeKey(NamedTuple):
    unit: str


class HeartbeatKey(NamedTuple):
    unit: str


class AnnouncementKey(NamedTuple):
    """A platform's unasked message about itself; below its heartbeat, so that one subscriber hears both in order."""

    unit: str


class ClockKey(NamedTuple):
    unit: str


class PlatformToken(NamedTuple):
    zid: str
    unit: str
    kind: str
    version: int


class ServiceToken(NamedTuple):
    zid: str
    unit: str
    service: str
    version: int


class LabelToken(NamedTuple):
    """A semantic label that a unit exports; `period_us` is 0 for a stream without a period."""

    zid: str
    unit: str
    label: str
    type_hash: str
    period_us: int


Key: TypeAlias = (
    ActKey
    | StreamKey
    | HistoryKey
    | DescribeKey
    | HeartbeatKey
    | AnnouncementKey
    | ClockKey
    | PlatformToken
    | ServiceToken
    | LabelToken
)

TOKENS = "@df/v1/**"
"""All liveliness tokens. Spelt out: wildcards never match a chunk that begins with @."""
PLATFORM_TOKENS = "@df/v1/*/*/P/**"
HEARTBEATS = "hb/**"
"""All heartbeats and announcements."""
BROADCAST = f"acl/{EVERYBODY}/**"


def inbox(receiver: str) -> str:
    """All acts sent to `receiver`: one subscriber, network order per sender."""
    return f"acl/{unit(receiver)}/**"


@lru_cache(maxsize=4096)
def act(receiver: str, sender: str, agent_name: str) -> str:
    to = receiver if receiver == EVERYBODY else unit(receiver)
    return f"acl/{to}/{unit(sender)}/{agent(agent_name)}"


def stream(owner: str, semantic_label: str, policy_hash: str) -> str:
    """One key for all receivers that asked for the same policy: one put serves them."""
    return f"x/{unit(owner)}/{label(semantic_label)}/{_hash(policy_hash)}"


def stream_expr(semantic_label: str, policy_hash: str) -> str:
    """The same stream of every owner."""
    return f"x/*/{label(semantic_label)}/{_hash(policy_hash)}"


def history(owner: str, semantic_label: str) -> str:
    return f"q/{unit(owner)}/{label(semantic_label)}"


def history_expr(owner: str) -> str:
    """The keys that the owner's one history queryable answers for."""
    return f"q/{unit(owner)}/**"


def describe(name: str) -> str:
    return f"{unit(name)}/df"


def heartbeat(name: str) -> str:
    return f"hb/{unit(name)}"


def announcement(name: str) -> str:
    return f"hb/{unit(name)}/df"


def clock(name: str) -> str:
    return f"time/{unit(name)}"


def token_platform(zid: str, name: str, kind: str, version: int) -> str:
    return f"@df/v1/{_zid(zid)}/{unit(name)}/P/{agent(kind)}/{_count(version)}"


def token_service(zid: str, name: str, service: str, version: int) -> str:
    return f"@df/v1/{_zid(zid)}/{unit(name)}/S/{agent(service)}/{_count(version)}"


def token_label(zid: str, name: str, semantic_label: str, type_hash: str, period_us: int) -> str:
    return f"@df/v1/{_zid(zid)}/{unit(name)}/L/{label(semantic_label)}/{_hash(type_hash)}/{_count(period_us)}"


_Build: TypeAlias = Callable[..., str]
_SCHEME: dict[tuple[str, int], tuple[Callable[..., Key], _Build]] = {
    ("acl", 4): (ActKey, act),
    ("x", 4): (StreamKey, stream),
    ("q", 3): (HistoryKey, history),
    ("hb", 2): (HeartbeatKey, heartbeat),
    ("time", 2): (ClockKey, clock),
}
_TOKENS: dict[tuple[str, int], tuple[Callable[..., Key], _Build]] = {
    ("P", 7): (PlatformToken, token_platform),
    ("S", 7): (ServiceToken, token_service),
    ("L", 8): (LabelToken, token_label),
}


def parse_key(key: str) -> Key | None:
    """The meaning of a received key, or None if it is not exactly a key that one of the builders makes."""
    return _parse(key) if len(key) <= _MAX_KEY else None


@lru_cache(maxsize=4096)
def _parse(key: str) -> Key | None:
    chunks = key.split("/")
    parts: list[Any]
    if chunks[0] == "@df" and len(chunks) >= 7:
        entry = _TOKENS.get((chunks[4], len(chunks)))
        parts = [*chunks[2:4], *chunks[5:-1], int(chunks[-1]) if _COUNT.fullmatch(chunks[-1]) else -1]
    elif chunks[-1] == "df" and len(chunks) == 2:
        entry, parts = (DescribeKey, describe), chunks[:1]
    elif chunks[-1] == "df" and len(chunks) == 3:
        entry, parts = (AnnouncementKey, announcement), chunks[1:2]
    else:
        entry, parts = _SCHEME.get((chunks[0], len(chunks))), chunks[1:]
    if entry is None:
        return None
    kind, build = entry
    try:
        return kind(*parts) if build(*parts) == key else None
    except NameRefused:
        return None


@lru_cache(maxsize=16_384)
def matches(key_expr: str, key: str) -> bool:
    """Does Zenoh deliver what is put on `key` to a subscriber of `key_expr`?

    `*` is one chunk, `**` any number of them, `$*` any characters inside a chunk; none matches a chunk that begins
    with `@`, which only the same chunk does.
    """
    chunks = key.split("/")
    reached = {0}  # how many chunks of the key the expression so far can cover
    for pattern in key_expr.split("/"):
        if pattern == "**":
            reached = {end for start in reached for end in _runs(chunks, start)}
        else:
            reached = {at + 1 for at in reached if at < len(chunks) and _chunk_matches(pattern, chunks[at])}
    return len(chunks) in reached


def _runs(chunks: list[str], start: int) -> range:
    end = start
    while end < len(chunks) and not chunks[end].startswith("@"):
        end += 1
    return range(start, end + 1)


def _chunk_matches(pattern: str, chunk: str) -> bool:
    if pattern == chunk:
        return True
    if pattern.startswith("@") or chunk.startswith("@"):
        return False
    if pattern == "*":
        return True
    return (
        "$*" in pattern and re.fullmatch(".*".join(map(re.escape, pattern.split("$*"))), chunk, re.DOTALL) is not None
    )
