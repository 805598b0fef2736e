"""Which manoeuvre would tell effects apart, before it is driven."""
