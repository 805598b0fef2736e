"""Where a message of a session may have come from: its links, with the authenticated names."""

import zenoh

MOST_NAMED = 4
"""Basis: a choice; one line of a terminal."""


def describe_links(session: zenoh.Session) -> str:
    """Return the far ends of a session's links: common name where TLS has authenticated one, and address.

    A query does not carry its sender, so that with several links it came from one of them.
    """
    try:
        links = session.info.links()
    except zenoh.ZError:
        return "a link that is down"
    ends = sorted({f"{link.auth_identifier}, {link.dst}" if link.auth_identifier else str(link.dst) for link in links})
    more = f" and {len(ends) - MOST_NAMED} more" if len(ends) > MOST_NAMED else ""
    listed = " or ".join(ends[:MOST_NAMED]) + more
    return listed or "a link that is closed"
