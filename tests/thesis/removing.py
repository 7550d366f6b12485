"""Plugin of pytest: one module of the product is loaded without what a definition asks for (`removed.toml`).

DYKNOW_REMOVED=3 pytest -p tests.thesis.removing tests/thesis/streams/test_streams.py::test_...
"""

import os
import sys
import tomllib
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import spec_from_file_location
from pathlib import Path
from types import CodeType
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[2]
VARIABLE = "DYKNOW_REMOVED"


class Removed(NamedTuple):
    """What is taken out of a module, and the test that then fails.

    Attributes:
        of: the definitions or sections whose meaning it is.
        module: its path.
        text: what stands there, once; `put` stands there instead.
        test: its file, below tests/, and name.
    """

    of: tuple[str, ...]
    module: str
    text: str
    put: str
    test: str


def removed() -> list[Removed]:
    found = tomllib.loads((Path(__file__).parent / "removed.toml").read_text(encoding="utf-8"))["removed"]
    return [Removed(tuple(each.pop("of")), **each) for each in found]


class _Loader(SourceFileLoader):
    def __init__(self, name: str, path: str, one: Removed) -> None:
        super().__init__(name, path)
        self._one = one

    def get_code(self, _fullname: str) -> CodeType:
        source = Path(self.path).read_text(encoding="utf-8")
        assert source.count(self._one.text) == 1
        code: CodeType = compile(source.replace(self._one.text, self._one.put), self.path, "exec")
        return code


class _Finder(MetaPathFinder):
    def __init__(self, one: Removed) -> None:
        self._one = one
        self._name = f"dyknow.{one.module.removesuffix('.py').replace('/', '.').removeprefix('dyknow.')}"

    def find_spec(self, fullname: str, _path: Any, _target: Any = None) -> ModuleSpec | None:
        if fullname != self._name:
            return None
        path = str(ROOT / self._one.module)
        return spec_from_file_location(fullname, path, loader=_Loader(fullname, path, self._one))


if VARIABLE in os.environ:
    sys.meta_path.insert(0, _Finder(removed()[int(os.environ[VARIABLE])]))
