"""Authentication: rosters of members and keys, signatures, the replay window, TLS and access rules.

A federation without a roster is open. What each measure protects against is in the modules' docstrings.
"""
