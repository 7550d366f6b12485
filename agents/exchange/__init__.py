"""Streams between platforms: the federation agent, the gateway, the export and import proxies (thesis 9.3.3).

Labels are translated here, queries answered, contracts kept. Samples take a fast path that builds nothing else.
"""
