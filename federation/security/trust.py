"""Authentication: the roster of platforms and keys, signatures, and the window against replays.

Without a roster a federation is open. With one, every act is signed with Ed25519 over its body and the name of the
federation; the roster says which key speaks for which unit. Private keys are made and kept by edges.
"""

import tomllib
from base64 import b64decode, b64encode
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from hashlib import sha256
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias

from dyknow.documents.toml_texts import tables_of
from dyknow.federation import keys
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.codec import Signature
from dyknow.federation.shares import COMMANDING, MemberShare
from dyknow.model.errors import NameRefused, RosterError

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

MAX_AGE_US: Final = 30_000_000
OFFSET_US: Final = 1_000_000
"""How much of an estimated clock offset is believed: the member that answers for a clock is not authenticated."""
WINDOW: Final = 1024
LIVES: Final = 1024
"""Windows kept for one member: its boots, and the processes of a command centre, of the last minute."""
KEY_BYTES: Final = 32
FEDERATION: Final = "federation"
"""The key of the federation's name in a roster's text."""
IDENTITY: Final = "identity"
GENERATION: Final = "generation"
RESERVED: Final = (FEDERATION, IDENTITY, GENERATION)
"""The keys in a roster's text before its members."""

Role: TypeAlias = Literal["uav", "command-centre", "observer"]
ROLES: Final[tuple[Role, ...]] = ("uav", "command-centre", "observer")

Refusal: TypeAlias = Literal[
    "unsigned",
    "unknown sender",
    "revoked",
    "forged",
    "too old",
    "from the future",
    "before start",
    "from an earlier life",
    "replayed",
    "too many lives",
]
"""Why an act is not listened to. An act that was `replayed` is genuine: do not act again, but acknowledge again."""


@dataclass(frozen=True, slots=True)
class RosterMember:
    """One platform of a roster: its Ed25519 public key (32 bytes), what it may do, and whether it is out.

    A command centre `cc` speaks as `cc`, and as `cc-1`, `cc-2` ... when several of its processes run at once; so does
    an observer. `certificate` is the number of its present certificate: a member that comes back has the next.

    Raises:
        RosterError: the name cannot be a unit, the key is not one, or the role is unknown.
    """

    unit: str
    key: bytes
    role: Role = "uav"
    revoked: bool = False
    certificate: int = 0

    def __post_init__(self) -> None:
        try:
            keys.unit(self.unit)
        except NameRefused as refused:
            raise RosterError(str(refused)) from None
        if len(self.key) != KEY_BYTES:
            raise RosterError(
                f"the key of {self.unit} has {len(self.key)} bytes, an Ed25519 public key has {KEY_BYTES}"
            )
        if self.role not in ROLES:
            raise RosterError(f"{self.role!r} is not a role: {', '.join(ROLES)}")
        if not 0 <= self.certificate < 1_000_000:
            raise RosterError(f"{self.unit}: {self.certificate} is not the number of a certificate")

    @property
    def key_text(self) -> str:
        return f"ed25519:{b64encode(self.key).decode()}"

    @property
    def common_name(self) -> str:
        """That of its present certificate."""
        return common_name(self.unit, self.certificate)


def common_name(unit: str, certificate: int) -> str:
    """The name in a unit's certificate of this number; no unit has a dot in its name."""
    return f"{unit}.{certificate}" if certificate else unit


