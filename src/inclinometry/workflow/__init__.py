"""Use cases, shared by the command line and whatever other face there is, so that they cannot diverge."""
