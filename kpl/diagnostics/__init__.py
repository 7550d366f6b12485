"""Common mistakes, as data, and what may have been meant.

Sample errors teach the message that a syntax error gets. Add a sample when a message does not help.
"""
