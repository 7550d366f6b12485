"""The command as a member of the federation: its connection, its conversations, what it has heard.

It listens, asks and delegates, and offers nothing. The protocol itself is `dyknow.federation.members.Member`.
"""
