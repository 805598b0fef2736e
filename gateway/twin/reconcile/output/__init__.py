"""The result of a reconciliation and its forms: JSON, text, files."""
