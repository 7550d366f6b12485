"""Bare acknowledgements: what a platform says when it has nothing else to say to the sender of an act.

They travel on the sender's own act key, to an agent that no platform has. They are not signed: a forged one, from
the sender's place in the key, delays a retransmission and nothing else.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

from federation import keys
from federation.messages.codec import MAX_ACKS
from federation.messages.unpacking import codec, count, many

RECEIPT_AGENT: Final = "receipt"
"""The agent chunk of the act key on which receipts travel."""


class Receipt(NamedTuple):
    """The acts `seqs` of incarnation `boot` of the receiver of this receipt have arrived."""

    boot: int
    seqs: Sequence[int]


def receipt_key(receiver: str, sender: str) -> str:
    return keys.act(receiver, sender, RECEIPT_AGENT)


encode_receipt, decode_receipt = codec(Receipt, count, many(count, MAX_ACKS))
