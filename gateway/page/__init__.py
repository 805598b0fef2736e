"""The operator's page: a separate process (`python -m gateway.page`) that receives everything over a private channel."""
