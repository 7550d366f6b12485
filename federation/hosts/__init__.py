"""What a platform and its knowledge process hosts say to each other, and how it is encoded (thesis 5.2, 5.3).

Plain values and strict bytes. The channel is `proxies.hosts`, the two sides are `agents.hosts`.
"""
