"""Bare acknowledgements: a platform's message when it has no other act for the sender.

They travel on the sender's own act key, to an agent that no platform has. With a roster they are signed, as acts are: a
forged one would end the repetition of an act that never arrived.
"""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, TypeAlias

from dyknow.federation import keys
from dyknow.federation.messages.codec import MAX_ACKS
from dyknow.federation.messages.unpacking import codec, count, fail, fields, many, pack, unpack

RECEIPT_AGENT: Final = "receipt"
"""The agent chunk of the act key on which receipts travel."""


class Receipt(NamedTuple):
    """The acts `seqs` of incarnation `boot` of the receiver of this receipt have arrived."""

    boot: int
    seqs: Sequence[int]


def receipt_key(receiver: str, sender: str) -> str:
    return keys.act(receiver, sender, RECEIPT_AGENT)


encode_receipt, decode_receipt = codec(Receipt, count, many(count, MAX_ACKS))

Signature: TypeAlias = bytes


def encode_signed(receiver: str, receipt: Receipt, sign: Callable[[bytes], Signature]) -> bytes:
    """A receipt for `receiver`, and the signature over both."""
    body = encode_receipt(receipt)
    return pack((body, sign(signed_bytes(receiver, body))))


def decode_signed(payload: bytes) -> tuple[Receipt, Signature, bytes]:
    """The receipt, its signature, and its bytes; raises DecodeError."""
    body, signature = fields(unpack(payload), 2)
    if type(body) is not bytes or type(signature) is not bytes or len(signature) != 64:
        fail("unsigned")
    return decode_receipt(body), signature, body


def signed_bytes(receiver: str, body: bytes) -> bytes:
    """The bytes under the signature: never the body of an act, and for one receiver."""
    return b"receipt\0" + receiver.encode() + b"\0" + body
