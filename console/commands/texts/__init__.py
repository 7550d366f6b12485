"""Commands about texts: specifications, formulas and chronicles, checked, run and verified.

Most work on files alone; with `--unit` they ask a running platform. Errors are drawn at their place in the text.
"""