@dataclass(frozen=True)
class Roster:
    """The platforms of a federation and their keys, as `Roster.parse` and `str` read and write them.

    Attributes:
        federation: its name; None: the text does not name it.
        identity: 16 hexadecimal digits that stay the same whatever is changed; empty in rosters that had none.
        generation: grows with each change.
    """

    members: Mapping[str, RosterMember] = field(default_factory=dict)
    federation: str | None = None
    identity: str = ""
    generation: int = 0

    @staticmethod
    def parse(text: str) -> "Roster":
        """Read the TOML text of a roster.

        Raises:
            RosterError: the error, and its place.
        """
        try:
            tables = tables_of(text)
        except tomllib.TOMLDecodeError as wrong:
            raise RosterError(f"the roster is not TOML: {wrong}") from None
        federation = tables.pop(FEDERATION) if isinstance(tables.get(FEDERATION), str) else None
        identity = tables.pop(IDENTITY) if isinstance(tables.get(IDENTITY), str) else ""
        generation = tables.pop(GENERATION) if type(tables.get(GENERATION)) is int else 0
        members = {unit: _member(unit, entry) for unit, entry in tables.items()}
        return Roster(members, federation, identity, generation)

    def check_federation(self, name: str) -> None:
        """Raises RosterError if the roster is for another federation."""
        if self.federation not in {None, name}:
            raise RosterError(
                f"the roster is for federation {self.federation}, this is {name}; "
                f"give --federation {self.federation}, or the roster of {name}"
            )

    def __str__(self) -> str:
        parts = [] if self.federation is None else [f'{FEDERATION} = "{self.federation}"\n']
        parts += [f'{IDENTITY} = "{self.identity}"\n'] if self.identity else []
        parts += [f"{GENERATION} = {self.generation}\n"] if self.generation else []
        parts += [
            f'[{member.unit}]\nkey = "{member.key_text}"\nrole = "{member.role}"\nrevoked = {str(member.revoked).lower()}\n'
            + (f"certificate = {member.certificate}\n" if member.certificate else "")
            for _, member in sorted(self.members.items())
        ]
        return "\n".join(parts)

    @cached_property
    def fingerprint(self) -> str:
        """16 hexadecimal digits that two platforms compare to see whether they go by the same roster, of any generation."""
        return self.identity or sha256(str(self).encode()).hexdigest()[:16]

    def member(self, unit: str) -> RosterMember | None:
        """Return the member that speaks as `unit`."""
        found = self.members.get(unit)
        if found is None:
            stem, _, number = unit.rpartition("-")
            found = self.members.get(stem) if number.isdecimal() else None
            if found is not None and found.role == "uav":
                return None
        return found

    def speaker(self, key: bytes) -> RosterMember | None:
        """The member that has this public key."""
        return next((member for member in self.members.values() if member.key == key), None)

    @property
    def admitted(self) -> Mapping[str, RosterMember]:
        """By common name, whose certificates others may be linked with."""
        return {member.common_name: member for member in self.members.values() if not member.revoked}

    def is_successor_of(self, older: "Roster") -> bool:
        """Whether this is the same roster, changed since."""
        same = (self.identity, self.federation) == (older.identity, older.federation)
        return same and self.generation > older.generation

    def added(self, member: RosterMember) -> "Roster":
        """Raises RosterError if the unit has another key: revoke it first, a key is never replaced silently.

        A member that comes back has another certificate than before.
        """
        known = self.members.get(member.unit)
        if known is not None and not known.revoked and known.key != member.key:
            raise RosterError(f"{member.unit} is in the roster with another key; revoke it first")
        if known is not None and known.revoked and member.certificate <= known.certificate:
            member = replace(member, certificate=known.certificate + 1)
        if member.unit in RESERVED:
            raise RosterError(f"{member.unit} cannot be a unit: a roster calls something else so")
        return replace(self, members={**self.members, member.unit: member}, generation=self.generation + 1)

    def revoked(self, unit: str) -> "Roster":
        """Raises RosterError if no member has that name."""
        if unit not in self.members:
            raise RosterError(
                f"{unit} is not in the roster, which has {', '.join(sorted(self.members)) or 'no members'}"
            )
        members = {**self.members, unit: replace(self.members[unit], revoked=True)}
        return replace(self, members=members, generation=self.generation + 1)


def _member(unit: str, entry: Any) -> RosterMember:
    match entry:
        case {"key": str(key), **rest} if (
            rest.keys() <= {"role", "revoked", "certificate"}
            and isinstance(rest.get("revoked", False), bool)
            and type(rest.get("certificate", 0)) is int
        ):
            role: Any = rest.get("role", "uav")
            revoked, certificate = bool(rest.get("revoked", False)), int(str(rest.get("certificate", 0)))
            return RosterMember(unit, parse_key(key), role, revoked, certificate)
        case _:
            raise RosterError(f'[{unit}] needs key = "ed25519:..." and may have role = "..." and revoked = true')


def parse_key(text: str) -> bytes:
    """The bytes of a public key written `ed25519:<base64>`; raises RosterError."""
    kind, _, coded = text.partition(":")
    try:
        raw = b64decode(coded, validate=True)
    except ValueError:
        raw = b""
    if kind != "ed25519" or len(raw) != KEY_BYTES:
        raise RosterError(f"{text[:80]!r} is not a key: ed25519: and 32 bytes in base64")
    return raw


def _signed(federation: str, body: bytes) -> bytes:
    """The signed bytes: an act of one federation is worth nothing in another with the same roster."""
    return b"dyknow act 1\0" + federation.encode() + b"\0" + body


class Signer:
    """A platform's own key; call it with the body of an act. `seed` is the private key, 32 bytes."""

    def __init__(self, seed: bytes, federation: str) -> None:
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

        if len(seed) != KEY_BYTES:
            raise RosterError(f"a private key has {KEY_BYTES} bytes, this one {len(seed)}")
        self._key = Ed25519PrivateKey.from_private_bytes(seed)
        self._federation = federation

    @property
    def public_key(self) -> bytes:
        """The public key, as in the roster."""
        return self._key.public_key().public_bytes_raw()

    def __call__(self, body: bytes) -> Signature:
        return self._key.sign(_signed(self._federation, body))


class ReplayWindow:
    """Which of the last `WINDOW` sequence numbers of one sender and boot were seen already."""

    __slots__ = ("_seen", "_top", "last_us")

    def __init__(self) -> None:
        self._top = -1
        self._seen = 0
        self.last_us = 0

    def is_new(self, seq: int) -> bool:
        """Note `seq`; False if it was noted before or lies before the window."""
        ahead = seq - self._top
        if ahead > 0:
            self._seen = ((self._seen << ahead) | 1) & _MASK if ahead < WINDOW else 1
            self._top = seq
            return True
        bit = 1 << -ahead if -ahead < WINDOW else 0
        if not bit or self._seen & bit:
            return False
        self._seen |= bit
        return True


