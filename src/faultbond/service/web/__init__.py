"""The operator's page and the interface behind it.

In: the face of the service. Out: answers to browsers, and a stream of what happens. Read `application`, `security`.
"""
