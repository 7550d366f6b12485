"""The command `dyknow`: what a person types, and what a person reads.

Each command is a module of its own that is imported when it is called. Below the commands: options, output, processes,
and the command's place in the federation.
"""
