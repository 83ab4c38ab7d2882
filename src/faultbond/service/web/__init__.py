"""The operator's page, and the interface over HTTP behind it.

In: a `Face` of the service, and a guard who knows people. Out: an application that a server of HTTP runs.
Read `application`, `security`, `shield`, `shapes`, `broadcast`, `page_files`.
"""
