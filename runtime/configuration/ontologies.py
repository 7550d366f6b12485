"""The semantic labels of a process: those of every member, those of its extensions, those of a file."""

from collections.abc import Iterable
from pathlib import Path

from dyknow.federation.sharing.ontology import MAX_FILE, Ontology, default_ontology
from dyknow.model.errors import WrongCall
from dyknow.proxies.files.named_files import bounded_text


def ontology_of(extensions: Iterable[str] = (), file: Path | None = None) -> Ontology:
    """All of them.

    Raises:
        UnitError: an extension does not load.
        TextErrors: the labels of an extension or of the file are wrong, and where.
        WrongCall: the file cannot be read.
    """
    ontology = default_ontology()
    if extensions:
        from dyknow.agents.extensions import labels_of

        ontology = labels_of(extensions)
    return ontology if file is None else ontology.extended(read_ontology(file), str(file))


def read_ontology(path: Path) -> str:
    """The text of a file of labels; raises WrongCall."""
    try:
        return bounded_text(path, 4 * MAX_FILE)
    except OSError as error:
        raise WrongCall(f"--ontology: {path} cannot be read ({error.strerror}); an ontology is a TOML file.") from None
