from collections.abc import Mapping
from typing import Any

from runtime.library.async_federation import AsyncFederationClient as AsyncFederationClient
from runtime.library.federation import FederationClient as FederationClient
from runtime.library.federation import connect as connect
from runtime.library.feed import Feed as Feed
from runtime.library.own_platform import OwnPlatform as OwnPlatform
from runtime.library.own_platform import join as join
from runtime.library.results import QueryResult as QueryResult
from runtime.library.results import UnitSample as UnitSample

def loaded(name: str, places: Mapping[str, str] = ..., of: str = ...) -> Any: ...
