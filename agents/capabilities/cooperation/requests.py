"""The requests for cooperation that can be delegated by hand; the parts need not be loaded."""

from typing import Final

from agents.actions import Action, Role
from federation.messages import contents

SHARE: Final = Action(contents.Share, "on_share", role=Role.COMMAND_CENTRE, typed=True)
