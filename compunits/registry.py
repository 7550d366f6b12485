"""Where specifications find sources and computational units by name: modules, the library, installed distributions.

A distribution offers units as entry points of the group `dyknow.units`; the name is what specifications call it, the
object is what a decorator of dyknow made, or a module that holds it:

    [project.entry-points."dyknow.units"]
    RoadOf = "roads.units:RoadOf"

Nothing of a distribution is imported before one of its names is asked for, and a name never becomes an import by itself.
"""

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from sys import modules
from traceback import extract_tb
from types import MappingProxyType, ModuleType
from typing import Any, Final

from dyknow import Prototype, prototypes_in
from dyknow.compunits import (
    cars,
    conversions,
    intersection,
    kalman,
    motion,
    near_pairs,
    pair_relations,
    relations,
    smoothing,
)
from dyknow.model.errors import UnitError

GROUP: Final = "dyknow.units"
MAX_CAUSE: Final = 500
"""Most characters of an error from a module that fails."""
_LIBRARY: Final = (conversions, intersection, kalman, motion, relations, smoothing, cars, near_pairs, pair_relations)
_NOT_OFFERED: Final = {"Conversion"}
_OURS: Final = "the library"


@cache
def library() -> Mapping[str, Prototype]:
    """The units that come with dyknow, by name."""
    made = [*conversions.CONVERSIONS, *(each for module in _LIBRARY for each in vars(module).values())]
    return MappingProxyType({p.name: p for p in prototypes_in(made) if p.name not in _NOT_OFFERED})


def load_module(name: str, asked_by: str = "") -> ModuleType:
    """Import a module a user names, on the command line or in a configuration: `roads.units`, or a file `roads.py`.

    Raises:
        UnitError: there is none, or it fails: where, why, and what to do.
    """
    what = asked_by or f"the module {name!r}"
    if name.endswith(".py") and not Path(name).is_file():
        raise UnitError(f"{what}: there is no such file; a module that is installed is named without .py")
    try:
        return _from_file(Path(name)) if name.endswith(".py") else import_module(name)
    except ModuleNotFoundError as error:
        missing = error.name or ""
        if name == missing or name.startswith(f"{missing}."):
            remedy = "is it installed, or its folder on PYTHONPATH?"
            raise UnitError(f"{what}: there is no module {missing!r}; {remedy}") from error
        raise UnitError(f"{what}: {_place(error)}: it needs {missing!r}, which is not installed; install it") from error
    except SyntaxError as error:
        place = f"{error.filename}:{error.lineno}"
        raise UnitError(f"{what}: {place}: {error.msg}; repair it, or do not ask for it") from error
    except (Exception, SystemExit) as error:
        cause = f"{type(error).__name__}: {error}"[:MAX_CAUSE]
        raise UnitError(f"{what}: {_place(error)}: {cause}; repair it, or do not ask for it") from error


def _from_file(path: Path) -> ModuleType:
    """Known by its path, so that a file called `time.py` stands for no other module; once, as imports are."""
    name = str(path.resolve())
    if name in modules:
        return modules[name]
    spec = spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is no Python module")
    module = modules[name] = module_from_spec(spec)  # before it runs, so that its classes know where they live
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del modules[name]
        raise
    return module


def prototypes_of(module: ModuleType) -> Mapping[str, Prototype]:
    """The prototypes of a module, by name, by itself or in a tuple; those that it only imports from the library are
    left out.

    Raises:
        UnitError: two units of one name.
    """
    found: dict[str, Prototype] = {}
    for each in vars(module).values():
        for prototype in prototypes_in(each if isinstance(each, tuple) else [each]):
            if prototype is library().get(prototype.name):
                continue
            if found.setdefault(prototype.name, prototype) is not prototype:
                raise UnitError(
                    f"{_file_of(module)}: two units are called {prototype.name!r}; give one of them a name of its own, "
                    f'`name="..."` in its decorator'
                )
    return found


def catalogue(names: Iterable[str] = ()) -> "Catalogue":
    """Prototypes of the modules so named, of the library, and of installed distributions.

    Raises:
        UnitError: a module is not there or does not load.
    """
    return Catalogue([load_module(name) for name in names])


