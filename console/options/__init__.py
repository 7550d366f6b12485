"""The command line before it is interpreted: options, federation files, times, the words of a task.

Flags come before environment variables, those before files. Every error names the option or the line and the remedy.
"""
