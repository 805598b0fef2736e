"""The operator's page: a process of its own (`python -m gateway.page`) that learns everything over Zenoh."""
