"""Platform processes that a command starts: configured, followed until ready, ended by their id.

What a person asked for becomes the configuration of each process. Nothing is ended that was not started here.
"""
