"""Authentication: rosters of members and keys, signatures, the replay window, TLS and access rules.

A federation without a roster is open. The modules' docstrings say what each measure protects against.
"""
