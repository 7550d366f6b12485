"""Lengths that packed bytes claim, before they are unpacked: an unpacker makes room for as many as are claimed."""

from typing import Final

MOST_NESTED: Final = 64
_FIXED: Final = {
    0xC0: 1, 0xC2: 1, 0xC3: 1, 0xCA: 5, 0xCB: 9, 0xCC: 2, 0xCD: 3, 0xCE: 5, 0xCF: 9, 0xD0: 2, 0xD1: 3, 0xD2: 5, 0xD3: 9,
    0xD4: 3, 0xD5: 4, 0xD6: 6, 0xD7: 10, 0xD8: 18,
}  # fmt: skip
"""Bytes of a value whose first byte says it all."""
_COUNTED: Final = {
    0xC4: (1, 0), 0xC5: (2, 0), 0xC6: (4, 0), 0xC7: (1, 1), 0xC8: (2, 1), 0xC9: (4, 1), 0xD9: (1, 0), 0xDA: (2, 0),
    0xDB: (4, 0),
}  # fmt: skip
"""Bytes of the length of a text, of bytes or of an extension, and bytes between it and them."""
_MANY: Final = {0xDC: (2, 1), 0xDD: (4, 1), 0xDE: (2, 2), 0xDF: (4, 2)}
"""Bytes of the number of an array's or a map's entries, and values of an entry."""


def check_lengths(data: bytes) -> None:
    """Raise ValueError where an array or a map has more entries than bytes follow, or is nested too deep."""
    at, size, owed = 0, len(data), 1
    waiting = [1]
    while waiting:
        if not waiting[-1]:
            waiting.pop()
            continue
        waiting[-1] -= 1
        owed -= 1
        if at >= size:
            raise ValueError("it is cut off")
        head = data[at]
        many = _entries(data, at)
        if many is not None:
            at, entries = many
            owed += entries
            if owed > size - at:
                raise ValueError(f"{owed} values are claimed where {size - at} bytes follow")
            if len(waiting) > MOST_NESTED:
                raise ValueError(f"nested deeper than {MOST_NESTED}")
            waiting.append(entries)
        elif head in _COUNTED:
            width, more = _COUNTED[head]
            at += 1 + width + more + int.from_bytes(data[at + 1 : at + 1 + width], "big")
        elif 0xA0 <= head <= 0xBF:
            at += 1 + (head & 0x1F)
        else:
            at += _FIXED.get(head, 1)


def _entries(data: bytes, at: int) -> tuple[int, int] | None:
    """Of an array or a map: where its values begin, and how many they are."""
    head = data[at]
    if 0x80 <= head <= 0x8F:
        return at + 1, 2 * (head & 0x0F)
    if 0x90 <= head <= 0x9F:
        return at + 1, head & 0x0F
    if head in _MANY:
        width, values = _MANY[head]
        return at + 1 + width, values * int.from_bytes(data[at + 1 : at + 1 + width], "big")
    return None
