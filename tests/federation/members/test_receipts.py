"""With a roster an acknowledgement is signed: who forges one silences nothing, and what cannot arrive is told."""

from random import Random

import pytest

from dyknow.federation.messages.contents import Hold
from dyknow.federation.messages.receipts import Receipt, encode_receipt, encode_signed, receipt_key
from dyknow.federation.security.trust import Signer
from dyknow.federation.transport import Put, Urgency
from dyknow.navigation.vehicle import HoldOrder
from tests.agents.rosters import trust
from tests.box import Box, Vehicle


def fleet(seed: int = 0) -> Box:
    wire = Box(seed)
    for unit in "01":
        wire.join(unit, Vehicle(north_m=3000.0 * int(unit), altitude_m=100.0), trust=trust(unit), control=True)
    wire.centre("cc", trust=trust("cc"))
    wire.run(2)
    return wire


def forgeries(boot: int, draw: Random) -> list[bytes]:
    """Receipts for all acts of that life: unsigned, of another member, of no member, for another receiver, damaged."""
    receipt = Receipt(boot, tuple(range(1, 100)))
    stranger = Signer(draw.randbytes(32), "default")
    whole = encode_signed("cc", receipt, trust("0").signer)
    return [
        encode_receipt(receipt),
        encode_signed("cc", receipt, trust("1").signer),
        encode_signed("cc", receipt, stranger),
        encode_signed("1", receipt, trust("0").signer),
        whole[:-1] + bytes([whole[-1] ^ 1]),
        whole[: draw.randrange(len(whole))],
    ]


@pytest.mark.parametrize("lost_s", [0.15, 0.5, 60.0])
def test_forged_receipts_and_lost_puts_do_not_make_a_hold_vanish(lost_s: float) -> None:
    wire, draw = fleet(), Random(1)
    member, until_us = wire.member("cc"), wire.now_us + int(lost_s * 1e6)
    wire.wire.drop = lambda sender, _r, put: (
        sender == "cc" and put.key.startswith("acl/0/cc") and wire.now_us < until_us
    )
    asked = wire.question("cc", "0", Hold(), within_us=3_000_000)
    for _ in range(60):
        for payload in forgeries(member.boot, draw):
            wire.wire.put("", Put(receipt_key("cc", "0"), payload, Urgency.ACT))
        wire.run(0.1)
    if lost_s > 10:
        assert asked.failed
    else:
        assert asked.performatives
        assert any(isinstance(command.order, HoldOrder) for _, command in wire.vehicle("0").commands)


def test_a_genuine_receipt_ends_the_repetition() -> None:
    wire = fleet()
    wire.asked("cc", "0", Hold())
    wire.run(1)
    assert wire.member("cc").acts.conversations.delivery.unacknowledged == 0
