"""Who is listened to: rosters, signatures, replays, and hostile acts by the thousand."""

from collections import Counter
from dataclasses import replace
from hashlib import sha256
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.codec import decode_act, encode_act
from dyknow.federation.messages.sexpr import Expr
from dyknow.federation.security.trust import (
    LIVES,
    MAX_AGE_US,
    OFFSET_US,
    WINDOW,
    ReplayWindow,
    Roster,
    RosterMember,
    Signer,
    Verifier,
    parse_key,
)
from dyknow.model.errors import RosterError

NOW = 1_700_000_000_000_000
START = NOW - 3_600_000_000
UNITS = ["0", "uav1", "uav2", "cc"]
PROFILES = [pytest.param(10_000, id="tenth"), pytest.param(100_000, id="bar", marks=pytest.mark.full)]


def signer(unit: str, federation: str = "default") -> Signer:
    return Signer(sha256(unit.encode()).digest(), federation)


def roster() -> Roster:
    members = [
        RosterMember(unit, signer(unit).public_key, "command-centre" if unit == "cc" else "uav") for unit in UNITS
    ]
    return Roster({member.unit: member for member in members}).revoked("uav2")


def said(unit: str = "uav1", **changed: object) -> Act:
    act = Act(
        Performative.REQUEST,
        AgentName("interface", unit),
        AgentName("interface", "0"),
        Expr("monitor-proximity"),
        "1-1-1",
        boot=5,
        seq=1,
        created_us=NOW,
    )
    return act._replace(**changed)


def judged(verifier: Verifier, payload: bytes, now_us: int = NOW, offset_us: int = 0) -> str | None:
    act, signature, body = decode_act(payload)
    return verifier.check(act, signature, body, now_us, offset_us=offset_us)


def test_a_roster_is_written_and_read_back() -> None:
    text = str(roster())
    assert Roster.parse(text) == roster()
    assert Roster.parse(text).fingerprint == roster().fingerprint != Roster().fingerprint
    assert 'key = "ed25519:' in text
    assert parse_key(roster().members["0"].key_text) == roster().members["0"].key


@pytest.mark.parametrize(
    "text",
    [
        "[",
        "[uav1]",
        '[uav1]\nkey = "ed25519:"',
        '[uav1]\nkey = "rsa:AAAA"',
        "[uav1]\nkey = 5",
        '["a/*"]\nkey = "KEY"',
        '[all]\nkey = "KEY"',
        '[uav1]\nkey = "KEY"\nrole = "king"',
        '[uav1]\nkey = "KEY"\nrole = ["uav"]',
        '[uav1]\nkey = "KEY"\nrevoked = "no"',
        '[uav1]\nkey = "KEY"\ncolour = "red"',
        'uav1 = "KEY"',
    ],
)  # fmt: skip
def test_a_roster_that_does_not_load_says_why(text: str) -> None:
    with pytest.raises(RosterError):
        Roster.parse(text.replace("KEY", roster().members["0"].key_text))


def test_a_key_is_never_replaced_silently() -> None:
    other = RosterMember("uav1", signer("0").public_key)
    with pytest.raises(RosterError, match="revoke it first"):
        roster().added(other)
    back = roster().revoked("uav1").added(other)
    assert back.members["uav1"] == replace(other, certificate=1), "its certificate is another, too"
    assert back.is_successor_of(roster())
    assert not roster().is_successor_of(back)
    assert roster().added(roster().members["uav1"]).members == roster().members
    with pytest.raises(RosterError, match="not in the roster"):
        roster().revoked("uav9")


def test_a_command_centre_speaks_as_any_of_its_processes_and_nobody_else_does() -> None:
    verifier = Verifier(roster(), "default", START)
    assert judged(verifier, encode_act(said("cc-4711"), signer("cc"))) is None
    assert judged(verifier, encode_act(said("cc-4712"), signer("uav1"))) == "forged"
    assert judged(verifier, encode_act(said("cc-x"), signer("cc"))) == "unknown sender"
    assert judged(verifier, encode_act(said("uav1-2"), signer("uav1"))) == "unknown sender"


