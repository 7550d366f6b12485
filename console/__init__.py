"""The command `dyknow`: its options, its work, and its output for users.

Each command is a module of its own that is imported when it is called. Below the commands: options, output, processes,
and the command's place in the federation.
"""
