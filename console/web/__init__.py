"""`dyknow web`: the operator's page, of a federation as it is now or of a recording at any time.

The page shows one picture, a pure value stepped by the messages of a recording; a member makes such messages of a live
federation, too. A server for this machine sends its differences to a page of our own, which loads nothing from
elsewhere.
"""
