"""The configuration of a platform, with the files it names read."""

from pathlib import Path

from dyknow.agents.config import PlatformConfig
from dyknow.agents.exchange.options import TranslationOptions
from dyknow.agents.extensions import load_extension
from dyknow.agents.monitoring.options import MonitoringOptions
from dyknow.agents.specification.options import RunOptions, SpecificationOptions
from dyknow.compunits import catalogue
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.sharing.ontology import Ontology
from dyknow.federation.sharing.translation import Translation
from dyknow.model.errors import WrongCall
from dyknow.proxies.files.named_files import bounded_text
from dyknow.reasoning import Profile, builtin_profiles, parse_profiles
from dyknow.runtime.configuration.config import NodeConfig
from dyknow.runtime.configuration.ontologies import ontology_of
from dyknow.runtime.configuration.road_files import read_roads
from dyknow.runtime.configuration.session import load_trust
from dyknow.runtime.learnt_files import LearntFiles


def read_translation(ontology: Ontology, file: Path) -> Translation:
    """A platform's own labels and units; raises WrongCall and TextError."""
    return Translation.parse(ontology, _text(file, "translation"), str(file))


def read_profiles(file: Path) -> dict[str, Profile]:
    """Profiles of monitors; raises WrongCall and TextError."""
    return parse_profiles(_text(file, "profiles"), str(file))


def _text(file: Path, option: str) -> str:
    try:
        return bounded_text(file)
    except OSError as wrong:
        raise WrongCall(f"{option}: {file} cannot be read ({wrong.strerror}); it is a TOML file.") from None


def platform_config(config: NodeConfig, clock: FederationClock, started_us: int, zid: str) -> PlatformConfig:
    """The platform's configuration from that of its node, files read.

    Raises:
        TextError, RosterError, RoadsError, WrongCall: a file is wrong, and where.
        UnitError: an extension does not load.
    """
    ontology = ontology_of(config.extensions, config.ontology)
    specification, run = config[SpecificationOptions], config[RunOptions]
    labels, learnt = config[TranslationOptions].translation, specification.learnt
    profiles = dict(builtin_profiles())
    if (own := config[MonitoringOptions].profiles) is not None:
        profiles |= read_profiles(own)
    return PlatformConfig(
        unit=config.unit,
        boot=started_us // 1000,
        zid=zid,
        clock=clock,
        options=config.chosen(),
        vehicle=config.vehicle.kind != "none",
        period_us=config.period_ms * 1000,
        ontology=ontology,
        translation=None if labels is None else read_translation(ontology, labels),
        profiles=profiles,
        trusted=config.trusted,
        learnt={} if learnt is None else LearntFiles(learnt, config.unit).read(),
        trust=load_trust(config.trust, config.wire.federation, started_us, config.unit),
        catalogue=catalogue(run.modules).offered,
        roads=None if run.roads is None else read_roads(run.roads),
        extensions=tuple(part for name in config.extensions for part in load_extension(name).parts),
    )