class Catalogue:
    """Prototypes by name.

    A module that was given decides over everything else, so that what an unfortunate combination of distributions
    makes ambiguous can be resolved by saying which is meant.

    Args:
        given: modules of the user.
        offered: entry points of the group `dyknow.units`; those of the installed distributions if None.

    Raises:
        UnitError: two modules have different units of one name.
    """

    def __init__(self, given: Iterable[ModuleType] = (), offered: Iterable[EntryPoint] | None = None) -> None:
        self._own: dict[str, tuple[Prototype, str]] = {}
        for module in given:
            for name, prototype in prototypes_of(module).items():
                known, place = self._own.setdefault(name, (prototype, _file_of(module)))
                if known is not prototype:
                    raise UnitError(
                        f"{_file_of(module)}: {name!r} is also in {place}; give one of them a name of its own, "
                        f"or use only one of the modules"
                    )
        self._offered: dict[str, list[EntryPoint]] = {}
        for entry in entry_points(group=GROUP) if offered is None else offered:
            if entry not in self._offered.setdefault(entry.name, []):
                self._offered[entry.name].append(entry)
        self._loaded: dict[str, Prototype] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all prototypes, sorted; nothing is loaded for it."""
        return tuple(sorted({*self._own, *library(), *self._offered}))

    def find(self, name: str) -> Prototype:
        """The source or computational unit of that name.

        Raises:
            UnitError: no module offers it, more than one does, or it does not load.
        """
        if name in self._own:
            return self._own[name][0]
        if name in self._loaded:
            return self._loaded[name]
        entries = self._offered.get(name, [])
        ours = library().get(name)
        offers = [*([_OURS] if ours is not None else []), *map(_offer, entries)]
        if len(offers) > 1:
            raise UnitError(
                f"{name!r} is offered by {' and by '.join(offers)}; give the module with the one that is meant, "
                f"or remove the other distribution"
            )
        if ours is not None:
            return ours
        if not entries:
            raise self._unknown(name)
        self._loaded[name] = _load(entries[0])
        return self._loaded[name]

    def offered(self, name: str) -> Prototype | None:
        """The same; None if no module offers it.

        Raises:
            UnitError: more than one does, or it does not load.
        """
        return self.find(name) if name in self._own or name in library() or name in self._offered else None

    def is_ours(self, name: str) -> bool:
        """Whether it is the library's that is found under that name."""
        return name not in self._own and name in library()

    def _unknown(self, name: str) -> UnitError:
        near = get_close_matches(name, self.names, n=3)
        hint = f"did you mean {' or '.join(map(repr, near))}" if near else "give the module that has it"
        return UnitError(f"no unit or source {name!r} in the modules given, the library or an installation; {hint}")


def _load(entry: EntryPoint) -> Prototype:
    asked_by = f"{entry.name!r} of {_offer(entry)}"
    made: Any = load_module(entry.module, asked_by)
    for attribute in entry.attr.split(".") if entry.attr else ():
        made = getattr(made, attribute, None)
    found = prototypes_of(made) if isinstance(made, ModuleType) else {p.name: p for p in prototypes_in([made])}
    if entry.name not in found:
        there = f"there is {', '.join(sorted(found))}" if found else "there is none"
        raise UnitError(
            f"{asked_by}: no unit or source of that name is there, {there}; an entry point has the name of the unit, "
            f"and its object is what a decorator of dyknow made, or a module that holds it"
        )
    return found[entry.name]


def _place(error: BaseException) -> str:
    """File and line of the innermost module that was being imported, whatever it called."""
    frames = extract_tb(error.__traceback__)
    found = [frame for frame in frames if frame.name == "<module>"] or frames
    return f"{found[-1].filename}:{found[-1].lineno}"


def _offer(entry: EntryPoint) -> str:
    owner = entry.dist.name if entry.dist is not None else "a distribution"
    return f"{owner} ({entry.value})"


def _file_of(module: ModuleType) -> str:
    return getattr(module, "__file__", None) or module.__name__
