"""The state of many gateways, from their messages."""
