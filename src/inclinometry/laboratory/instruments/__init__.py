"""Live instruments: line protocols described as data, the port they come through, the reader, drivers of rigs."""
