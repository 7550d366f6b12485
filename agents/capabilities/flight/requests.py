"""The orders to a vehicle that can be delegated by hand; the parts need not be loaded."""

from typing import Final

from dyknow.agents.actions import Action, Role
from dyknow.federation.messages import contents

FLIGHT: Final = tuple(
    Action(content, handler, role=Role.COMMAND_CENTRE, typed=True)
    for content, handler in (
        (contents.Goto, "on_goto"),
        (contents.Hold, "on_hold"),
        (contents.Land, "on_land"),
        (contents.ReturnHome, "on_return_home"),
        (contents.Resume, "on_resume"),
    )
)
