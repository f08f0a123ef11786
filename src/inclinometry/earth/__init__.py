"""The site: gravity, Earth rate, references of azimuth and the local field, each with its uncertainty."""
