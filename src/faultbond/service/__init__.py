"""The on-line service: live sources in, every sample through the core, what was found kept and shown.

In: a site, or models and a source. Out: records in a store, messages to those who listen, an operator's page.
Read `contract`, `safe_svg`, `process_picture`, `site`, `sources`, `alarm`, `asset`, `site_log`, `store`,
`asset_status`, `shown`, `site_view`, `hub`, `supervisor`, `wall_clock`, `station`, `web`; `door`, `systemd`,
`log_lines`, `program`; `history`.
"""
