"""Options of monitors."""

from pydantic import Field

from dyknow.agents.options import OptionPath, Options


class MonitoringOptions(Options):
    profiles: OptionPath | None = Field(None, description="Its own profiles of monitors, next to those built in.")


OPTIONS = (MonitoringOptions,)
