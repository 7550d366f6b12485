"""The protocol of a federation, pure: how its members find each other, their speech acts and their shared streams.

`members` has the directory, liveness, clocks and the member itself (`Member`), `messages` the speech acts, `sharing`
the streams and the meanings of their labels, `security` the checks of messages, `hosts` the local channel. Import from
the module that has the name.
"""
