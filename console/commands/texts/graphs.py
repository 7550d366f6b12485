"""The network of an instance, drawn."""

from typing import TYPE_CHECKING, Literal, TypeAlias

from dyknow.console.command import Call

if TYPE_CHECKING:
    from dyknow.kpl import Instance

GraphForm: TypeAlias = Literal["text", "json", "mermaid", "dot", "svg"]


def show_graph(call: Call, instance: "Instance", form: str) -> None:
    """Print the network in a form."""
    from dyknow.kpl.introspection.drawings import as_json, drawn
    from dyknow.kpl.introspection.graph import graph_of

    found = graph_of(instance)
    if call.out.json_lines or form == "json":
        call.out.line(as_json(found))
        return
    call.out.plain(drawn(found, form), folds=form == "text")
