"""What the parts of the service agree with: messages, and the faces of source, store, sink, and of all to the page.

In: nothing but types from below. Out: frozen data and protocols. Read `messages`, `source`, `store`, `face`, `sink`.
"""
