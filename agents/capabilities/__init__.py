"""The capabilities of a UAV: a folder each, found by its `capability.py`. `agents.capabilities.capability` says how one is made."""
