"""The outbox: changes of alerts on the disk before they are sent, for receivers that have missed some."""
