"""Link declarations at work (thesis Def. 8.5.3): the linkages they declare, and the streams of objects.

Declarations that are chained are one object linkage, so that an object above constrains the prediction of those below.
Roads, which are read from files, are given by the room above.
"""
