"""The environment model on streams: looks gathered from several sources, beliefs as records.

`gathering` puts what sources report into looks in the order of time, `watch` takes them in, `records` says what is
believed as values of a sort. `trust` compares the reports of a source with the beliefs.
"""
