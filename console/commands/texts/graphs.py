"""The network of an instance, drawn."""

from typing import TYPE_CHECKING, Literal, TypeAlias

from console.command import Call

if TYPE_CHECKING:
    from kpl import Instance

GraphForm: TypeAlias = Literal["text", "json", "mermaid", "dot"]


def show_graph(call: Call, instance: "Instance", form: str) -> None:
    """Print the network in a form."""
    from kpl.introspection.graph import as_dot, as_json, as_mermaid, as_text, graph_of

    found = graph_of(instance)
    if call.out.json_lines or form == "json":
        call.out.line(as_json(found))
        return
    text = {"text": as_text, "mermaid": as_mermaid, "dot": as_dot}[form](found)
    call.out.plain(text, folds=form == "text")
