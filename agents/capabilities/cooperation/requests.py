"""The requests for cooperation that can be delegated by hand; the parts need not be loaded."""

from typing import Final

from dyknow.agents.actions import Action, Role
from dyknow.federation.messages import contents

SHARE: Final = Action(contents.Share, "on_share", role=Role.COMMAND_CENTRE, typed=True)
