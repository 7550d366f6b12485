"""Files: recorded flights (.tlog, .bin, .ulg, .mcap), journals, and samples as JSON lines.

Every format yields the same reports with their times. A damaged file is read up to the damage, which is reported.
"""
