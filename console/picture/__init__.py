"""One picture of a federation, stepped by the messages of a recorder, live or from a file.

`picture` is the value, `rows`, `measures` and `intents` make its rows, `differences` compares two of them.
The page draws it; `things` are its platforms and objects for formats that have one message a thing.
"""
