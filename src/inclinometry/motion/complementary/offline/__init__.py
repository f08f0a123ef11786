"""The filter of recorded samples: forward, backward, and every sample from both."""
