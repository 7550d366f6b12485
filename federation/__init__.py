"""The protocol of a federation, pure: how its members find each other, what they say and what they share.

`members` has what it takes to be in one (`Member`), `messages` the speech acts, `sharing` the streams and what their
labels mean, `security` whose messages are accepted, `hosts` the local channel. Import from the module that has the name.
"""
