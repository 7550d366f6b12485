"""Knowledge process hosts: operating system processes that make streams for a platform (thesis 5.2, 5.3).

Both sides are here as values: how the platform sees a host, and what a host runs. The bytes between them are `federation.hosts` and `proxies.hosts`.
"""
