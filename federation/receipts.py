"""Bare acknowledgements: what a platform says when it has nothing else to say to the sender of an act.

They travel on the sender's own act key, to an agent that no platform has. They are not signed: who forges one, from
the sender's place in the key, delays a retransmission and nothing else.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import msgpack

from dyknow.errors import DecodeError
from federation import keys
from federation.codec import MAX_ACKS
from federation.unpacking import VERSION, unpack

RECEIPT_AGENT: Final = "receipt"
"""The agent chunk of the act key on which receipts travel."""


class Receipt(NamedTuple):
    """The acts `seqs` of incarnation `boot` of the receiver of this receipt have arrived."""

    boot: int
    seqs: Sequence[int]


def receipt_key(receiver: str, sender: str) -> str:
    return keys.act(receiver, sender, RECEIPT_AGENT)


def encode_receipt(receipt: Receipt) -> bytes:
    packed: bytes = msgpack.packb((VERSION, *receipt))
    return packed


def decode_receipt(payload: bytes) -> Receipt:
    """Raises DecodeError."""
    found = unpack(payload)
    if type(found) is not tuple or len(found) != 3:
        raise DecodeError("shape")
    version, boot, seqs = found
    if type(version) is not int or version != VERSION:
        raise DecodeError("version")
    if type(seqs) is not tuple or len(seqs) > MAX_ACKS:
        raise DecodeError("shape")
    if not all(type(number) is int and number >= 0 for number in (boot, *seqs)):
        raise DecodeError("number")
    return Receipt(boot, seqs)
