"""Platform processes that a command starts: configured, followed until ready, ended by their id.

The options of the command become the configuration of each process. Nothing is ended that was not started here.
"""
