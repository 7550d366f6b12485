"""A local instance: sources, computational units, stream generators and what connects them (thesis 3.3, 4.5).

Streams are made while they are subscribed to. Samples flow by plain calls, time is an argument.
"""
