"""Commands about processes and keys on this machine: up, down, join, host, demo, doctor, roster.

They start, show and end platform processes. Nothing here speaks to other platforms but through `dyknow.console.centre`.
"""
