"""The words of the thesis as values: samples, labels, sorts, instants, errors (thesis 4.3).

Everything else imports from here, and this drawer from nothing. Instants are integers of microseconds.
"""
