import ast
from pathlib import Path
from types import ModuleType

import pytest

from dyknow.federation.messages import contents


@pytest.mark.parametrize("package", [contents])
def test_the_api_is_what_the_package_imports_and_nothing_else(package: ModuleType) -> None:
    tree = ast.parse(Path(str(package.__file__)).read_text(encoding="utf-8"))
    imported = [alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names]
    assert sorted(imported) == sorted(package.__all__)
    assert len(set(imported)) == len(imported)
    rest = [node for node in tree.body if not isinstance(node, ast.ImportFrom | ast.Assign | ast.Expr)]
    assert rest == []
    assert all(hasattr(package, name) for name in package.__all__)
