"""What a sensor reports for a true field: the triad U = N a + U0, its temperature polynomial, a tool made of triads."""
