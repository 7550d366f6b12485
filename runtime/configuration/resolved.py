"""The configuration of a platform, with the files it names read."""

from pathlib import Path

from agents.config import PlatformConfig
from agents.extensions import load_extension
from compunits import catalogue
from dyknow.model.errors import WrongCall
from federation.members.clock import FederationClock
from federation.sharing.ontology import Ontology
from federation.sharing.translation import Translation
from proxies.files.named_files import bounded_text
from reasoning import Profile, builtin_profiles, parse_profiles
from runtime.configuration.config import NodeConfig
from runtime.configuration.ontologies import ontology_of
from runtime.configuration.road_files import read_roads
from runtime.configuration.session import load_trust
from runtime.learnt_files import LearntFiles


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
    translation = None if config.translation is None else read_translation(ontology, config.translation)
    profiles = dict(builtin_profiles())
    if config.profiles is not None:
        profiles |= read_profiles(config.profiles)
    return PlatformConfig(
        unit=config.unit,
        boot=started_us // 1000,
        zid=zid,
        clock=clock,
        vehicle=config.vehicle.kind != "none",
        avoidance=config.avoidance,
        shedding=config.shedding,
        period_us=config.period_ms * 1000,
        ontology=ontology,
        translation=translation,
        profiles=profiles,
        trusted=config.trusted,
        learnt={} if config.learnt is None else LearntFiles(config.learnt, config.unit).read(),
        trust=load_trust(config.trust, config.wire.federation, started_us, config.unit),
        catalogue=catalogue(config.units).offered,
        roads=None if config.roads is None else read_roads(config.roads),
        extensions=tuple(part for name in config.extensions for part in load_extension(name).parts),
        admission=config.admit,
        encounters=config.encounters is not None,
        govern_us=None if config.govern_ms is None else round(config.govern_ms * 1000),
    )
