"""Where messages go: the bus, the page's process and the relay."""
