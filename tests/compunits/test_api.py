import ast
from pathlib import Path

from dyknow import compunits


def test_the_package_file_only_imports() -> None:
    statements = ast.parse(Path(compunits.__file__).read_text(encoding="utf-8")).body
    assert all(isinstance(s, ast.ImportFrom | ast.Assign | ast.Expr) for s in statements)
    assert all(hasattr(compunits, name) for name in compunits.__all__)


def test_every_unit_of_the_library_says_what_it_is() -> None:
    """A docstring on what was decorated: unit, frame or formula stand there."""
    for module in (Path(compunits.__file__).parent).glob("*.py"):
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.decorator_list:
                names = [getattr(getattr(d, "func", None), "id", "") for d in node.decorator_list]
                if {"value_unit", "computational_unit"} & set(names):
                    assert ast.get_docstring(node), f"{module.name}: {node.name}"
