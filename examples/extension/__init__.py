"""An extension: a beacon that can be rung, a stream of how often it was, and a command that rings it."""

from examples.extension.beacon import LABELS, Beacon

PARTS = (Beacon,)
COMMANDS = {"ring": ("examples.extension.command:ring", "Ring the beacon of a platform.")}
__all__ = ["COMMANDS", "LABELS", "PARTS"]
