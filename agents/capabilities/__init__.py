"""The capabilities of a UAV: a folder each, found by its `capability.py`. `dyknow.agents.capabilities.capability` says how one is made."""
