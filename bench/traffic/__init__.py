"""Minutes of traffic from seeds, in which cars enter, leave, hide, stop and queue, and what is recognised of them.

`motorway` drives cars over two or three lanes, `manoeuvres` has what they really did and compares it with what `dyknow kpl run`
reports of what was seen.
"""
