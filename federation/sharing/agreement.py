"""Whether two members mean the same by a semantic label (thesis 9.3.3)."""

from dyknow.model.semantic_labels import SemanticLabel

UNTOLD = "another definition, which it does not give"


def disagreement(ours: SemanticLabel | None, theirs: SemanticLabel | None, offered_hash: str | None) -> str:
    """Why a label is not shared with another member, in words with the place of our definition; empty if it can be.

    Args:
        ours: the label's meaning here; None: none.
        theirs: the other's statement of its meaning; None: none, or the one that every member has.
        offered_hash: that of the definition under which the other offers a stream; None: it offers none.
    """
    is_same = ours is None or ours == theirs or (theirs is None and offered_hash in {None, ours.type_hash})
    if is_same and theirs is not None and offered_hash not in {None, theirs.type_hash}:
        return f"it offers a stream of {UNTOLD}, not of {theirs}"
    if ours is None or is_same:
        return ""
    place = f" ({ours.place})" if ours.place else ""
    return f"here it is {ours}{place}; there it is {UNTOLD if theirs is None else theirs}"
