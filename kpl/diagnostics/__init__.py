"""Common mistakes, as data, and suggestions for them.

Sample errors teach the message that a syntax error gets. Add a sample when a message does not help.
"""