_MASK: Final = (1 << WINDOW) - 1


class Verifier:
    """Judges received acts by a roster. Times are the node clock.

    Acts from before this platform started are refused: the windows of an earlier life are gone. Clocks may have been
    set back since, so that what an earlier life had accepted of each member is refused by the member's own stamps.

    Args:
        roster: whose keys count.
        federation: its name.
        started_us: when this life began.
        accepted_us: by member, when the newest act was made that an earlier life accepted (the member's node clock).

    Attributes:
        accepted_us: the same, with the acts that this life has accepted; to be kept for the next one.
        accepted: how many acts this life has accepted.
    """

    def __init__(
        self, roster: Roster, federation: str, started_us: int, accepted_us: Mapping[str, int] | None = None
    ) -> None:
        self.roster = roster
        self._earlier_us = dict(accepted_us or {})
        self.accepted_us = dict(self._earlier_us)
        self.accepted = 0
        self._federation, self._started_us = federation, started_us
        self._public: dict[bytes, Ed25519PublicKey] = {}
        self._windows: dict[str, dict[tuple[str, int], ReplayWindow]] = {}

    def check(
        self, act: Act, signature: Signature | None, body: bytes, now_us: int, *, offset_us: int = 0
    ) -> Refusal | None:
        """Why the act must not be carried out, or None.

        Args:
            act: the decoded act.
            signature: that came with it.
            body: the bytes it is over, as `decode_act` returned them.
            now_us: when it arrived.
            offset_us: the sender's clock minus ours, as estimated; believed up to `OFFSET_US` either way.
        """
        refusal = self.forgery(act, signature, body)
        member = self.roster.member(act.sender.unit)
        if refusal is not None or member is None:
            return refusal
        said_us = act.created_us - max(-OFFSET_US, min(offset_us, OFFSET_US))
        if abs(now_us - said_us) > MAX_AGE_US:
            return "too old" if said_us < now_us else "from the future"
        if said_us < self._started_us:
            return "before start"
        if act.created_us <= self._earlier_us.get(member.unit, 0):
            return "from an earlier life"
        refusal = self._replay(member, act, now_us)
        if refusal is None:
            self.accepted += 1
            self.accepted_us[member.unit] = max(act.created_us, self.accepted_us.get(member.unit, 0))
        return refusal

    def is_genuine(self, unit: str, signature: Signature, signed: bytes) -> bool:
        """Whether a member that is not revoked signed these bytes, in this federation."""
        member = self.roster.member(unit)
        return member is not None and not member.revoked and self._is_genuine(member.key, signature, signed)

    def forgery(self, act: Act, signature: Signature | None, body: bytes) -> Refusal | None:
        """Why it is not the act of the member that it names, or None; an old one, or one that was here before, is genuine, too."""
        if signature is None:
            return "unsigned"
        member = self.roster.member(act.sender.unit)
        if member is None:
            return "unknown sender"
        if member.revoked:
            return "revoked"
        return None if self._is_genuine(member.key, signature, body) else "forged"

    def _is_genuine(self, key: bytes, signature: Signature, body: bytes) -> bool:
        from cryptography.exceptions import InvalidSignature
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

        public = self._public.get(key)
        try:
            if public is None:
                public = self._public[key] = Ed25519PublicKey.from_public_bytes(key)
            public.verify(signature, _signed(self._federation, body))
        except (InvalidSignature, ValueError):
            return False
        return True

    def _replay(self, member: RosterMember, act: Act, now_us: int) -> Refusal | None:
        windows = self._windows.setdefault(member.unit, {})
        life = act.sender.unit, act.boot
        window = windows.get(life)
        if window is None:
            for other in [other for other, old in windows.items() if now_us - old.last_us > 2 * MAX_AGE_US]:
                del windows[other]  # its newest act is too old by now
            if len(windows) >= LIVES:
                return "too many lives"
            window = windows[life] = ReplayWindow()
        window.last_us = now_us
        return None if window.is_new(act.seq) else "replayed"


@dataclass(frozen=True, slots=True)
class Trust:
    """How one member signs its acts and checks those of others; without one, the federation is open."""

    signer: Signer
    verifier: Verifier

    @property
    def roster(self) -> Roster:
        """Whose keys count now."""
        return self.verifier.roster

    def share_of(self, unit: str) -> MemberShare:
        """That of the member of the roster behind a name: `obs-1`, `obs-2` ... use what `obs` has."""
        member = self.roster.member(unit)
        if member is None:
            return MemberShare(unit, 1)
        return MemberShare(member.unit, COMMANDING if member.role == "command-centre" else 1)

    @staticmethod
    def of(
        roster: Roster, seed: bytes, federation: str, started_us: int, accepted_us: Mapping[str, int] | None = None
    ) -> "Trust":
        """The trust of a member whose private key is `seed` (32 bytes) and that started at `started_us` (node clock).

        `accepted_us`: the acts that its earlier lives have accepted, as `Verifier` has it.

        Raises:
            RosterError: the key is not one.
        """
        return Trust(Signer(seed, federation), Verifier(roster, federation, started_us, accepted_us))
