"""Messages between a platform and its knowledge process hosts, and their encoding (thesis 5.2, 5.3).

Plain values and strict bytes. The channel is `dyknow.proxies.hosts`, the two sides are `dyknow.agents.hosts`.
"""
