"""The reading of recordings: files, timelines, intervals, samples."""
