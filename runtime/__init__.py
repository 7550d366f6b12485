"""One process: node clock, mailbox, loop, and effects that are performed.

One thread owns all state; edges post and return. This is where values of `agents` meet the edges of `proxies`.
"""
