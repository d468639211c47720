"""A second truth of another form, which shares no code with the product nor with the first: numpy and scipy only."""
