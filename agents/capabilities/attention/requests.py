"""The requests for attention that can be delegated by hand; the parts need not be loaded."""

from typing import Final

from dyknow.agents.actions import Action, Role
from dyknow.federation.messages import contents

FOLLOW: Final = Action(contents.Follow, "on_follow", role=Role.COMMAND_CENTRE, typed=True)
ATTEND: Final = Action(contents.Attend, "on_attend", role=Role.COMMAND_CENTRE, typed=True)
WANT: Final = Action(contents.WantObject, "on_want", typed=True)
