"""Which percepts could be the object that a description means, and the recovery if that is ambiguous.

A description has allowed values of properties; a percept has observed ones, and some that were not observed. The five cases are
those of Broxvall, Coradeschi, Karlsson and Saffiotti, "Have another look", section 3.
"""
