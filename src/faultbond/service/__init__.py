"""The on-line service: live sources in, every sample through the core, what was found kept and shown.

In: a site, or models and a source. Out: records in a store, messages to those who listen, an operator's page.
Read `messages`, `site`, `sources`, `asset`, `alarm`, `store`, `watching`, `web`, `serving`.
"""
