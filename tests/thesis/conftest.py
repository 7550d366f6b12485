from tests.agents.conftest import wire

__all__ = ["wire"]
