"""What the pages are made with: numbers, drawings, the API reference, and the reading of docstrings."""
