"""A vehicle for users: those that share a link, subscriptions, publishing, calls, and what it says of itself.

In come the events of a link, out go messages of a generated package. It imports base, link and messages.
"""
