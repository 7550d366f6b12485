"""The process of a knowledge process host: it connects, lets processes work, reads sources (thesis 5.3).

A source is read in a thread of its own, since a sensor is waited for. It reconnects when the platform returns.
"""
