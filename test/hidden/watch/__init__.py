"""A stage in service that changes, made of the truth of test/hidden, for the study of the watch."""
