"""A world model together with its prior knowledge, as both are read."""

from functools import lru_cache
from hashlib import sha256
from typing import NamedTuple

from dyknow.anchoring.belief.description import WorldModel
from dyknow.anchoring.belief.files.knowledge import read_knowledge
from dyknow.anchoring.belief.files.models import read_world_model
from dyknow.anchoring.belief.knowledge.memory import PriorKnowledge
from dyknow.anchoring.belief.knowledge.ontology import KnowledgeBundle
from dyknow.model.errors import TextError, TextErrors, WrongCall


class DescribedWorld(NamedTuple):
    """A model and its prior knowledge; `digest` of the texts distinguishes it from others."""

    model: WorldModel
    bundles: tuple[KnowledgeBundle, ...] = ()
    digest: str = ""


@lru_cache(maxsize=4)
def read_world(files: tuple[tuple[str, str], ...]) -> DescribedWorld:
    """Of some files, each its path and its text: first the model, then prior knowledge.

    Raises:
        TextErrors: the errors of one of them, or two bundles contradict each other.
    """
    (path, text), *others = files
    model = read_world_model(text, path)
    bundles = tuple(read_knowledge(each, model, name) for name, each in others)
    try:
        PriorKnowledge(model.types.names, bundles)
    except WrongCall as wrong:
        last, said = others[-1]
        raise TextErrors((TextError(str(wrong), text=said, file=last),)) from None
    whole = "\0".join(each for _, each in files)
    return DescribedWorld(model, bundles, sha256(whole.encode("utf-8", "surrogatepass")).hexdigest())
