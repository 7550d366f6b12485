from collections.abc import Mapping
from typing import Any

from dyknow.runtime.library.async_federation import AsyncFederationClient as AsyncFederationClient
from dyknow.runtime.library.federation import FederationClient as FederationClient
from dyknow.runtime.library.federation import connect as connect
from dyknow.runtime.library.feed import Feed as Feed
from dyknow.runtime.library.own_platform import OwnPlatform as OwnPlatform
from dyknow.runtime.library.own_platform import join as join
from dyknow.runtime.library.results import QueryResult as QueryResult
from dyknow.runtime.library.results import UnitSample as UnitSample

def loaded(name: str, places: Mapping[str, str] = ..., of: str = ...) -> Any: ...
