"""Files that users name, opened: only what is a file, a text within a limit, and other files that a text names.

All readers of files from anyone open them here. Lines of a pipe come as they are written, and a file that is watched is
compared.
"""
