"""`dyknow web`: the operator's page, of a federation as it is now or of a recording at any time.

What is shown is one picture, a pure value stepped by the messages of a recording, which a member makes of a live federation
as well. A server for this machine sends its differences to a page of our own, which loads nothing from elsewhere.
"""
