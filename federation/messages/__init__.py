"""Speech acts: their parameters, contents, bytes, conversations and delivery (FIPA SC00061, SC00037).

A message that decodes is well formed; everything else is a DecodeError with its reason. Conversations follow FIPA's
interaction protocols.
"""
