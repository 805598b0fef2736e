"""Archives of many gateways' recordings: an open table of what is in them, questions to it, upload and work in parallel."""
