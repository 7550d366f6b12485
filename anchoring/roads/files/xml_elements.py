"""Elements of an XML text from outside, one by one: no document type, no entities, bounded size."""

from collections.abc import Iterator
from io import BytesIO
from xml.etree.ElementTree import Element, ParseError, iterparse

from dyknow.anchoring.roads.files.others import OF_ROOTS
from dyknow.anchoring.roads.files.problems import MOST_BYTES, Problems


def elements(text: str | bytes, root: str, problems: Problems) -> Iterator[Element]:
    """The children of the root, whole, in the order of the text; an error ends them."""
    raw = text.encode() if isinstance(text, str) else text
    if len(raw) > MOST_BYTES:
        problems.error(None, None, f"it has {len(raw)} bytes, at most {MOST_BYTES} are read", "cut the network")
        return
    if b"<!DOCTYPE" in raw or b"<!ENTITY" in raw or b"\0" in raw:
        problems.error(None, None, "it has a document type, or is not UTF-8", "write plain XML")
        return
    try:
        yield from _children(raw, root, problems)
    except (ParseError, ValueError) as wrong:
        problems.error(None, None, f"it is no XML: {wrong}", "export it again")


def _children(raw: bytes, root: str, problems: Problems) -> Iterator[Element]:
    depth, top = 0, None
    for event, element in iterparse(BytesIO(raw), events=("start", "end")):  # noqa: S314 - document types are refused above
        if event == "start":
            depth += 1
            if top is None:
                top = element
                if element.tag != root:
                    other = OF_ROOTS.get(element.tag)
                    remedy = f"the root is <{root}>" if other is None else other.remedy
                    problems.error(None, None, f"its root is <{element.tag[:60]}>", remedy)
                    return
        else:
            depth -= 1
            if depth == 1 and top is not None:
                yield element
                top.clear()
