"""Link declarations at work (thesis Def. 8.5.3): what they come to, and the streams of objects that they make.

Declarations that are chained are one object linkage, so that an object above constrains the prediction of those below.
Roads, which are read from files, are given by the room above.
"""
