"""How a platform's own labels and units translate into semantic ones and back (thesis 9.3.3)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from dyknow.documents.documents import toml_document
from dyknow.federation import keys
from dyknow.federation.sharing.ontology import EXAMPLE, Ontology
from dyknow.model.errors import DyknowError, did_you_mean
from dyknow.model.labels import Label
from dyknow.model.sample import Quality, Sample, Value
from dyknow.model.semantic_labels import SemanticLabel
from dyknow.model.values import NO_VALUE, Field, NoValue, Sort
from dyknow.network.generator import Consumer

# unit: (dimension, factor to the first unit of the dimension, offset)
_UNITS: Mapping[str, tuple[str, float, float]] = {
    "m": ("length", 1.0, 0.0),
    "mm": ("length", 1e-3, 0.0),
    "cm": ("length", 1e-2, 0.0),
    "km": ("length", 1e3, 0.0),
    "ft": ("length", 0.3048, 0.0),
    "nmi": ("length", 1852.0, 0.0),
    "m/s": ("speed", 1.0, 0.0),
    "cm/s": ("speed", 1e-2, 0.0),
    "km/h": ("speed", 1 / 3.6, 0.0),
    "kt": ("speed", 1852 / 3600, 0.0),
    "ft/s": ("speed", 0.3048, 0.0),
    "ft/min": ("speed", 0.3048 / 60, 0.0),
    "deg": ("angle", 1.0, 0.0),
    "rad": ("angle", 57.29577951308232, 0.0),
    "degE7": ("angle", 1e-7, 0.0),
    "cdeg": ("angle", 1e-2, 0.0),
    "fraction": ("share", 1.0, 0.0),
    "percent": ("share", 1e-2, 0.0),
    "s": ("time", 1.0, 0.0),
    "ms": ("time", 1e-3, 0.0),
    "us": ("time", 1e-6, 0.0),
    "m/s2": ("acceleration", 1.0, 0.0),
    "g": ("acceleration", 9.80665, 0.0),
    "V": ("voltage", 1.0, 0.0),
    "mV": ("voltage", 1e-3, 0.0),
    "degC": ("temperature", 1.0, 0.0),
    "K": ("temperature", 1.0, -273.15),
    "degF": ("temperature", 5 / 9, -160 / 9),
}


def convert_units(source: str, target: str) -> Callable[[float], float]:
    """The function from a number in one unit to the number in another.

    Raises:
        DyknowError: there is none, since they measure different things or one is not known.
    """
    if source == target:
        return float
    if source not in _UNITS or target not in _UNITS or _UNITS[source][0] != _UNITS[target][0]:
        raise DyknowError(f"{source!r} does not convert to {target!r}; known units: {', '.join(_UNITS)}")
    (_, source_factor, source_offset), (_, target_factor, target_offset) = _UNITS[source], _UNITS[target]
    scale, shift = source_factor / target_factor, (source_offset - target_offset) / target_factor
    return lambda number: number * scale + shift


class LabelConversion:
    """Values of a label from one form to another, order, units and signs of the fields, and their covariance with them.

    Args:
        steps: position in the source, function of the number, and sign, for each field of the target; None: they are alike.

    Attributes:
        is_same: whether nothing changes.
    """

    __slots__ = ("_scales", "_steps", "is_same")

    def __init__(self, steps: Sequence[tuple[int, Callable[[float], float], float]] | None) -> None:
        self._steps, self.is_same = steps or (), steps is None
        self._scales = [sign * (convert(1.0) - convert(0.0)) for _, convert, sign in self._steps]

    def __call__(self, value: Value) -> Value:
        """The value in the other form; `no_value` stays what it is."""
        if self.is_same or value is NO_VALUE:
            return value
        return tuple([_number(value[at], convert, sign) for at, convert, sign in self._steps])

    def sample(self, sample: Sample) -> Sample:
        """The sample in the other form."""
        if self.is_same or sample.value is NO_VALUE:
            return sample
        return sample._replace(value=self(sample.value), quality=self.quality(sample.quality))

    def into(self, consumer: Consumer) -> Consumer:
        """A consumer of samples in the one form for a consumer of the other: the same if nothing changes."""
        if self.is_same:
            return consumer
        return lambda sample: consumer(self.sample(sample))

    def quality(self, quality: Quality) -> Quality:
        """The covariance of converted numbers; a covariance that is not of all fields is left out."""
        rows = quality.covariance
        if self.is_same or not rows:
            return quality
        if len(rows) != len(self._steps):
            return quality._replace(covariance=())
        scaled = [(at, scale) for (at, _, _), scale in zip(self._steps, self._scales, strict=True)]
        return quality._replace(
            covariance=tuple([tuple([rows[i][j] * by * of for j, of in scaled]) for i, by in scaled])
        )


_SAME = LabelConversion(None)


@dataclass(frozen=True, slots=True)
class LocalField:
    """Where a platform keeps one field of a semantic label: its own name, unit and sign."""

    name: str
    unit: str
    negated: bool = False


@dataclass(frozen=True, slots=True)
class LocalLabel:
    """How a platform calls a semantic label.

    Attributes:
        template: the local label; `{unit}` stands for the platform the stream is about.
        sort: the platform's name of the sort.
        fields: one for each field of the ontology's sort, by its name there, in the platform's own order.
    """

    template: str
    sort: str
    fields: Mapping[str, LocalField]


class Translation:
    """Semantic labels <-> the labels and units of one platform.

    A label that is not mentioned is called as in the ontology, `heli-altitude[0]`, and has its units.
    """

    def __init__(self, ontology: Ontology, local: Mapping[str, LocalLabel] | None = None) -> None:
        self.ontology = ontology
        self._local = dict(local or {})

    def over(self, ontology: Ontology) -> "Translation":
        """The same for another ontology that has these labels, too."""
        return Translation(ontology, self._local)

    @staticmethod
    def parse(ontology: Ontology, text: str, file: str = "") -> "Translation":
        """Read a TOML text such as

            [heli-altitude]
            local = "alt_baro[{unit}]"
            fields = { altitude_m = { name = "alt_ft", unit = "ft" } }

        Raises:
            TextError: it is not TOML, the ontology lacks a label or field, or a unit does not convert.
        """
        local: dict[str, LocalLabel] = {}
        document = toml_document(text, file, EXAMPLE)
        for name, entry in document.entries.items():
            if name not in ontology:
                raise document.error(
                    (name,), f"not in the ontology.{did_you_mean(name, tuple(ontology))}", "a label of it"
                )
            try:
                local[name] = _local_label(ontology[name], entry)
            except DyknowError as wrong:
                raise document.error((name,), str(wrong), '[battery], then local = "charge[{unit}]"') from None
        return Translation(ontology, local)

    def _entry(self, semantic_label: str) -> LocalLabel:
        known = self._local.get(semantic_label)
        return known if known is not None else _default_local(self.ontology[semantic_label])

    def local_label(self, semantic_label: str, unit: str) -> Label:
        """This platform's label for `semantic_label` of `unit`; raises UnknownLabel."""
        return Label.parse(self._entry(semantic_label).template.replace("{unit}", keys.unit(unit)))

    def semantic_label(self, local: Label, unit: str) -> str | None:
        """The semantic label that this platform calls `local` when it is about `unit`."""
        return next((name for name in self.ontology if self.local_label(name, unit) == local), None)

    def local_sort(self, semantic_label: str) -> Sort:
        """The sort of the local stream: the platform's field names, units and order."""
        entry, semantic = self._entry(semantic_label), self.ontology[semantic_label].sort
        fields = tuple(Field(field.name, field.unit) for field in entry.fields.values())
        return Sort(entry.sort, fields, unit=semantic.unit)

    def to_semantic(self, semantic_label: str) -> LabelConversion:
        """From values of the local stream to values of the semantic label."""
        fields = self.ontology[semantic_label].sort.fields
        entry = self._entry(semantic_label).fields
        order = list(entry)
        return _converter(
            [
                (order.index(field.name), entry[field.name].unit, field.unit, entry[field.name].negated)
                for field in fields
            ]
        )

    def to_local(self, semantic_label: str) -> LabelConversion:
        """From values of the semantic label to values of the local stream."""
        fields = {field.name: at for at, field in enumerate(self.ontology[semantic_label].sort.fields)}
        units = {field.name: field.unit for field in self.ontology[semantic_label].sort.fields}
        entry = self._entry(semantic_label).fields
        return _converter([(fields[name], units[name], own.unit, own.negated) for name, own in entry.items()])


