"""The capabilities of a UAV: a folder each, found by its `capability.py`. `agents.capability` says how one is made."""
