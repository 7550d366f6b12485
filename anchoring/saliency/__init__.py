"""The persons that were found, on one map for all platforms (thesis 1.1.2 and 7.1.1).

Percepts with scores become an entry when they were observed for long enough; entries of several platforms of one person
are one place. Entries of other members pass a gate, and change nothing but the members' own entries.
"""
