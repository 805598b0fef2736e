"""The format of a recording: MCAP records, headers, schemas, numbers, and the summary of a segment."""
