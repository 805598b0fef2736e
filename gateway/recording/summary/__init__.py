"""The summary of a segment, which the recorder writes and a reader can make again."""
