"""Numbers, and nothing about tools: constants, angles, the one gate for arrays, least squares, errors."""
