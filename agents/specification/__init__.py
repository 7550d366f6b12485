"""The KPL specification of a platform, as far as it concerns other platforms (thesis 9.3.3).

Exports, imports and monitors over units become streams, subscriptions and plans. Declarations that concern the
platform alone run in `dyknow.kpl.running`.
"""