def _converter(steps: list[tuple[int, str, str, bool]]) -> LabelConversion:
    """Of (position in the source, its unit, unit in the target, negated), one for each field of the target."""
    if all(
        at == place and source == target and not negated for place, (at, source, target, negated) in enumerate(steps)
    ):
        return _SAME
    return LabelConversion(
        [(at, convert_units(source, target), -1.0 if negated else 1.0) for at, source, target, negated in steps]
    )


def _number(value: Value, convert: Callable[[float], float], sign: float) -> Value:
    """Texts and truths have no unit."""
    return value if isinstance(value, NoValue | str | bool) else sign * convert(value)


def _default_local(label: SemanticLabel) -> LocalLabel:
    fields = {field.name: LocalField(field.name, field.unit) for field in label.sort.fields}
    return LocalLabel(f"{label.name}[{{unit}}]", label.sort.name, fields)


def _local_label(label: SemanticLabel, entry: Any) -> LocalLabel:
    plain = _default_local(label)
    match entry:
        case {**known} if known.keys() <= {"local", "sort", "fields"}:
            template, sort = known.get("local", plain.template), known.get("sort", plain.sort)
            given = known.get("fields", {})
        case _:
            raise DyknowError("a label has only local, sort and fields")
    if not isinstance(template, str) or not isinstance(sort, str) or not isinstance(given, dict):
        raise DyknowError('local and sort are texts, fields a table { field = { name = "...", unit = "..." } }')
    Label.parse(template.replace("{unit}", "0"))
    unknown = given.keys() - plain.fields.keys()
    if unknown:
        raise DyknowError(f"it has no field {', '.join(sorted(unknown))}; its fields are {', '.join(plain.fields)}")
    fields = {name: _local_field(name, plain.fields[name], given.get(name, {})) for name in [*given, *plain.fields]}
    return LocalLabel(template, sort, fields)


def _local_field(name: str, plain: LocalField, given: Any) -> LocalField:
    if not isinstance(given, dict) or not given.keys() <= {"name", "unit", "negated"}:
        raise DyknowError(f"{name}: a field has only name, unit and negated")
    own = LocalField(given.get("name", plain.name), given.get("unit", plain.unit), given.get("negated", False))
    if not isinstance(own.name, str) or not isinstance(own.unit, str) or not isinstance(own.negated, bool):
        raise DyknowError(f"{name}: name and unit are texts, negated is true or false")
    convert_units(own.unit, plain.unit)
    return own
