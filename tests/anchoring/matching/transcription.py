"""Section 3 of "Have another look", written down sentence by sentence, with nothing of the product.

A percept is a mapping from properties to values, None where a property was not observed; a description maps properties to the
values they may have. The quotations are those that decide.
"""

from collections.abc import Mapping
from typing import Any

Percept = Mapping[str, Any]


def complete(description: Mapping[str, list[Any]], percept: Percept) -> bool:
    """All the observed properties in the percept match the description and vice versa."""
    return all(percept.get(name) is not None and percept[name] in allowed for name, allowed in description.items())


def partial(description: Mapping[str, list[Any]], percept: Percept) -> bool:
    """All the observed properties match, but there is some property in the description that was not observed."""
    observed = {name: percept[name] for name in description if percept.get(name) is not None}
    return all(value in description[name] for name, value in observed.items()) and len(observed) < len(description)


def section_3(
    description: Mapping[str, list[Any]],
    percepts: Mapping[str, Percept],
    *,
    is_definite: bool,
    is_reacquire: bool = False,
    is_cautious: bool = False,
    is_only_one: bool = False,
) -> tuple[int, str, set[str], str | None]:
    """The case, what is returned, the percepts of its anchors, and the recovery."""
    whole = {name for name, percept in percepts.items() if complete(description, percept)}
    part = {name for name, percept in percepts.items() if partial(description, percept)}
    definite = is_definite or is_reacquire  # "in Reacquire descriptions are always definite"
    if len(whole) == 0 and len(part) == 0:
        return 1, "fail", set(), "search"  # "return a failure message ... we generate a search plan"
    if len(whole) == 0:
        if definite and is_only_one and len(part) == 1:
            return 3, "anchor", part, None  # "the case turns into one of a complete matching"
        return 2, "temporary", part, "recover"  # "temporary anchors for each of the candidates"
    if len(whole) == 1 and len(part) == 0:
        return 3, "anchor", whole, None  # "one just picks that candidate"
    if len(whole) == 1:
        if definite and is_cautious:
            return (
                4,
                "temporary",
                whole | part,
                "recover_cautious",
            )  # "anchors both for the complete ... and the incomplete"
        return 4, "anchor", whole, None  # "one can just pick the completely matching candidate"
    if definite:
        return 5, "fail", set(), "description_insufficient"  # "considered insufficient ... made more precise"
    return 5, "anchor", {min(whole)}, None  # "just pick one of the candidates"
