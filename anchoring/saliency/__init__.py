"""The persons that were found, on one map for all platforms (thesis 1.1.2 and 7.1.1).

Percepts with scores become an entry when they were observed for long enough; entries of several platforms of one person are one place.
What other members send passes a gate, and changes nothing but what they say of themselves.
"""
