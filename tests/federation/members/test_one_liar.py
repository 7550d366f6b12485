"""One member lies about who hears whom, or takes its token back: no session of the others is opened anew, and it is shown."""

from random import Random

import pytest

from dyknow.federation import keys
from dyknow.federation.messages.codec import Heartbeat, encode_heartbeat
from dyknow.federation.transport import DeclareToken, Put, Reopen, UndeclareToken, Urgency
from tests.federation.directories import Directories

LIAR = "9"
_BOOT = 10**13


class Liar:
    """A member with a session of its own that beats as it likes."""

    def __init__(self, box: Directories) -> None:
        self.box, self.seq = box, 0
        self.token = keys.token_platform("abcdef", LIAR, "uav", 1)
        box.wire.open("liar", "abcdef", lambda _event: None, lambda: box.now_us)
        box.wire.perform("liar", DeclareToken(self.token))

    def beat(self, hears: tuple[str, ...], seconds: float = 0.2) -> None:
        self.seq += 1
        beat = Heartbeat(LIAR, _BOOT, self.seq, self.box.now_us, 1, hears, ())
        self.box.wire.put("liar", Put(keys.heartbeat(LIAR), encode_heartbeat(beat), Urgency.CONTROL))
        self.box.run(seconds)


def federation(number: int) -> Directories:
    box = Directories()
    for unit in range(number):
        box.enter(str(unit))
    box.run(2)
    return box


def reopened(box: Directories) -> list[tuple[int, str]]:
    return [(at_us, unit) for at_us, unit, effect in box.wire.noted if isinstance(effect, Reopen)]


def test_who_says_that_it_hears_nobody_moves_nobody_and_is_named_by_all() -> None:
    box = federation(3)
    liar = Liar(box)
    for _ in range(600):
        liar.beat(())
    assert reopened(box) == []
    for unit in ("0", "1", "2"):
        assert [(one.unit, one.text) for one in box.directory(unit).contradicted] == [
            (LIAR, "9 says that it does not hear this platform, which others hear")
        ]
    for _ in range(20):
        liar.beat(("0", "1", "2"))
    assert not any(box.directory(unit).contradicted for unit in ("0", "1", "2"))


def test_who_says_that_it_hears_platforms_that_nobody_else_hears_moves_nobody_and_is_named() -> None:
    box = federation(3)
    liar = Liar(box)
    box.vanish("2")
    for _ in range(600):
        liar.beat(("0", "1", "2", "7"))
    assert reopened(box) == []
    for unit in ("0", "1"):
        assert [one.text for one in box.directory(unit).contradicted] == ["9 alone says that it hears 2 and 1 more"]


@pytest.mark.parametrize("seed", range(4))
def test_whatever_one_member_says_of_hearing_no_session_is_opened_anew(seed: int) -> None:
    random, box = Random(seed), federation(3 + seed % 2)
    liar = Liar(box)
    units = [*box.nodes, LIAR, "7", "8"]
    for _ in range(120):
        hears = tuple(random.sample(units, random.randrange(len(units))))
        for _ in range(random.choice([1, 5, 40])):
            liar.beat(hears)
        assert reopened(box) == []
        assert all(box.present(unit) >= box.nodes.keys() - {unit} for unit in box.nodes)


def test_who_takes_its_token_back_and_beats_on_moves_nobody() -> None:
    box = federation(4)
    liar = Liar(box)
    for _ in range(10):
        liar.beat(tuple(box.nodes))
    for _ in range(5):
        box.wire.perform("liar", UndeclareToken(liar.token))
        for _ in range(100):
            liar.beat(tuple(box.nodes))
        box.wire.perform("liar", DeclareToken(liar.token))
        liar.beat(tuple(box.nodes))
    assert reopened(box) == []
