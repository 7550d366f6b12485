"""Configuration of one platform."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from dyknow import Prototype
from dyknow.agents.options import Chosen
from dyknow.agents.part import Part
from dyknow.agents.places import FlightLimits, FlightPlan
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.federation.members.clock import FederationClock
from dyknow.federation.security.trust import Trust
from dyknow.federation.shares import ACTS_BURST, ACTS_PER_S
from dyknow.federation.sharing.ontology import Ontology, default_ontology
from dyknow.federation.sharing.translation import Translation
from dyknow.navigation.cameras.rig import CameraRig
from dyknow.reasoning import Profile, builtin_profiles


@dataclass(frozen=True, slots=True)
class PlatformConfig:
    """Configuration of one platform: see the attributes.

    Attributes:
        unit: its name in the federation.
        boot: which life of it this is: the node clock at its beginning, in milliseconds; greater in each later one.
        zid: identity of its session, for tokens.
        options: those of its parts, by model: `options[SheddingOptions]`; the files that they name are read into other fields.
        vehicle: whether it has one, and so labels to offer.
        cameras: the cameras of its vehicle, if their images are reported.
        simulated: whether faults can be injected.
        control: whether it may command its vehicle.
        missions: whether it may interrupt a mission of its vehicle to give way.
        period_us: the grid of its estimates.
        learnt: parameters that streams of beliefs had learnt, by stream.
        trusted: how far other platforms are trusted, in [0, 1], by unit; others wholly.
        roads: the roads on which linked objects are, unless the specification names others.
        catalogue: prototypes from which its specification can make sources and units, by name.
        stopwatch: federation time as it is within a step, by which it is known how long units take, and which are
            called in workers; None: time is simulated.
        monotonic_offset_us: its node clock minus the monotonic clock of the machine, which hosts have, too.
        extensions: classes of parts that it has besides its own; see `dyknow.agents.extensions`.
        contained: whether what a part raises ends that act or step only; a simulated world may want it raised.
    """

    unit: str
    boot: int
    zid: str = ""
    clock: FederationClock = field(default_factory=FederationClock)
    options: Chosen = field(default_factory=Chosen)
    vehicle: bool = True
    cameras: CameraRig | None = None
    simulated: bool = False
    control: bool = False
    missions: bool = False
    period_us: int = 100_000
    plan: FlightPlan | None = None
    limits: FlightLimits = field(default_factory=FlightLimits)
    ontology: Ontology = field(default_factory=default_ontology)
    translation: Translation | None = None
    profiles: Mapping[str, Profile] = field(default_factory=builtin_profiles)
    trust: Trust | None = None
    learnt: Mapping[str, str] = field(default_factory=dict)
    trusted: Mapping[str, float] = field(default_factory=dict)
    roads: RoadNetwork | None = None
    catalogue: Callable[[str], Prototype | None] = lambda _name: None
    stopwatch: Callable[[], int] | None = None
    monotonic_offset_us: int = 0
    extensions: tuple[type[Part], ...] = ()
    contained: bool = True
    acts_per_s: float = ACTS_PER_S
    acts_burst: float = ACTS_BURST

    @property
    def rig(self) -> CameraRig:
        """The cameras of a platform that has some."""
        if self.cameras is None:
            raise ValueError("a platform without cameras has no part that looks")
        return self.cameras
