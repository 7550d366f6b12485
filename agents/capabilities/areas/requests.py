"""The requests for areas that can be delegated by hand; the parts need not be loaded."""

from typing import Final

from dyknow.agents.actions import Action
from dyknow.federation.messages import contents

DIVIDE_AREA: Final = Action(contents.DivideArea, "on_divide", typed=True)
