"""The format of a recording: MCAP records, headers, schemas and numbers."""