@pytest.mark.parametrize(
    ("act", "key", "reason"),
    [
        (said(), "uav1", None),
        (said(), None, "unsigned"),
        (said(), "0", "forged"),
        (said("uav9"), "uav9", "unknown sender"),
        (said("uav2"), "uav2", "revoked"),
        (said(created_us=NOW - MAX_AGE_US), "uav1", None),
        (said(created_us=NOW - MAX_AGE_US - 1), "uav1", "too old"),
        (said(created_us=NOW + MAX_AGE_US), "uav1", None),
        (said(created_us=NOW + MAX_AGE_US + 1), "uav1", "from the future"),
    ],
)
def test_an_act_is_listened_to_or_refused_for_a_reason(act: Act, key: str | None, reason: str | None) -> None:
    payload = encode_act(act, None if key is None else signer(key))
    assert judged(Verifier(roster(), "default", START), payload) == reason


def test_an_act_is_worth_nothing_in_another_federation() -> None:
    payload = encode_act(said(), signer("uav1", "field"))
    assert judged(Verifier(roster(), "default", START), payload) == "forged"
    assert judged(Verifier(roster(), "field", START), payload) is None


def test_a_known_clock_offset_is_taken_into_account() -> None:
    payload = encode_act(said(created_us=NOW + MAX_AGE_US + OFFSET_US), signer("uav1"))
    verifier = Verifier(roster(), "default", START)
    assert judged(verifier, payload) == "from the future"
    assert judged(verifier, payload, offset_us=OFFSET_US) is None


@pytest.mark.parametrize("age_us", [MAX_AGE_US + OFFSET_US + 1, 3_600_000_000])
def test_whoever_answers_for_a_clock_makes_no_old_act_young(age_us: int) -> None:
    payload = encode_act(said(created_us=NOW - age_us), signer("uav1"))
    verifier = Verifier(roster(), "default", START)
    assert judged(verifier, payload, offset_us=-age_us) == "too old"


def test_a_restart_with_a_clock_set_back_opens_no_window_for_replays() -> None:
    recorded = encode_act(said(created_us=NOW), signer("uav1"))
    first = Verifier(roster(), "default", NOW - 1)
    assert judged(first, recorded, NOW + 1) is None
    assert first.accepted_us == {"uav1": NOW}
    for earlier_us in (-1, 2_000_000, 29_000_000):
        again = Verifier(roster(), "default", NOW - earlier_us - 2, first.accepted_us)
        assert judged(again, recorded, NOW - earlier_us) == "from an earlier life"
        later = encode_act(said(boot=6, created_us=NOW + 1), signer("uav1"))
        assert judged(again, later, NOW - earlier_us) is None


def test_a_restart_opens_no_window_for_replays() -> None:
    recorded = [encode_act(said(seq=seq, created_us=NOW + seq), signer("uav1")) for seq in range(100)]
    first = Verifier(roster(), "default", START)
    assert [judged(first, payload, NOW + 200) for payload in recorded] == [None] * 100
    again = Verifier(roster(), "default", NOW + 150)
    assert {judged(again, payload, NOW + 200) for payload in recorded} == {"before start"}


def test_a_senders_restart_opens_no_window_for_replays() -> None:
    verifier = Verifier(roster(), "default", START)
    old = encode_act(said(boot=5, seq=7), signer("uav1"))
    assert judged(verifier, old) is None
    assert judged(verifier, encode_act(said(boot=6, seq=1), signer("uav1"))) is None
    assert judged(verifier, old, NOW + MAX_AGE_US) == "replayed"


def test_the_lives_of_one_member_are_bounded_and_forgotten_when_they_can_be() -> None:
    verifier = Verifier(roster(), "default", START)
    acts = [encode_act(said(boot=boot), signer("uav1")) for boot in range(LIVES + 1)]
    assert [judged(verifier, payload) for payload in acts] == [None] * LIVES + ["too many lives"]
    assert judged(verifier, encode_act(said("0"), signer("0"))) is None, "others are not hurt"
    later = NOW + 2 * MAX_AGE_US + 1
    assert judged(verifier, encode_act(said(boot=9999, created_us=later), signer("uav1")), later) is None


