"""Commands that pass what the federation knows to other programs, live.

Each joins as a member that, but for the page of `web`, only reads, and ends with Ctrl-C. None leaves this machine unless the user wants that.
"""
