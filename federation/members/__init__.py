"""Membership in a federation: directory, liveness, clock offsets, and the member itself.

Every participant holds a replica of the directory, fed by tokens, heartbeats and descriptions. No server, no broker.
"""
