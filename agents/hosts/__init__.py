"""Knowledge process hosts: operating system processes that make streams for a platform (thesis 5.2, 5.3).

Both sides are here as values: a host as its platform sees it, and the processes that a host runs. The bytes between
them are `dyknow.federation.hosts` and `dyknow.proxies.hosts`.
"""
