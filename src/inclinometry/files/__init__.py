"""Every file format, and the only place besides the faces that knows units: strict reading, whole or no writing."""
