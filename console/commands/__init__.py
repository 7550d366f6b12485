"""The commands, one module each, in three groups: the fleet, the federation's members, and texts.

A command is registered once and imported when it is called. Code that two commands share lives outside.
"""