@given(st.lists(st.integers(0, 4 * WINDOW), max_size=60))
def test_the_window_lets_each_number_through_once(numbers: list[int]) -> None:
    window, seen = ReplayWindow(), set[int]()
    for seq in numbers:
        expected = seq not in seen and seq > max(seen, default=-1) - WINDOW
        assert window.is_new(seq) is expected
        seen.add(seq)


def test_the_window_reaches_back_1024_numbers() -> None:
    window = ReplayWindow()
    assert window.is_new(5000)
    assert window.is_new(5000 - WINDOW + 1)
    assert not window.is_new(5000 - WINDOW)
    assert window.is_new(2**63 - 1)
    assert not window.is_new(2**63 - 1)


FORGERIES = {
    "performative": Performative.CANCEL,
    "sender": AgentName("interface", "0"),
    "receiver": AgentName("interface", "uav2"),
    "content": Expr("land"),
    "conversation_id": "9-9-9",
    "protocol": "fipa-query",
    "reply_with": "r9",
    "in_reply_to": "r9",
    "reply_by_us": 5,
    "language": "other",
    "encoding": "other",
    "ontology": "other",
    "reply_to": AgentName("interface", "0"),
    "boot": 9,
    "seq": 999_999,
    "created_us": NOW + 1,
    "acks": (9,),
}


@pytest.mark.parametrize("name", list(FORGERIES))
def test_no_field_of_a_signed_act_can_be_changed(name: str) -> None:
    _, signature, _ = decode_act(encode_act(said(), signer("uav1")))
    assert signature is not None
    forged = encode_act(said()._replace(**{name: FORGERIES[name]}), lambda _: signature)
    assert judged(Verifier(roster(), "default", START), forged) == "forged"


@pytest.mark.parametrize("inputs", PROFILES)
def test_of_many_hostile_acts_exactly_the_genuine_ones_are_carried_out_once(inputs: int) -> None:
    """Genuine, foreign key, unsigned, revoked, old, forged in one or two fields, bits of the signature, replays."""
    rng = Random(7)
    verifier, signers = Verifier(roster(), "default", START), {unit: signer(unit) for unit in UNITS}
    recorded: list[bytes] = []
    expected: Counter[str | None] = Counter()
    found: Counter[str | None] = Counter()
    for number in range(inputs):
        now_us = NOW + number
        unit = rng.choice(UNITS[:2])
        act = said(unit, seq=number, created_us=now_us)
        way = rng.randrange(8)
        if way == 0:
            payload, reason = encode_act(act, signers[unit]), None
            recorded.append(payload)
        elif way == 1:
            payload, reason = encode_act(act, signers["cc"]), "forged"
        elif way == 2:
            payload, reason = encode_act(act), "unsigned"
        elif way == 3:
            payload, reason = encode_act(said("uav2", seq=number), signers["uav2"]), "revoked"
        elif way == 4:
            payload, reason = encode_act(act._replace(created_us=now_us - MAX_AGE_US - 1), signers[unit]), "too old"
        elif way == 5:
            names = rng.sample([name for name in FORGERIES if name != "sender" or unit != "0"], rng.randrange(1, 3))
            _, mark, _ = decode_act(encode_act(act, signers[unit]))
            assert mark is not None
            forged = act._replace(**{name: FORGERIES[name] for name in names})
            payload, reason = encode_act(forged, lambda _, mark=mark: mark), "forged"
        elif way == 6:
            _, mark, _ = decode_act(encode_act(act, signers[unit]))
            assert mark is not None
            at, bit = rng.randrange(64), rng.randrange(8)
            bent = mark[:at] + bytes([mark[at] ^ (1 << bit)]) + mark[at + 1 :]
            payload, reason = encode_act(act, lambda _, bent=bent: bent), "forged"
        else:
            payload, reason = (rng.choice(recorded), "replayed") if recorded else (encode_act(act), "unsigned")
        verdict = judged(verifier, payload, now_us)
        assert verdict == reason, (number, way)
        expected[reason] += 1
        found[verdict] += 1
    assert found == expected
    assert found[None] == len(recorded) > inputs // 10
