"""Documents of users, TOML and JSON: decoded with limits, read key by key, errors with line, column and repair.

A document knows where the value of a key path stands in its text; tables are read from it, and errors are noted or raised.
Lines of JSON are decoded one by one.
"""
