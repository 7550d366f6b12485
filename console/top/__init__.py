"""`dyknow top`: a federation in a terminal, looked at again every second; keys sort, filter and open.

The rows are gathered as values, from the member that every command is; the screen, which is an extra, only draws them.
"""
